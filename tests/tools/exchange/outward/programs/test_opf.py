"""A project by the words of OPF's specification, and as Pix4D's own library reads it."""

import json
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose
from pyopf.io import load
from pyopf.resolve import resolve

from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4tools.exchange.outward import opf


def turn(axis, degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[j, j], R[k, k], R[k, j], R[j, k] = c, c, s, -s
    return R


def rotation(angles):
    a, b, c = angles
    return turn(0, a) @ turn(1, b) @ turn(2, c)


def projected(internals, x_v):
    """Perspective internals of Pix4D, of points with y down and z ahead; library's pixels."""
    x, y = (x_v[:, :2] / x_v[:, 2:]).T
    r2 = x**2 + y**2
    (R1, R2, R3), (T1, T2) = internals["radial_distortion"], internals["tangential_distortion"]
    d = 1 + R1 * r2 + R2 * r2**2 + R3 * r2**3
    xd = x * d + 2 * T1 * x * y + T2 * (r2 + 2 * x**2)
    yd = y * d + 2 * T2 * x * y + T1 * (r2 + 2 * y**2)
    f, at = internals["focal_length_px"], internals["principal_point_px"]
    return np.stack([xd, yd], axis=1) * f + at - 0.5


@pytest.fixture(scope="module")
def made(shown):
    return opf.images(shown.found, shown.oriented)


@pytest.fixture(scope="module")
def files(made):
    return {name: json.loads(text) for name, text in made.files.items()}


def test_rig_relatives_take_a_point_of_the_head_to_the_reference(shown, made, files, agrees):
    """T_s = T_r + R_r T_rel and R_s = R_r R_rel, axes right, down, front."""
    first, second = files["calibrated-cameras.json"]["sensors"]
    assert "rig_relatives" not in first
    own = second["rig_relatives"]
    x_v = shown.x_r["RIGHT"] * [1, -1, -1]
    x_s = (x_v - own["translation"]) @ rotation(own["rotation_angles_deg"])
    seen = projected(second["internals"], x_s)
    agrees(seen, shown.colrow[shown.first_images()["RIGHT"]], made.lenses["RIGHT"])


def test_rig_relatives_have_their_sigma(files):
    own = files["input-cameras.json"]["sensors"][1]["rig_relatives"]
    calibrated = files["calibrated-cameras.json"]["sensors"][1]["rig_relatives"]
    assert_allclose(own["rotation"]["angles_deg"], calibrated["rotation_angles_deg"])
    assert all(1e-4 < sigma < 0.1 for sigma in own["rotation"]["sigmas_deg"])
    assert all(0.01 < sigma < 0.2 for sigma in own["translation"]["sigmas_m"])


def test_cameras_are_oriented_in_the_grid(shown, files):
    """R = Rx Ry Rz from right, top, back to the CRS, positions shifted to its canonical form."""
    scene = files["scene-reference-frame.json"]
    shift = np.array(scene["base_to_canonical"]["shift"])
    names = {one["id"]: one["uri"] for one in files["camera-list.json"]["cameras"]}
    frame, T = shown.oriented.block.frame, shown.oriented.T_m_c
    enh = frame.to_grid(T.r)
    for k, camera in enumerate(files["calibrated-cameras.json"]["cameras"]):
        assert names[camera["id"]] == shown.oriented.names[k]
        assert_allclose(np.array(camera["position"]) - shift, enh[k], atol=1e-6)
        assert np.abs(camera["position"][:2]).max() < 1000
        R = frame.grid_axes(T.r[k : k + 1])[0] @ T.R[k]
        assert_allclose(rotation(camera["orientation_deg"]), R, atol=1e-12)
    assert scene["crs"]["definition"] == "EPSG:31982"


def test_the_specifications_own_library_reads_the_project(made, tmp_path):
    for name, text in made.files.items():
        (tmp_path / name).write_text(text)
    project = resolve(load(str(tmp_path / "project.opf")))
    assert len(project.camera_list.cameras) == 12
    assert len(project.calibration.calibrated_cameras.cameras) == 12
    sensors = project.input_cameras.sensors
    assert [sensor.name for sensor in sensors] == ["LEFT", "RIGHT"]
    assert sensors[1].rig_relatives.rotation.sigmas_deg.min() > 0


@pytest.mark.parametrize("crs", ["EPSG:25833+7837", "+proj=utm +zone=33 +ellps=GRS80 +units=m"])
def test_the_crs_has_two_dimensions_as_heights_are_ellipsoidal(shown, crs):
    """A code or WKT, of which PROJ makes the same grid."""
    block = shown.oriented.block
    frame = MappingFrame(grid=GridSystem(crs=crs), origin=np.array([13.0, 50.0]))
    elsewhere = replace(shown.oriented, block=replace(block, frame=frame))
    made = opf.images(shown.found, elsewhere)
    text = json.loads(made.files["scene-reference-frame.json"])["crs"]["definition"]
    found = pyproj.CRS.from_user_input(text)
    assert not found.is_compound
    assert found.to_wkt().startswith("PROJCRS")
    assert_allclose(
        pyproj.Proj(found)(13.0, 50.0), pyproj.Proj("EPSG:25833")(13.0, 50.0), atol=1e-4
    )
