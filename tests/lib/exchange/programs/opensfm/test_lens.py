"""OpenSfM's camera models against OpenCV's code, and as cameras of a flight."""

import json

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opensfm import lens
from acx4lib.exchange.safe import json_tree
from acx4lib.exchange.safe.opened import Opened

IDEAL = np.array([[0.0, 0.0], [0.1, -0.2], [-0.3, 0.15], [0.25, 0.3]])
SIZE = {"width": 600, "height": 400}


def node(**values):
    return json_tree.tree(Opened(file="c.json", data=json.dumps(values).encode()))


def by_opencv(points, coefficients, project):
    x = np.column_stack([points, np.ones(len(points))])[:, None]
    return project(x, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))[0][:, 0]


def by_fisheye(points, coefficients):
    x = np.column_stack([points, np.ones(len(points))])[:, None]
    at, _ = cv2.fisheye.projectPoints(
        x, np.zeros((3, 1)), np.zeros((3, 1)), np.eye(3), np.array(coefficients)
    )
    return at[:, 0]


def test_brown_is_opencvs_model():
    k = {"k1": -0.2, "k2": 0.1, "p1": 0.003, "p2": -0.002, "k3": 0.01}
    at = lens.MODELS["brown"](lambda name: k.get(name, 0.0), IDEAL)
    assert_allclose(at, by_opencv(IDEAL, list(k.values()), cv2.projectPoints), atol=1e-12)


@pytest.mark.parametrize("kind", ["fisheye_opencv", "fisheye62"])
def test_fisheye_models_are_opencvs_with_more_terms(kind):
    k = {"k1": -0.02, "k2": 0.01, "k3": 0.003, "k4": -0.002}
    at = lens.MODELS[kind](lambda name: k.get(name, 0.0), IDEAL)
    assert_allclose(at, by_fisheye(IDEAL, list(k.values())), atol=1e-12)


def test_dual_is_between_perspective_and_fisheye():
    for weight, kind in ((1.0, "perspective"), (0.0, "fisheye")):
        k = {"k1": -0.02, "k2": 0.01, "transition": weight}
        got, want = (
            lens.MODELS[one](lambda n, k=k: k.get(n, 0.0), IDEAL) for one in ("dual", kind)
        )
        assert_allclose(got, want, atol=1e-15)


@pytest.mark.parametrize("kind", lens.MODELS)
def test_pixels_and_rays_are_inverse(kind):
    focal = {"focal_x": 1.1, "focal_y": 1.2, "c_x": 0.02, "c_y": -0.01}
    one = lens.read(
        node(projection_type=kind, focal=1.0, k1=-0.03, k2=0.01, transition=0.4, **focal, **SIZE)
    )
    colrow = np.array([[0.0, 0.0], [599, 399], [300, 100]])
    ideal = one.ideal(colrow)
    k = {"k1": -0.03, "k2": 0.01, "transition": 0.4}
    at = lens.MODELS[kind](lambda name: k.get(name, 0.0), ideal)
    assert_allclose(one.hole.colrow(at), colrow, atol=1e-8)


def test_a_middle_of_the_image_and_a_focal_length_are_in_pixels():
    one = lens.read(node(focal=0.9, **SIZE))
    assert (one.hole.fx, one.hole.cx, one.hole.cy) == (540.0, 299.5, 199.5)
    one = lens.read(node(projection_type="radial", focal_x=1, focal_y=2, c_x=0.01, c_y=0.1, **SIZE))
    assert (one.hole.fx, one.hole.fy) == (600.0, 1200.0)
    assert (one.hole.cx, one.hole.cy) == (305.5, 259.5)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"projection_type": "spherical"},
            "projection_type: 'spherical'; has rays in all directions",
        ),
        ({"projection_type": "fisheye624", "focal": 1}, "'fisheye624'; must be one of perspective"),
        ({"projection_type": 3.5}, "projection_type: 3.5; must be text"),
        ({}, "c.json:1: file: 'focal' is missing"),
        ({"focal": 540}, "may"),
        ({"focal": 0}, "focal: 0; must be the focal length divided by the longer side"),
        ({"focal": 1, "width": -5}, "width: -5; must be a positive whole number"),
    ],
)
def test_what_is_no_camera_is_refused(values, message):
    if message == "may":
        assert lens.read(node(**{**SIZE, **values})).hole.fx == 540 * 600
        return
    with pytest.raises(FlightError, match=message):
        lens.read(node(**{**SIZE, **values}))
