"""Figures of the mounting calibration, and of what is held."""

import json
import re
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest

from acx4book.chapters.mounting import figures, held
from acx4lib import design
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from support import blocks

# --- figures of where a block is weak: what is dark in them, and their labels ----------------


mpl.use("agg")


@pytest.fixture(scope="module")
def single_step(mounted):
    return Mounting(method="single_step", calibration=from_bundle(mounted), bundle=mounted)


def drawn(fig):
    fig.canvas.draw()
    return fig


# --- The block in space shows the adjusted block, in metres


@pytest.fixture(scope="module")
def layers(single_step):
    text = figures.view(single_step).html
    data = json.loads(re.search(r'<script type="application/json">(.*?)</script>', text)[1])
    return {layer["name"]: layer for layer in data["layers"]}


def at(layer):
    return np.array(layer["at"]).reshape(-1, 3)


def named(layers, beginning):
    return [layer for name, layer in layers.items() if name.startswith(beginning)]


def test_every_image_has_a_pyramid_whose_corners_are_those_of_the_image(mounted, layers):
    edges = np.concatenate([at(layer) for layer in named(layers, "cameras")]).reshape(-1, 16, 3)
    assert len(edges) == len(mounted.T_m_c)
    (control,) = named(layers, "control")
    middle = mounted.state.x_m[mounted.network.control.point_idx[0]] - at(control)[0]
    for pyramid in edges + middle:
        image = np.argmin(np.linalg.norm(mounted.T_m_c.r - pyramid[0], axis=1))
        camera = mounted.cameras[mounted.network.block.images.camera_idx[image]]
        colrow = project(camera, mounted.T_m_c[np.full(4, image)], pyramid[1:8:2])
        width, height = camera.width_px - 1, camera.height_px - 1
        expected = np.array([[0, 0], [width, 0], [width, height], [0, height]])
        assert colrow == pytest.approx(expected, abs=20)  # coordinates are rounded to 0.1 m


def ties(mounted):
    return np.setdiff1d(mounted.network.image_points.point_idx, mounted.network.control.point_idx)


def test_ellipsoids_are_the_covariances_of_tie_points(mounted, layers):
    (drawn,) = named(layers, "axes of error ellipsoids")
    times = float(re.search(r"([\d.e+]+) times", drawn["name"])[1])
    axes = np.diff(at(drawn).reshape(-1, 3, 2, 3), axis=2)[:, :, 0] / 2 / times
    every = ties(mounted)
    chosen = every[:: -(-len(every) // figures.MOST_ELLIPSOIDS)]  # of many every n-th
    cov = np.einsum("nki,nkj->nij", axes, axes)
    expected = mounted.solution.cov_points[chosen]
    scale = np.trace(expected, axis1=1, axis2=2)[:, None, None]
    assert cov / scale == pytest.approx(expected / scale, abs=0.03)


# --- held ------------------------------------------------------------------------------------
#
# The figure of the held lever arm: what it shows is what the calibrations do to a ground point.


CAMERA = replace(blocks.CAMERA, T_b_c=Pose(R=np.eye(3), r=np.zeros(3)))


def test_a_lever_arm_alone_moves_the_ground_by_itself_from_any_height():
    moved = replace(CAMERA, T_b_c=Pose(R=np.eye(3), r=np.array([0.3, -0.2, 0.1])))
    for height in (500.0, 2000.0):
        off = held.off_ground(moved, CAMERA, height)
        assert off == pytest.approx([0.3, -0.2, 0.1], abs=1e-9)


def test_a_focal_length_alone_lowers_the_ground_with_the_height():
    longer = replace(CAMERA, interior=replace(CAMERA.interior, f=1.001 * CAMERA.interior.f))
    assert held.off_ground(longer, CAMERA, 1000.0) == pytest.approx([0, 0, -1.0], abs=1e-6)


def test_the_error_on_the_ground_is_straight_and_nearly_zero_between_the_heights(mountings):
    two, single = mountings["two_step_gnss"], mountings["single_step"]
    (ax,) = drawn(held.over_heights(two, single)).axes
    heights = [level.height_m for level in design.levels(single.bundle.network.block)]
    for line, axis in zip(ax.get_lines()[:3], range(3), strict=True):
        x, y = line.get_data()
        between = np.interp(heights, x, y)
        assert y == pytest.approx(np.interp(x, x[[0, -1]], y[[0, -1]]), abs=1e-3)
        assert np.abs(between).max() < 0.5 * np.abs(y[[0, -1]]).max()
        for at in (0, -1):
            cameras = (method.calibration.cameras[0] for method in (two, single))
            assert y[at] == pytest.approx(100 * held.off_ground(*cameras, x[at])[axis])
