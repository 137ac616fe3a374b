"""A reconstruction projected by the formulas of OpenSfM's documentation, written anew here."""

import json

import numpy as np
import pyproj
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4tools.exchange.outward import opensfm


def projected(camera, x_c):
    """https://opensfm.org/docs/geometry.html, brown, and from normalised to pixel coordinates."""
    x, y = (x_c[:, :2] / x_c[:, 2:]).T
    r2 = x**2 + y**2
    k1, k2, k3, p1, p2 = (camera[k] for k in ("k1", "k2", "k3", "p1", "p2"))
    d = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = d * x + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    yd = d * y + 2 * p2 * x * y + p1 * (r2 + 2 * y**2)
    u = camera["focal_x"] * xd + camera["c_x"]
    v = camera["focal_y"] * yd + camera["c_y"]
    size = max(camera["width"], camera["height"])
    middle = np.array([camera["width"] - 1, camera["height"] - 1]) / 2
    return np.stack([u, v], axis=1) * size + middle


def moved(pose, x):
    return Rotation.from_rotvec(pose["rotation"]).apply(x) + pose["translation"]


def test_points_of_the_ground_are_projected_into_every_image(shown, agrees):
    made = opensfm.images(shown.found, shown.oriented)
    (model,) = json.loads(made.files["reconstruction.json"])
    assert len(model["shots"]) == 12
    for name, shot in model["shots"].items():
        seen = projected(model["cameras"][shot["camera"]], moved(shot, shown.x_m[name]))
        agrees(seen, shown.colrow[name], made.lenses[shot["camera"]])


def test_the_rig_takes_points_of_the_reference_into_the_other_head(shown, agrees):
    made = opensfm.cameras(shown.found)
    rig = json.loads(made.files["rig_cameras.json"])
    models = json.loads(made.files["cameras.json"])
    assert_allclose(rig["LEFT"]["rotation"] + rig["LEFT"]["translation"], 0.0)
    for head, name in shown.first_images().items():
        seen = projected(models[head], moved(rig[head], shown.x_r[head] * [1, -1, -1]))
        agrees(seen, shown.colrow[name], made.lenses[head])


def test_the_reference_is_where_positions_are_zero(shown):
    """PROJ's topocentric axes there have the camera where the translation says."""
    made = opensfm.images(shown.found, shown.oriented)
    (model,) = json.loads(made.files["reconstruction.json"])
    at = model["reference_lla"]
    assert json.loads(made.files["reference_lla.json"]) == at
    there = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +ellps=GRS80 +lon_0={longitude!r} "
        "+lat_0={latitude!r} +h_0={altitude!r} +step +inv +proj=cart +ellps=GRS80 +step "
        "+proj=utm +zone=22 +south +ellps=GRS80".format(**at)
    )
    name, shot = next(iter(model["shots"].items()))
    centre = -Rotation.from_rotvec(shot["rotation"]).inv().apply(shot["translation"])
    enh = shown.oriented.block.frame.to_grid(shown.oriented.T_m_c.r[:1])[0]
    assert name == shown.oriented.names[0]
    assert_allclose(there.transform(*centre), enh, atol=1e-5)
