"""Five real heads over an orchard: pixels to rotations, beside an independent trial."""

import numpy as np
import pytest

from acx4book.reference.heads import pairs, relatives, rotations
from acx4book.reference.heads.solved import FIVE, GREEN, solved, turned_deg
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import overlaps
from support.reference_files import needs

pytestmark = needs(FIVE)


@pytest.fixture(scope="module")
def five():
    return solved(FIVE)


def test_all_heads_are_bound_and_fit_to_a_tenth_of_a_pixel(five):
    table = pairs.pairs(FIVE)
    assert (table["ties"] > 1000).all()
    assert table["rms_px"].max() < 0.15
    assert table["chain"].sum() == len(five.heads) - 1


def test_the_independent_trial_found_the_same_rotations(five):
    """Its points have 0.4 px; a pixel is 0.04 deg."""
    table = rotations.rotations(FIVE)
    assert np.abs(table.filter(like="minus_trial").to_numpy()).max() < 0.005


def test_halves_of_the_picture_turn_the_heads_alike(five):
    """An estimate fits what it has not seen: the ties of one half, heads turned by the other."""
    ties = five.found.ties[~five.fits["rotations"].rejected]
    left = ties.colrow_a[:, 0] < five.synthetic.width_px / 2
    fit = refine_by_rotations(five.factory, ties[left])
    for one in overlaps(ties[~left], fit.orientation):
        assert np.sqrt(np.mean(one.d**2)) / five.synthetic.pixel_mm < 0.35


def test_the_reference_is_not_turned_and_others_are_turned_back(five):
    green = five.place(GREEN)
    assert turned_deg(five.factory, green, green) == pytest.approx([0, 0, 0])
    fit = five.fits["rotations"].orientation
    there, back = turned_deg(fit, 0, green), turned_deg(fit, green, 0)
    assert there == pytest.approx(-back)
    assert {five.reference(k) for k in range(5)} == {green}


def test_heads_without_angles_have_one_reading(five):
    order, transposed = relatives.READINGS["Rx(a) Ry(b) Rz(c), reference to head"]
    read = relatives.read_as(five, order, transposed=transposed)
    assert np.abs(read.opk).max() < 1e-12
