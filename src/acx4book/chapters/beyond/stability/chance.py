"""How often many tests alarm where nothing has changed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from acx4lib.expected import Array
from acx4lib.least_squares.covariance import half, sigmas
from acx4lib.least_squares.statistical import distributions
from acx4lib.least_squares.statistical.many_tests import holm

DRAWS = 4000
LEVELS = np.array([0.005, 0.01, 0.02, 0.05, 0.075, 0.1, 0.15, 0.2])

EACH, HOLM, JOINT = "each at the level", "Holm", "χ² of all"


def false_alarms(cov: Array, levels: Array, *, seed: int, draws: int = DRAWS) -> dict[str, Array]:
    """Return the share of comparisons with an alarm, by way of testing.

    Parameters
    ----------
    cov : ndarray, shape (k, k)
        Of a difference whose true value is zero; it is drawn so often.
    levels : ndarray, shape (n,)
    seed, draws : int

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By ``EACH``, ``HOLM`` and ``JOINT``: at least one of k single tests, each at the level; the
        same at a joint level; one test of all.
    """
    rng = np.random.default_rng(seed)
    d = rng.standard_normal((draws, len(cov))) @ half(cov).T
    t = np.abs(d / sigmas(cov))
    p = np.array([[2 * distributions.norm_sf(one) for one in row] for row in t])
    scale = sigmas(cov)
    related = cov / scale[:, None] / scale
    chi_square = np.einsum("ij,ij->i", d / scale, np.linalg.solve(related, (d / scale).T).T)
    joint = np.array([distributions.chi2_sf(one, len(cov)) for one in chi_square])
    smallest = {
        EACH: p.min(axis=1),
        HOLM: np.array([holm(row).min() for row in p]),
        JOINT: joint,
    }
    return {way: np.mean(least[:, None] < levels, axis=0) for way, least in smallest.items()}


def at(shares: Mapping[str, Array], level: float) -> dict[str, float]:
    """Return the shares at the nearest of `LEVELS`."""
    place = int(np.argmin(np.abs(LEVELS - level)))
    return {way: float(share[place]) for way, share in shares.items()}
