"""Heads turned on purpose."""

import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image.wrong_heads import transposed
from acx4lib.synthetic_image.frame import coverage
from support.pictures import printed_camera

ORIENTATION = printed_camera.heads()


def test_transposed_rotations_leave_47_per_cent_uncovered():
    """The share of the geometry of Table 1 read the other way round."""
    synthetic = printed_camera.synthetic()
    assert coverage(ORIENTATION, synthetic).share[0] == 0.0
    assert coverage(transposed(ORIENTATION), synthetic).share[0] == pytest.approx(0.47, abs=0.01)


def test_transposing_twice_changes_nothing():
    assert_allclose(transposed(transposed(ORIENTATION)).opk, ORIENTATION.opk, atol=1e-12)
