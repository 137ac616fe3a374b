"""What commands that import say and leave."""

import csv
import json
import re
import tomllib

import numpy as np
import pytest
import tifffile
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4book.command import importing
from acx4book.command.importing import KINDS
from acx4files.flight import reader
from acx4files.flight.reader import read
from acx4files.results import folder
from acx4files.results.read_back import read_relative_orientation
from acx4lib.errors import FlightError
from acx4lib.synthetic_image.frame import head_pose
from support.pictures import tagged
from support.projects import colmap, metashape, opf, scene

# --- imports of other adjustments as their users meet them: files, lines and statuses --------


LIST = "P1 C\n1006 -1.5 1.5\n1020 3.0 -0.75\n-99\n"
CONTROL = "WGS84 UTM 22S\n669850.0 7187900.0 900.0 10 20 a.jpg\n"
MODEL = {"projection_type": "perspective", "width": 400, "height": 300, "focal": 0.9}
SHOT = {"camera": "m", "rotation": [0, 0, 0], "translation": [0, 0, 0]}
MICMAC = """<SetOfMesureAppuisFlottants><MesureAppuiFlottant1Im><NameIm>a.JPG</NameIm>
<OneMesureAF1I><NamePt>P</NamePt><PtIm>1 2</PtIm></OneMesureAF1I>
</MesureAppuiFlottant1Im></SetOfMesureAppuisFlottants>"""
SIZED = ("--size", "400x300")
KINDS_BLOCKS = {
    "opensfm": (json.dumps({"cameras": {"m": MODEL}, "shots": {"a.jpg": SHOT}}), ()),
    "micmac": (MICMAC, ()),
    "bingo": (LIST, (*SIZED, "--pixel-um", 20)),
    "patb": (LIST, (*SIZED, "--pixel-um", 20, "--unit", "mm")),
    "odm-control": (CONTROL, ("--camera", "C")),
}


@pytest.mark.parametrize("kind", KINDS_BLOCKS)
def test_a_flight_is_begun_and_what_it_lacks_is_named(acx4, tmp_path, kind):
    content, options = KINDS_BLOCKS[kind]
    source = tmp_path / "source"
    source.write_text(content)
    status, said, wrong = acx4("import", kind, source, "--out", tmp_path / "f", *options)
    assert (status, wrong) == (0, "")
    assert "  assumed: " in said
    assert "  found: " in said
    assert "  still to do: " in said
    assert 'name = "f"' in (tmp_path / "f" / "flight.toml").read_text() or kind == "micmac"
    assert "SHA-256" in (tmp_path / "f" / "import.md").read_text()


@pytest.mark.parametrize("kind", KINDS_BLOCKS)
def test_a_file_of_something_else_is_one_line(acx4, tmp_path, kind):
    source = tmp_path / "source"
    source.write_bytes(b"\x89PNG\r\n\x1a\n\0\0")
    _, options = KINDS_BLOCKS[kind]
    status, said, wrong = acx4("import", kind, source, "--out", tmp_path / "f", *options)
    assert (status, said) == (2, "")
    assert len(wrong.splitlines()) == 1
    assert wrong.startswith(f"{source}:")
    assert not (tmp_path / "f").exists()


@pytest.mark.parametrize("size", ["400", "400x0", "-4x3"])
def test_a_size_is_width_and_height(acx4, tmp_path, size):
    (tmp_path / "a").write_text(LIST)
    options = ("--out", tmp_path / "f", "--pixel-um", "20", "--size", size)
    status, _, wrong = acx4("import", "bingo", tmp_path / "a", *options)
    assert (status, "must be width x height in pixels, such as 4000x3000" in wrong) == (2, True)


@pytest.mark.parametrize(
    ("kind", "instead"),
    [
        ("bundler", "write COLMAP's or Metashape's form, and import that"),
        ("visualsfm", "write COLMAP's or Metashape's form, and import that"),
        ("pospac-text", "acx4 import orientations TEXT --columns pospac"),
    ],
)
def test_a_kind_that_is_gone_says_what_takes_its_place(acx4, kind, instead):
    status, said, wrong = acx4("import", kind, "a.out", "--size", "400x300", "--out", "f")
    assert (status, said) == (2, "")
    assert wrong == f"{kind} is gone; instead: {instead}\n"


# --- what all imports have in common ---------------------------------------------------------


def test_a_flight_that_is_there_says_its_system(tmp_path):
    assert importing.system_of(tmp_path) == {}
    toml = tmp_path / "flight.toml"
    toml.write_text('crs = "EPSG:32633"\nheights = "geoid.gtx"\n')
    assert importing.system_of(tmp_path) == {"crs": "EPSG:32633", "heights": "geoid.gtx"}
    (tmp_path / "geoid.gtx").write_bytes(b"")
    assert importing.system_of(tmp_path)["heights"] == str(tmp_path / "geoid.gtx")


