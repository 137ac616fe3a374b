"""`acx4 import` of trajectories and lists of orientations, as its user meets it."""

import numpy as np
import pytest

OPK = "image x y z omega phi kappa\nA 676000 7184000 1000 1 2 3\n"


@pytest.fixture
def files(tmp_path):
    records = np.zeros((200, 17))
    records[:, 0] = 1000 + 0.01 * np.arange(200)
    records[:, 1:4] = [-0.444, -0.8596, 1000.0]
    (tmp_path / "a.sbet").write_bytes(records.astype("<f8").tobytes())
    (tmp_path / "events.csv").write_text("image,time\nA,1000.5\nB,1001.25\n")
    (tmp_path / "eo.txt").write_text(OPK)
    head = "EVENT TIME(s) EASTING NORTHING ELLIPSOID HEIGHT OMEGA PHI KAPPA"
    (tmp_path / "pospac.txt").write_text(f"{head}\n7 1.5 676000 7184000 1000 1 2 3\n")
    return tmp_path


def test_a_trajectory_at_events_is_added_to_a_new_flight(acx4, files):
    new = ("--cameras", "CAM", "--crs", "EPSG:31982", "--heights", "-25.5")
    acx4("new", files / "f", *new)
    sources = (files / "a.sbet", "--events", files / "events.csv", "--time", "gps-sow")
    status, said, wrong = acx4("import", "sbet", *sources, "--camera", "CAM", "--out", files / "f")
    assert (status, wrong) == (0, "")
    assert "assumed: Heights are ellipsoidal there, and by an undulation of -25.5 m in the" in said
    rows = (files / "f" / "calibration" / "trajectory.csv").read_text().splitlines()
    assert rows[1].startswith("A,-25.439326")
    assert rows[1].split(",")[3] == "1025.5"
    assert "images.csv" not in said.split("still to do", 1)[1]


def test_lists_of_orientations(acx4, files):
    status, said, _ = acx4("import", "orientations", files / "eo.txt", "--out", files / "f")
    assert (status, "found: Positions and attitudes: 1." in said) == (0, True)
    status, said, _ = acx4("import", "pospac-text", files / "pospac.txt", "--out", files / "g")
    assert (status, "those of the camera" in said) == (0, True)
    assert (files / "g" / "import.md").is_file()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("orientations", "eo.txt", "--block", "../x"), "--block: '../x': must be one of heads"),
        (("orientations", "eo.txt", "--heights", "nan"), "--heights: nan: must be at most 200 m"),
        (("orientations", "eo.txt", "--columns", "foo"), "column 'foo' is not known"),
        (("pospac-text", "none.txt"), "none.txt:1: file: is not there; the import needs it"),
    ],
)
def test_bad_input_is_one_line_and_status_2(acx4, files, monkeypatch, arguments, says):
    monkeypatch.chdir(files)
    status, _, wrong = acx4("import", *arguments, "--out", "f")
    assert (status, says in wrong, wrong.count("\n")) == (2, True, 1)
    assert not (files / "f").exists()
