"""Projects of OPF become flights; the scene and the calibrated points prove it."""

import json
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.programs import opf as reading
from acx4files.flight.settings import camera_of
from acx4lib.geometry.frames import log, rotation_from_opk
from support.helpers import needs
from support.projects import opf, scene

FLIP = np.diag([1.0, -1.0, -1.0])


def attitudes(table):
    """Return R_g_b of a trajectory."""
    names = ("omega_deg", "phi_deg", "kappa_deg")
    return rotation_from_opk(np.radians([table[name] for name in names]).T)


def test_a_project_becomes_a_flight(tmp_path):
    brought = reading.read(opf.write(tmp_path / "p"))
    assert brought.source == "OPF of Writer 2.0"
    assert brought.settings["name"] == "a block"
    assert brought.settings["crs"] == scene.CRS
    assert brought.settings["heights"] == "ellipsoidal"
    images = brought.tables["heads/images.csv"]
    assert images["image"][:2] == ["one.jpg#0", "one.jpg#1"]
    assert images["exposure"][:2] == ["one.jpg#0", "one.jpg#0"]
    assert images["camera"][:2] == ["head 1", "head 2"]
    assert len(brought.tables["heads/image_points.csv"]["point"]) == 4 * 2 * 9
    control = brought.tables["control_points.csv"]
    assert control["role"][-2:] == ["control", "check"]
    assert_allclose(control["north_m"], scene.scene().points_enh[:, 1], atol=1e-5)
    assert control["sigma_height_m"] == [0.03] * 9


def test_calibrated_points_are_where_the_imported_cameras_see_them(tmp_path):
    found = reading.read(opf.write(tmp_path / "p")).found
    said = next(one for one in found if one.startswith("the calibrated control points"))
    assert float(re.search(r"to ([\d.e-]+) px rms", said)[1]) < 0.02
    assert "(72 measurements)" in said


@pytest.mark.parametrize("as_opk", [False, True])
def test_measured_and_calibrated_orientations_are_one(tmp_path, as_opk):
    """The scene has the calibrated angles by the grid's own direction of east."""
    folder = opf.write(tmp_path / "p", as_opk=as_opk)
    initial, adjusted = (
        reading.read(folder, orientations=which).tables["heads/trajectory.csv"]
        for which in ("initial", "adjusted")
    )
    for name in ("east_m", "north_m", "height_m"):
        assert_allclose(adjusted[name], initial[name], atol=2e-4)
    apart = np.swapaxes(attitudes(initial), 1, 2) @ attitudes(adjusted)
    assert np.abs(log(apart)).max() < 1e-8
    order = ("roll", "pitch", "heading")
    sigma = [initial[f"sigma_{name}_deg"][0] for name in order]
    assert sigma == ([0.02, 0.03, 0.01] if as_opk else [0.01, 0.02, 0.03])
    assert initial["sigma_east_m"][0] == 0.05  # the second value: latitude is the first axis


def test_bodies_and_mountings_make_the_cameras_of_the_scene(tmp_path):
    brought = reading.read(opf.write(tmp_path / "p"))
    tables = brought.settings["cameras"]
    R_g_b = attitudes(brought.tables["heads/trajectory.csv"])
    first, second = (camera_of(name, tables[name]).T_b_c for name in ("head 1", "head 2"))
    for R, body in zip(opf.cameras_on_map(), R_g_b, strict=True):
        assert_allclose(body @ first.R, R @ FLIP, atol=1e-7)
        assert_allclose(body @ second.R, R @ opf.relative() @ FLIP, atol=1e-7)
        assert_allclose(body @ second.r, R @ opf.BASE, atol=1e-7)


def test_a_constant_undulation_is_that_of_the_flight(tmp_path):
    folder = opf.write(tmp_path / "p")
    path = folder / "input-control-points.json"
    document = json.loads(path.read_text())
    for one in document["gcps"]:
        one["geolocation"]["crs"] = {"definition": "EPSG:31982+5773", "geoid_height": 4.5}
        one["geolocation"]["coordinates"][2] -= 4.5
    path.write_text(json.dumps(document))
    brought = reading.read(folder)
    assert brought.settings["heights"] == 4.5
    heights = brought.tables["control_points.csv"]["height_m"]
    assert_allclose(heights, scene.scene().points_enh[:, 2] - 4.5, atol=1e-5)
    flown = brought.tables["heads/trajectory.csv"]["height_m"]
    assert_allclose(flown, scene.scene().lonlath[:, 2] - 4.5, atol=1e-4)


@needs("formats/opf")
def test_the_specification_s_examples_are_read():
    """They are no project with pictures: what does not fit together is named."""
    brought = reading.read(data.path("formats/opf/project.opf"))
    assert brought.source == "OPF of PIX4Dmatic 1.41.0"
    cameras = brought.settings["cameras"]
    assert cameras["DJI_FC6540_24.0_6016x4008"]["focal_mm"] == pytest.approx(5312.353 * 0.0016)
    mount = camera_of("c", cameras["Parrot_Sequoia_4_0_1280x960 Red"])
    assert_allclose(np.linalg.norm(mount.T_b_c.r), np.hypot(0.015, 0.015))
    assert any("focal_mm 0.6" in one for one in brought.left_out)
    assert len(brought.tables["heads/images.csv"]["image"]) == 5


def test_tie_points_are_brought_and_met(tmp_path):
    brought = reading.read(opf.write(tmp_path / "p", tracks=True))
    points = brought.tables["heads/image_points.csv"]
    assert len(points["point"]) == 72 + 72  # marks, and as many matches of tie points
    assert points["point"][72:75] == ["t0", "t0", "t0"]
    assert points["image"][72:75] == ["one.jpg#0", "one.jpg#1", "two.jpg#10"]
    assert_allclose(points["col_px"][72], points["col_px"][0], atol=2e-4)  # in single precision
    said = next(one for one in brought.found if one.startswith("the calibrated tie points"))
    assert float(re.search(r"to ([\d.e-]+) px rms", said)[1]) < 0.02
    assert "sparse.gltf" in brought.sha256