def test_a_system_that_can_be_none_is_refused(tmp_path):
    (tmp_path / "flight.toml").write_text("name = 'a'\nheights = nan\n")
    with pytest.raises(FlightError, match=r"flight.toml:2: heights: nan; must be an undulation"):
        importing.system_of(tmp_path)


# --- importing -------------------------------------------------------------------------------
#
# `acx4 import --help` lists the kinds by what they bring; their options are the readers'.


def test_every_kind_has_its_place_in_the_help(acx4):
    status, said, _ = acx4("import", "--help")
    assert status == 0
    assert all(f"\n  {name} " in said for names in KINDS.values() for name in names)
    assert all(f"{title}:\n  {next(iter(names))} " in said for title, names in KINDS.items())


def test_options_examples_and_limits_are_those_that_the_reader_declares(acx4):
    status, said, _ = acx4("import", "patb", "--help")
    assert status == 0
    assert "  --unit <um|mm>" in said
    assert re.search(r"--pixel-um UM +Pixel size.  \[0.1<=x<=1000.0; required\]", said)
    assert re.search(r"--block NAME +heads, calibration or validation", said)
    assert "  acx4 import patb my_block.im --unit um --size 4000x3000" in said
    status, _, wrong = acx4("import", "patb", "a", "--pixel-um", "0", "--out", "f")
    assert (status, "--pixel-um" in wrong) == (2, True)


# --- ``acx4 import pictures``, ``check``, ``run`` and ``render`` of nothing but pictures -----


TRUE = ((0, 0, 0), (0.2, -0.3, 0.5), (-0.4, 0.1, -0.2), (0.1, 0.5, 0.3))
BANDS = tuple((np.cos(a), np.sin(a)) for a in np.radians([0, 30, 60, 90]))
"""Neighbours see similar things; the first and the last have nothing in common."""

