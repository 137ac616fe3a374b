"""No control points: the lever arm's height is the height of the ground, and two-step floats."""

from dataclasses import replace

import numpy as np
import pytest

from acx4files.results.sentences import not_determined
from acx4lib.bundle.adjust import adjust, free_orientation
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import from_bundle, is_determined, parameters
from acx4lib.errors import AdjustmentError
from acx4lib.model import Model
from support import blocks


@pytest.fixture(scope="module")
def block():
    """Two heights, both ways: all that a flight can do, but nothing known on the ground."""
    return blocks.noisy(blocks.standard(control=None), np.random.default_rng(3))


def test_only_the_lever_arms_height_is_not_determined(block):
    found = mounting.single_step(block, Model(free=("f", "xp", "yp"))).calibration
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
    assert (
        not_determined(mounting.single_step(known, Model(free=("f", "xp", "yp"))).calibration) == []
    )


def test_a_self_calibration_has_no_datum_and_says_so(block):
    """f is held, as the paper does it; positions, attitudes and scale are all open."""
    fit = adjust(free_orientation(block, Model(free=("xp", "yp"))))
    assert not fit.oriented.any()
    assert fit.solution.undetermined[fit.network.layout.pose].all()
    # xp and yp are not: images know their own geometry
    assert is_determined(from_bundle(fit)).all()


def test_what_is_open_takes_nothing_of_the_redundancy(block):
    """Three positions, three attitudes and a scale; redundancy is the sum of all its shares."""
    solution = adjust(free_orientation(block, Model(free=("xp", "yp")))).solution
    assert solution.defect == 7
    shares = sum(np.nansum(group.redundancy) for group in solution.groups)
    assert solution.redundancy == pytest.approx(shares, abs=1e-6)


def test_two_step_is_refused(block):
    with pytest.raises(AdjustmentError, match="0 control points in images do not orient the block"):
        mounting.two_step(block, Model(free=("xp", "yp")))


def test_two_step_gnss_needs_none(block):
    lever = block.cameras[0].T_b_c.r
    assert np.linalg.norm(lever) > 0.1
    found = mounting.two_step_gnss(replace(block), Model(free=("xp", "yp"))).calibration
    assert not_determined(found) == []
