"""Heads turned on purpose."""

import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image.wrong_heads import transposed
from acx4lib.synthetic_image.frame import coverage
from support.pictures import printed_camera


def test_transposed_rotations_leave_47_per_cent_uncovered(orientation):
    """The share of the geometry of Table 1 read the other way round."""
    synthetic = printed_camera.synthetic()
    assert coverage(orientation, synthetic).share[0] == 0.0
    assert coverage(transposed(orientation), synthetic).share[0] == pytest.approx(0.47, abs=0.01)


def test_transposing_twice_changes_nothing(orientation):
    assert_allclose(transposed(transposed(orientation)).opk, orientation.opk, atol=1e-12)
