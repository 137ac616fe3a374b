"""``acx4 import metashape | colmap | opf`` from the command line, to a flight that is read."""

import csv
import tomllib

import pytest
from numpy.testing import assert_allclose

from acx4book.command import acx4
from acx4lib.flight.reader import read
from support.projects import colmap, metashape, opf, scene


def run(*arguments):
    with pytest.raises(SystemExit) as end:
        acx4.main([str(one) for one in arguments])
    return end.value.code


def test_a_rig_of_metashape_becomes_a_flight_that_is_read(tmp_path, capsys):
    source, out = metashape.write(tmp_path / "c.xml"), tmp_path / "flight"
    assert run("import", "metashape", source, "--block", "calibration", "--out", out) == 0
    said = capsys.readouterr().out
    assert "assumed: Pixels: Metashape counts from the outer corner" in said
    assert "left out: 8 marker locations without pinned" in said
    assert "still to do" not in said
    flight = read(out)
    assert list(flight.cameras) == ["head 0", "head 1"]


def test_a_project_of_opf_becomes_a_flight_that_is_read(tmp_path, capsys):
    source, out = opf.write(tmp_path / "p"), tmp_path / "flight"
    assert run("import", "opf", source, "--block", "calibration", "--out", out) == 0
    assert "still to do" not in capsys.readouterr().out
    assert len(read(out).calibration.images) == 8


def test_a_model_of_colmap_says_what_is_missing(tmp_path, capsys):
    source, out = colmap.write_text(tmp_path / "m"), tmp_path / "flight"
    options = ("--crs", scene.CRS, "--orientations", "adjusted", "--block", "calibration")
    assert run("import", "colmap", source, *options, "--out", out) == 0
    said = capsys.readouterr().out
    assert "control_points.csv:1: file: is not there" in said
    assert "reprojected by the cameras as imported" in said
    assert "a boresight" in said or "the boresight" in said


def test_a_wrong_source_is_one_line(tmp_path, capsys):
    path = tmp_path / "c.xml"
    path.write_text("<kml/>")
    assert run("import", "metashape", path, "--out", tmp_path / "flight") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "c.xml:1: kml: is no file of Metashape" in said
    assert not (tmp_path / "flight").exists()


@pytest.mark.parametrize("kind", ["metashape", "opf"])
def test_what_is_added_has_the_system_of_the_flight(tmp_path, kind):
    source = (
        metashape.write(tmp_path / "c.xml") if kind == "metashape" else opf.write(tmp_path / "p")
    )
    out = tmp_path / "flight"
    options = ("--cameras", "head 0", "--crs", "EPSG:32722", "--heights", "4.5")
    assert run("new", out, *options) == 0
    assert run("import", kind, source, "--block", "calibration", "--out", out) == 0
    settings = tomllib.loads((out / "flight.toml").read_text())
    assert (settings["crs"], settings["heights"]) == ("EPSG:32722", 4.5)
    with (out / "control_points.csv").open() as lines:
        heights = [float(row["height_m"]) for row in csv.DictReader(lines)]
    assert_allclose(heights, scene.scene().points_enh[:, 2] - 4.5, atol=1e-4)
    with (out / "calibration" / "trajectory.csv").open() as lines:
        heights = [float(row["height_m"]) for row in csv.DictReader(lines)]
    assert_allclose(heights, scene.scene().lonlath[:, 2] - 4.5, atol=1e-3)
