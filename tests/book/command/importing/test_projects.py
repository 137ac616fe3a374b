"""``acx4 import metashape | colmap | opf`` from the command line, to a flight that is read."""

import csv
import tomllib

import pytest
from numpy.testing import assert_allclose

from acx4lib.flight.reader import read
from support.projects import colmap, metashape, opf, scene


def test_a_rig_of_metashape_becomes_a_flight_that_is_read(acx4, tmp_path):
    source, out = metashape.write(tmp_path / "c.xml"), tmp_path / "flight"
    status, said, _ = acx4("import", "metashape", source, "--block", "calibration", "--out", out)
    assert status == 0
    assert "assumed: Pixels: Metashape counts from the outer corner" in said
    assert "left out: 8 marker locations without pinned" in said
    assert "still to do" not in said
    flight = read(out)
    assert list(flight.cameras) == ["head 0", "head 1"]


def test_a_project_of_opf_becomes_a_flight_that_is_read(acx4, tmp_path):
    source, out = opf.write(tmp_path / "p"), tmp_path / "flight"
    status, said, _ = acx4("import", "opf", source, "--block", "calibration", "--out", out)
    assert (status, "still to do" in said) == (0, False)
    assert len(read(out).calibration.images) == 8


def test_a_model_of_colmap_says_what_is_missing(acx4, tmp_path):
    source, out = colmap.write_text(tmp_path / "m"), tmp_path / "flight"
    options = ("--crs", scene.CRS, "--orientations", "adjusted", "--block", "calibration")
    status, said, _ = acx4("import", "colmap", source, *options, "--out", out)
    assert status == 0
    assert "control_points.csv:1: file: is not there" in said
    assert "reprojected by the cameras as imported" in said
    assert "a boresight" in said or "the boresight" in said


def test_a_wrong_source_is_one_line(acx4, tmp_path):
    path = tmp_path / "c.xml"
    path.write_text("<kml/>")
    status, _, said = acx4("import", "metashape", path, "--out", tmp_path / "flight")
    assert status == 2
    assert said.count("\n") == 1
    assert "c.xml:1: kml: is no file of Metashape" in said
    assert not (tmp_path / "flight").exists()


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
