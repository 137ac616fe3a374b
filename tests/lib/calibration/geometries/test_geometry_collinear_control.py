"""Control points on one line, or fewer than three: a block may turn about the line."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.bundle.adjust import adjust, free_orientation
from acx4lib.bundle.rejections import Rejection
from acx4lib.calibration import mounting
from acx4lib.errors import AdjustmentError
from acx4lib.model import Model
from support import blocks

FREE = ("xp", "yp")


def block_with(control):
    return blocks.standard(control=control)


def on_a_line(n):
    """Points along a slope, as along a road, some 40 m apart."""
    t = np.linspace(-1, 1, n)[:, None]
    return np.array([0.0, 0.0, blocks.GROUND_M]) + t * np.array([250.0, 120.0, 15.0])


def along_a_road():
    """The same, a few centimetres aside: no less open in practice."""
    return on_a_line(12) + np.random.default_rng(6).uniform(-0.05, 0.05, (12, 3))


@pytest.mark.parametrize(
    ("control", "n"),
    [
        (on_a_line(12), 12),
        (on_a_line(3), 3),
        (along_a_road(), 12),
        (blocks.crosses()[:2], 2),
        (blocks.crosses()[:1], 1),
        (None, 0),
    ],
)
def test_two_step_refuses_control_that_does_not_orient_the_block(control, n):
    message = (
        f"{n} control points in images do not orient the block: "
        "three that do not lie on one line are needed"
    )
    with pytest.raises(AdjustmentError, match=message):
        mounting.two_step(block_with(control), Model(free=FREE))


def test_the_bundle_itself_says_that_the_attitudes_are_open():
    """Every image may turn with the block about the line."""
    fit = adjust(free_orientation(block_with(on_a_line(12)), Model()))
    assert fit.solution.undetermined[fit.network.layout.pose].any(axis=1).all()
    assert not fit.oriented.any()


def test_three_points_off_a_line_are_enough():
    corners = blocks.crosses()[[0, 2, 7]]
    found = mounting.two_step(block_with(corners), Model(free=FREE)).calibration
    true = blocks.CAMERA.T_b_c
    assert np.linalg.norm(found.cameras[0].T_b_c.r - true.r) < 1e-6


def test_points_that_were_rejected_or_not_measured_do_not_count():
    """Twelve on a line and one aside, which is the one that is lost."""
    control = np.concatenate([on_a_line(12), blocks.crosses()[:1]])
    block = block_with(control)
    assert np.isfinite(mounting.two_step(block, Model(free=FREE)).calibration.cov).all()
    single = mounting.single_step(block, Model(free=FREE))
    rejected = (Rejection(kind="control_point", row=12, component=2, statistic=9.0),)
    after = replace(single, bundle=replace(single.bundle, rejected=rejected))
    with pytest.raises(AdjustmentError, match="12 control points"):
        mounting.two_step(block, Model(free=FREE), after=after)
    points = block.image_points
    unseen = replace(block, image_points=points[points.point_idx != 12])
    with pytest.raises(AdjustmentError, match="12 control points"):
        mounting.two_step(unseen, Model(free=FREE))


def test_single_step_needs_no_control_to_be_oriented():
    """GNSS and INS orient it; control on a line still gives the lever arm's height."""
    block = block_with(on_a_line(12))
    found = mounting.single_step(block, Model(free=FREE))
    assert found.bundle.oriented.all()
    assert np.linalg.norm(found.calibration.cameras[0].T_b_c.r - blocks.CAMERA.T_b_c.r) < 1e-6
