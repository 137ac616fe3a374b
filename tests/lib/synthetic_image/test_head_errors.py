"""Errors of the heads in the calibrated synthetic camera, against cameras calibrated anew."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration import estimates
from acx4lib.calibration.heads import varied
from acx4lib.flight.block import select_cameras
from acx4lib.synthetic_image.carried import carry, synthetic_block
from acx4lib.synthetic_image.head_errors import parameter_covariance
from support.flights import in_heads
from support.flights.simulated import HEADS

FREE = ("f", "xp", "yp", "k1", "k2", "p1", "p2")
SIZES = np.concatenate(
    [
        np.tile([2e-4, 2e-4, 2e-4, 3e-6, 3e-6, 3e-6], 4),  # mm and radians
        np.tile([2e-4, 2e-4, 2e-4, 1e-9, 0.0, 0.0, 1e-9, 1e-9, 0.0], 4),
    ]
)
"""Errors of heads that move points by some hundredths of a pixel; zero is held."""


@pytest.fixture(scope="module")
def measured():
    return select_cameras(in_heads.one_centre(), HEADS)


@pytest.fixture(scope="module")
def synthetic():
    return select_cameras(in_heads.one_centre(), ["SYN"]).cameras[0]


def calibrated(measured, orientation, synthetic):
    """Return the carried points and the bundle of the synthetic camera."""
    carried = carry(measured, orientation, synthetic)
    block = synthetic_block(measured, carried, synthetic)
    return carried, adjust(mounted_orientation(block, free=FREE))


def reported(bundle):
    return np.array([p.value for p in estimates.parameters(estimates.from_bundle(bundle))])


@pytest.mark.parametrize("seed", [1, 2])
def test_heads_that_are_off_move_the_parameters_as_their_covariance_says(measured, synthetic, seed):
    """Of one direction in which all heads are off, the covariance is the square of the change."""
    off = SIZES * np.random.default_rng(seed).normal(size=len(SIZES))
    right = replace(in_heads.true_orientation(), cov_joint=np.outer(off, off))
    carried, bundle = calibrated(measured, right, synthetic)
    cov = parameter_covariance(bundle, measured, carried, right)
    wrong = right
    for i in np.flatnonzero(off):
        wrong = varied(wrong, int(i), float(off[i]))
    _, moved = calibrated(measured, wrong, synthetic)
    change = reported(moved) - reported(bundle)
    assert_allclose(np.sqrt(np.diag(cov)), np.abs(change), rtol=0.01)
    assert_allclose(cov, np.outer(change, change), rtol=0.02)


def test_heads_without_errors_add_nothing(measured, synthetic):
    right = in_heads.true_orientation()
    carried, bundle = calibrated(measured, right, synthetic)
    assert not parameter_covariance(bundle, measured, carried, right).any()


def test_independent_errors_add_their_squares(measured, synthetic):
    right = in_heads.true_orientation()
    carried, bundle = calibrated(measured, right, synthetic)
    parts = []
    for i in (0, 3, 10, 24, 40):
        one = np.zeros(len(SIZES))
        one[i] = SIZES[i] ** 2
        heads = replace(right, cov_joint=np.diag(one))
        parts.append(parameter_covariance(bundle, measured, carried, heads))
    every = np.zeros(len(SIZES))
    every[[0, 3, 10, 24, 40]] = SIZES[[0, 3, 10, 24, 40]] ** 2
    together = replace(right, cov_joint=np.diag(every))
    found = parameter_covariance(bundle, measured, carried, together)
    assert_allclose(found, np.sum(parts, axis=0), rtol=1e-6, atol=1e-12 * np.abs(found).max())
