"""How heads turn against each other from one exposure to the next, seen by their tie points.

Thousands of tie points of one exposure share what moves them together: a shutter that opens late
while the aircraft turns, the parallax of the ground below, a mount that gives. Their number does
not average it out; that of the exposures does. So it is a variance component of its own: at every
exposure each head is turned by an error of its own, with the same variance for all heads.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.least_squares import statistics

ALPHA = 0.01
"""Probability of a component where the noise of the tie points explains the scatter."""

HALVINGS = 60
"""Of the interval in which a variance is looked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OneExposure:
    """The normal equations of one exposure's tie points, at the common estimate.

    Attributes
    ----------
    N : ndarray, shape (n, n)
    h : ndarray, shape (n,)
        J^T P d.
    """

    N: Array
    h: Array


def components(exposures: Sequence[OneExposure], axis: Index, sigma0_sq: float) -> Array:
    """Return the variance by which every exposure turns a head, beyond the noise of tie points.

    Parameters
    ----------
    exposures : sequence of OneExposure
        Two or more; those that do not determine all unknowns by themselves take no part.
    axis : ndarray of int, shape (n,)
        Which component of its head an unknown is; heads have one variance for each.
    sigma0_sq : float
        Variance of unit weight of the tie points.

    Returns
    -------
    ndarray, shape (n,)
        For every unknown that of its component; zero where the scatter is no more than chance.

    Notes
    -----
    Of the estimate x_i of one exposure, x_i less the common one has the variance c_i + 2 t: that
    of its noise, and that of two heads. The variance t is the one at which the sum of their
    weighted squares is its expectation [1]_.

    References
    ----------
    .. [1] R. C. Paule and J. Mandel, "Consensus values and weighting factors", Journal of Research
       of the National Bureau of Standards 87, 1982.
    """
    off, noise = [], []
    for one in exposures:
        if np.linalg.matrix_rank(one.N, hermitian=True) == len(one.N):
            off.append(-np.linalg.solve(one.N, one.h))
            noise.append(sigma0_sq * np.diag(np.linalg.inv(one.N)))
    out = np.zeros(len(axis))
    if len(off) < 2:
        return out
    x, c = np.array(off), np.array(noise)
    for one in np.unique(axis):
        own = np.flatnonzero(axis == one)
        out[own] = _variance(x[:, own], c[:, own])
    return out


def _variance(x: Array, c: Array) -> float:
    """Return t, where x of exposures (rows) scatters about its mean with the variance c + 2 t."""
    dof = (len(x) - 1) * x.shape[1]
    if statistics.chi2_sf(_weighted_squares(x, c, 0.0), dof) > ALPHA:
        return 0.0
    low, high = 0.0, float(np.sum((x - x.mean(axis=0)) ** 2))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        too_small = _weighted_squares(x, c, middle) > dof
        low, high = (middle, high) if too_small else (low, middle)
    return high


def _weighted_squares(x: Array, c: Array, t: float) -> float:
    weight = 1 / (c + 2 * t)
    mean = np.sum(weight * x, axis=0) / np.sum(weight, axis=0)
    return float(np.sum(weight * (x - mean) ** 2))


def covariance(exposures: Sequence[OneExposure], axis: Index, variance: Array) -> Array:
    """Return what the turns of heads at single exposures add to the covariance of the estimate.

    Parameters
    ----------
    exposures, axis
        As in `components`.
    variance : ndarray, shape (n,)
        From `components`.

    Returns
    -------
    ndarray, shape (n, n)
        N^-1 (sum of N_i Q N_i) N^-1, where Q has twice the variance for each head, since the held
        head turns as well, and once between heads.
    """
    same = axis[:, None] == axis
    Q = np.where(same, variance[:, None] * (1 + np.eye(len(axis))), 0.0)
    N = np.sum([one.N for one in exposures], axis=0)
    left = np.linalg.solve(N, np.concatenate([one.N for one in exposures], axis=1))
    n = len(axis)
    parts = left.reshape(n, len(exposures), n).swapaxes(0, 1)
    out: Array = np.einsum("eij,jk,elk->il", parts, Q, parts)
    return out
