"""Which matches agree with each other, on numbers alone; shifts by images: test_image_ties."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acx4lib.tie_points.large_shifts import NARROW_PX, WITNESSES, coarse_factor, consensus
from acx4lib.tie_points.matching import OverlapMatches
from acx4lib.tie_points.overlaps import SharedWindow

H = np.array([[1.001, -0.002, 3.0], [0.0015, 0.999, -5.0], [1e-7, -2e-7, 1.0]])


def through_homography(colrow):
    x = np.column_stack([colrow, np.ones(len(colrow))]) @ H.T
    return x[:, :2] / x[:, 2:]


def matches(a, b):
    return OverlapMatches(
        colrow_a=a, colrow_b=b, sigma_px=np.full(a.shape, 0.05), counts=np.zeros(4, dtype=int)
    )


def places(n, rng):
    return rng.uniform([0, 1000], [2600, 8000], size=(n, 2))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.5))
def test_false_matches_are_told_from_those_on_a_homography(seed, share):
    rng = np.random.default_rng(seed)
    a = places(400, rng)
    b = through_homography(a) + rng.normal(scale=0.03, size=a.shape)
    false = rng.random(len(a)) < share
    b[false] += rng.choice([-1, 1], size=(false.sum(), 2)) * rng.uniform(1, 8, (false.sum(), 2))
    agree = consensus(matches(a, b), 0.5)
    assert agree[~false].all()  # 0.5 px are 17 sigma
    assert not agree[false].any()


def test_what_a_badly_known_lens_bends_is_kept_as_a_whole():
    """Radial distortion of 12 px over the overlap, of which no homography makes half a pixel."""
    rng = np.random.default_rng(0)
    a = places(2000, rng)
    off = (a - [3000, 4500]) / 4000
    b = through_homography(a) + 12 * off * np.sum(off**2, axis=1, keepdims=True)
    b[:50] += 2.0
    agree = consensus(matches(a, b), 0.5)
    assert not agree[:50].any()
    assert agree[50:].all()


@pytest.mark.parametrize("n", [0, 1, 2 + WITNESSES])
def test_few_matches_are_no_witnesses(n):
    a = places(n, np.random.default_rng(0))
    assert not consensus(matches(a, a + 1.0), 0.5).any()


def test_matches_by_chance_do_not_agree():
    rng = np.random.default_rng(4)
    a = places(600, rng)
    assert not consensus(matches(a, a + rng.uniform(-8, 8, size=a.shape)), 0.5).any()


@pytest.mark.parametrize(("reduce", "factor"), [(1, 12), (4, 3), (12, 1), (40, 1)])
def test_images_are_reduced_until_overlaps_are_narrow(reduce, factor):
    """The overlaps of Table 1's heads are 2700 px wide, section 2.1 by its numbers."""
    side = 2700 // reduce
    window = SharedWindow(
        head_a=0, head_b=1, window=(0, 3 * side, 0, side), area_px=3.0 * side**2, width_px=side
    )
    assert coarse_factor([window]) == factor
    assert side / factor < 1.5 * NARROW_PX
    assert coarse_factor([]) == 1


# --- few matches -----------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "length"), [(20, 2000), (2600, 7000)])
def test_nine_right_matches_are_kept_and_false_ones_among_them_left_out(width, length):
    """Over a whole overlap, or along one that is hardly wider than the windows."""
    rng = np.random.default_rng(5)
    a = rng.uniform([0, 1000], [width, 1000 + length], size=(11, 2))
    b = through_homography(a) + rng.normal(scale=0.05, size=a.shape)
    b[9:] += [[3.0, -4.0], [-6.0, 1.0]]
    agree = consensus(matches(a, b), 0.5)
    assert agree[:9].all()
    assert not agree[9:].any()


def test_few_matches_by_chance_do_not_agree():
    rng = np.random.default_rng(6)
    for n in (6, 8, 11):
        for _ in range(100):
            a = places(n, rng)
            b = a + rng.uniform(-8, 8, size=a.shape)
            assert not consensus(matches(a, b), 0.5).any()
