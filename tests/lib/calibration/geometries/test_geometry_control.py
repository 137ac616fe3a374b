"""Too few control points: none, or all on one line."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.bundle.adjust import adjust, free_orientation
from acx4lib.bundle.rejections import Rejection
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import from_bundle, is_determined, not_determined, parameters
from acx4lib.errors import AdjustmentError
from support import blocks

# --- no control points: the lever arm's height is the height of the ground, and two-step floats


@pytest.fixture(scope="module")
def block():
    """Two heights, both ways: all that a flight can do, but nothing known on the ground."""
    return blocks.noisy(blocks.standard(control=None), np.random.default_rng(3))


def test_only_the_lever_arms_height_is_not_determined(block):
    found = mounting.single_step(block, free=("f", "xp", "yp")).calibration
    lines = not_determined(found)
    assert [line.split()[1] for line in lines] == ["lever_z_m"]
    assert "control points" in lines[0]
    sigma = {p.key: p.sigma for p in parameters(found)}
    assert sigma["lever_z"] > 1.0


def test_one_control_point_is_enough_to_know_it(block):
    control = blocks.standard().control[np.array([4])]
    # of the block without control, whose points start with the check points
    point = len(block.points)
    exact = blocks.standard(control=control.x_m)
    known = blocks.noisy(exact, np.random.default_rng(3))
    assert len(known.points) == point + 1
    assert not_determined(mounting.single_step(known, free=("f", "xp", "yp")).calibration) == []


def test_a_self_calibration_has_no_datum_and_says_so(block):
    """f is held, as the paper does it; positions, attitudes and scale are all open."""
    fit = adjust(free_orientation(block, free=("xp", "yp")))
    assert not fit.oriented.any()
    assert fit.solution.undetermined[fit.network.layout.pose].all()
    # xp and yp are not: images know their own geometry
    assert is_determined(from_bundle(fit)).all()


def test_what_is_open_takes_nothing_of_the_redundancy(block):
    """Three positions, three attitudes and a scale; redundancy is the sum of all its shares."""
    solution = adjust(free_orientation(block, free=("xp", "yp"))).solution
    assert solution.defect == 7
    shares = sum(np.nansum(group.redundancy) for group in solution.groups)
    assert solution.redundancy == pytest.approx(shares, abs=1e-6)


def test_two_step_is_refused(block):
    with pytest.raises(AdjustmentError, match="0 control points in images do not orient the block"):
        mounting.two_step(block, free=("xp", "yp"))


def test_two_step_gnss_needs_none(block):
    lever = block.cameras[0].T_b_c.r
    assert np.linalg.norm(lever) > 0.1
    found = mounting.two_step_gnss(replace(block), free=("xp", "yp")).calibration
    assert not_determined(found) == []


# --- control points on one line, or fewer than three: a block may turn about the line --------


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
        mounting.two_step(block_with(control), free=FREE)


def test_the_bundle_itself_says_that_the_attitudes_are_open():
    """Every image may turn with the block about the line."""
    fit = adjust(free_orientation(block_with(on_a_line(12)), free=()))
    assert fit.solution.undetermined[fit.network.layout.pose].any(axis=1).all()
    assert not fit.oriented.any()


def test_three_points_off_a_line_are_enough():
    corners = blocks.crosses()[[0, 2, 7]]
    found = mounting.two_step(block_with(corners), free=FREE).calibration
    true = blocks.CAMERA.T_b_c
    assert np.linalg.norm(found.cameras[0].T_b_c.r - true.r) < 1e-6


def test_points_that_were_rejected_or_not_measured_do_not_count():
    """Twelve on a line and one aside, which is the one that is lost."""
    control = np.concatenate([on_a_line(12), blocks.crosses()[:1]])
    block = block_with(control)
    assert np.isfinite(mounting.two_step(block, free=FREE).calibration.cov).all()
    single = mounting.single_step(block, free=FREE)
    rejected = (Rejection(kind="control_point", row=12, component=2, statistic=9.0),)
    after = replace(single, bundle=replace(single.bundle, rejected=rejected))
    with pytest.raises(AdjustmentError, match="12 control points"):
        mounting.two_step(block, free=FREE, after=after)
    points = block.image_points
    unseen = replace(block, image_points=points[points.point_idx != 12])
    with pytest.raises(AdjustmentError, match="12 control points"):
        mounting.two_step(unseen, free=FREE)


def test_single_step_needs_no_control_to_be_oriented():
    """GNSS and INS orient it; control on a line still gives the lever arm's height."""
    block = block_with(on_a_line(12))
    found = mounting.single_step(block, free=FREE)
    assert found.bundle.oriented.all()
    assert np.linalg.norm(found.calibration.cameras[0].T_b_c.r - blocks.CAMERA.T_b_c.r) < 1e-6