STATED = tuple((a + 0.15, b - 0.1, c + 0.05) for a, b, c in TRUE[1:])


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Four heads at one exposure, in two folders, whose stated angles are off."""
    folder = tmp_path_factory.mktemp("pictures")
    stated = ((0, 0, 0), *STATED)
    for k, grey in enumerate(tagged.pictures_of(TRUE, BANDS)):
        said = tagged.micasense(k, relatives=stated[k], band="abcd"[k])
        place = folder / ("Red" if k < 2 else "Blue") / f"IMG_0007_{k + 1}.tif"
        tagged.write(place, said, pixels=grey)
    return folder


def test_a_folder_of_pictures_becomes_a_flight_that_is_checked(tmp_path, acx4):
    for k in range(2):
        said = tagged.micasense(k, relatives=(0, 0.1 * k, 0), band="ab"[k])
        tagged.write(tmp_path / "pictures" / f"IMG_0007_{k + 1}.tif", said)
    flight = tmp_path / "flight"
    status, said, wrong = acx4("import", "pictures", tmp_path / "pictures", "--out", flight)
    assert (status, wrong) == (0, "")
    assert "assumed: RigRelatives" in said
    assert "still to do" not in said
    status, said, _ = acx4("check", flight)
    assert status == 0
    assert "2: 1 a, 2 b" in said
    assert "# pictures of MicaSense RedEdge-T" in (flight / "import.md").read_text("utf-8")


def test_pictures_alone_turn_the_heads_and_become_a_stack(acx4, pictures, tmp_path):
    """The truth to a third of a pixel; the stated angles are a whole one off."""
    flight, results, images = (tmp_path / name for name in ("flight", "results", "images"))
    assert acx4("import", "pictures", pictures, "--out", flight)[0] == 0
    options = ("--stages", "heads,synthetic", "--numbers-only", "--results", results)
    status, said, _ = acx4("run", flight, *options)
    assert status == 0
    assert "heads: skipped, nothing is measured in block heads" in said
    found = read_relative_orientation(
        folder.read(results), "synthetic/refined", reader.read(flight).cameras
    )
    flip = np.diag([1, -1, -1])
    for k, angles in enumerate(TRUE):
        R = flip @ head_pose(found, k).R @ flip
        true = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
        turned = Rotation.from_matrix(R.T @ true).as_rotvec(degrees=True)
        # what a band sees of the other landscape does not average out
        assert np.abs(turned).max() < 0.05
    options = ("--results", results, "--out", images, "--blend", "stack")
    assert acx4("render", flight, *options)[0] == 0
    stack = tifffile.imread(images / "IMG_0007.tif")
    assert stack.shape == (240, 320, 4)
    likeness = np.corrcoef(stack[20:-20, 20:-20].reshape(-1, 4).astype(float).T)
    assert np.abs(likeness - np.array(BANDS) @ np.transpose(BANDS)).max() < 0.12


# --- `acx4 import image-points | control-points`, as their user meets them -------------------


def test_measurements_and_surveyed_points_are_added_to_a_new_flight(acx4, tmp_path):
    (tmp_path / "a.mes").write_text('"P 1" A 10.5 20.5\n"P 1" B 11 21\n')
    (tmp_path / "a.app").write_text('"P 1" 13 676000 7184000 900.5\n')
    flight = tmp_path / "f"
    acx4("new", flight, "--cameras", "CAM", "--crs", "EPSG:31982", "--heights", "ellipsoidal")
    columns = ("--columns", "point image col row", "--first", "0.5", "--camera", "CAM")
    status, said, wrong = acx4(
        "import", "image-points", tmp_path / "a.mes", *columns, "--out", flight
    )
    assert (status, wrong) == (0, "")
    assert "found: 2 measurements of 1 point in 2 images; columns 10.0 to 10.5" in said
    columns = ("--columns", "point skip x y z", "--role", "check")
    status, said, wrong = acx4(
        "import", "control-points", tmp_path / "a.app", *columns, "--out", flight
    )
    assert (status, wrong) == (0, "")
    assert "found: 1 point, 1 of them to check; heights 900.500 to 900.500 m." in said
    rows = (flight / "control_points.csv").read_text().splitlines()
    assert rows == ["point,east_m,north_m,height_m,role", "P 1,676000.0,7184000.0,900.5,check"]


# --- projects --------------------------------------------------------------------------------
#
# ``acx4 import metashape | colmap | opf`` from the command line, to a flight that is read.


def test_a_rig_of_metashape_becomes_a_flight_that_is_read(acx4, tmp_path):
    source, out = metashape.write(tmp_path / "c.xml"), tmp_path / "flight"
    status, said, _ = acx4("import", "metashape", source, "--block", "calibration", "--out", out)
    assert status == 0
    assert "assumed: Pixels: Metashape counts from the outer corner" in said
    assert "left out: 8 marker locations without pinned" in said
    assert "still to do" not in said
    flight = read(out)
    assert list(flight.cameras) == ["head 0", "head 1"]


def test_a_model_of_colmap_says_what_is_missing(acx4, tmp_path):
    source, out = colmap.write_text(tmp_path / "m"), tmp_path / "flight"
    options = ("--crs", scene.CRS, "--orientations", "adjusted", "--block", "calibration")
    status, said, _ = acx4("import", "colmap", source, *options, "--out", out)
    assert status == 0
    assert "control_points.csv:1: file: is not there" in said
    assert "reprojected by the cameras as imported" in said
    assert "a boresight" in said or "the boresight" in said


@pytest.mark.parametrize("kind", ["metashape", "opf"])
def test_what_is_added_has_the_system_of_the_flight(acx4, tmp_path, kind):
    source = (
        metashape.write(tmp_path / "c.xml") if kind == "metashape" else opf.write(tmp_path / "p")
    )
    out = tmp_path / "flight"
    options = ("--cameras", "head 0", "--crs", "EPSG:32722", "--heights", "4.5")
    assert acx4("new", out, *options)[0] == 0
    assert acx4("import", kind, source, "--block", "calibration", "--out", out)[0] == 0
    settings = tomllib.loads((out / "flight.toml").read_text())
    assert (settings["crs"], settings["heights"]) == ("EPSG:32722", 4.5)
    with (out / "control_points.csv").open() as lines:
        heights = [float(row["height_m"]) for row in csv.DictReader(lines)]
    assert_allclose(heights, scene.scene().points_enh[:, 2] - 4.5, atol=1e-4)
    with (out / "calibration" / "trajectory.csv").open() as lines:
        heights = [float(row["height_m"]) for row in csv.DictReader(lines)]
    assert_allclose(heights, scene.scene().lonlath[:, 2] - 4.5, atol=1e-3)


# --- `acx4 import` of trajectories and lists of orientations, as its user meets it -----------


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
    status, said, _ = acx4(
        *("import", "orientations", files / "pospac.txt"),
        *("--columns", "pospac", "--out", files / "g"),
    )
    assert (status, "those of the camera" in said) == (0, True)
    assert (files / "g" / "import.md").is_file()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("orientations", "eo.txt", "--block", "../x"), "--block': '../x' is not one of 'heads'"),
        (("orientations", "eo.txt", "--heights", "nan"), "--heights: nan: must be at most 200 m"),
        (("orientations", "eo.txt", "--columns", "foo"), "column 'foo' is not known"),
        (("orientations", "none.txt"), "none.txt:1: file: is not there; the import needs it"),
    ],
)
def test_bad_input_is_one_line_and_status_2(acx4, files, monkeypatch, arguments, says):
    monkeypatch.chdir(files)
    status, _, wrong = acx4("import", *arguments, "--out", "f")
    assert (status, says in wrong, wrong.count("\n")) == (2, True, 1)
    assert not (files / "f").exists()
