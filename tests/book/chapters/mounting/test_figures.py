"""Figures of where a block is weak: what is dark in them, and their labels."""

import matplotlib as mpl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.mounting.figures import image_redundancy, mounting_per_image, weak_places
from acx4lib.attempts import Failed
from acx4lib.bundle.reliability import reliability
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting
from acx4lib.errors import AdjustmentError

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


def test_maps_have_one_scale_and_units(single_step):
    fig = drawn(weak_places(single_step))
    left, right = fig.axes[:2]
    assert left.get_aspect() == right.get_aspect() == 1.0
    assert left.get_xlim() == right.get_xlim()
    labels = [ax.get_xlabel() for ax in fig.axes]
    assert labels == [
        "grid east (km)",
        "grid east (km)",
        "largest detectable error of a ray (px)",
        "largest detectable error (m)",
    ]


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


def test_a_method_that_was_left_out_has_a_sentence_for_its_images():
    failed = Failed(method="two_step", reason="no control", error=AdjustmentError("no control"))
    (text,) = drawn(mounting_per_image(failed)).axes[0].texts
    assert text.get_text() == "The method was left out: no control"
