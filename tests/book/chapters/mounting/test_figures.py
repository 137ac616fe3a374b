"""Figures of the mounting calibration, and of what is held."""

import json
import re
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.mounting import figures, held
from acx4book.chapters.mounting.figures import image_redundancy, weak_places
from acx4lib import design
from acx4lib.bundle.reliability import reliability
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


def marks(ax):
    """Return places and values of scattered marks."""
    return [(np.asarray(c.get_offsets()), np.asarray(c.get_array())) for c in ax.collections]


def test_points_have_the_largest_detectable_error_of_their_rays(single_step):
    left = drawn(weak_places(single_step)).axes[0]
    ((at, value),) = marks(left)
    network = single_step.bundle.network
    detectable = reliability(single_step.bundle.solution.group("image_point")).detectable
    points = network.image_points.point_idx
    expected = [detectable[points == p].max() for p in np.unique(points)]
    assert_allclose(np.sort(value), np.sort(np.clip(expected, 2.0, 20.0)), rtol=1e-12)
    assert np.all(np.diff(value) >= 0)  # the weak ones are drawn last
    place = network.block.frame.to_grid(single_step.bundle.state.x_m[points])[:, :2] / 1000
    low, high = place.min(axis=0), place.max(axis=0)
    assert_allclose([at.min(axis=0), at.max(axis=0)], [low, high])


def test_control_and_positions_have_their_worst_coordinate(single_step):
    right = drawn(weak_places(single_step)).axes[1]
    for (_, value), kind in zip(marks(right), ("gnss", "control_point"), strict=True):
        detectable = reliability(single_step.bundle.solution.group(kind)).detectable
        assert_allclose(value, detectable.max(axis=1))


def test_the_image_plane_has_the_mean_redundancy_of_its_cells(single_step):
    fig = drawn(image_redundancy(single_step))
    points = single_step.bundle.network.image_points
    r = single_step.bundle.solution.group("image_point").redundancy
    for d, ax in enumerate(fig.axes[:2]):
        (image,) = ax.images
        size = 4000 / 16
        shown = image.get_array()
        assert shown.shape == (12, 16)
        row, col = np.unravel_index(np.nanargmin(np.ma.filled(shown, np.nan)), shown.shape)
        inside = np.all(points.colrow // size == [col, row], axis=1)
        assert inside.sum() >= 3
        assert shown[row, col] == pytest.approx(r[inside, d].mean())
        assert ax.get_ylim() == (3000, 0)  # rows count downwards


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


def test_rays_lead_from_all_images_of_a_point_to_it(mounted, layers):
    (rays,) = named(layers, "the ")
    ends = at(rays).reshape(-1, 2, 3)
    assert np.ptp(ends[:, 1], axis=0) == pytest.approx(0.0)
    seen = mounted.network.image_points.point_idx
    assert len(ends) == np.bincount(seen)[ties(mounted)].max()


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


def test_of_several_cameras_there_is_none(mountings):
    single = mountings["single_step"]
    two = replace(single.calibration, cameras=single.calibration.cameras * 2)
    fig = held.over_heights(mountings["two_step_gnss"], replace(single, calibration=two))
    assert "one camera" in drawn(fig).axes[0].texts[0].get_text()
