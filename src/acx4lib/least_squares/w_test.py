"""Tests of single observations: Baarda's w and Pope's tau, of those taken out too."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from acx4lib import expected
from acx4lib.expected import Array, Mask
from acx4lib.least_squares.normal_equations import Group

OUT = 1e4
"""Factor on the sigma of an observation that is out: it has no effect, but a prediction."""

CONTROLLED = 1e-4
"""Redundancy below which the others say nothing of an observation."""

FEW = 20
"""Number of w below which their spread is not judged."""

MEDIAN_SIGMA = 1.17
"""Standard deviation of a spread from the median size of w, times the root of their number."""


def statistics(group: Group, out: Mask) -> tuple[Array, Mask]:
    """Return the test statistics of a group: of what takes part, and of what is out.

    Parameters
    ----------
    group : Group
        Adjusted with `OUT` times the sigma of what is out.
    out : ndarray
        Of the group's shape, or one that spreads over it.

    Returns
    -------
    w : ndarray, shape (m, d)
        Size of w; of what is out, the one that it would have if it alone took part. That is the
        residual against the prediction from the others over their common standard deviation.
    controlled : ndarray, shape (m, d)
        Where the others say something of it.
    """
    explained = np.maximum(1 - group.redundancy, 0.0) * group.sigma**2
    sigma_sq = np.square(np.where(out, group.sigma / OUT, group.sigma))
    predicted = np.abs(group.v) / np.sqrt(sigma_sq + explained)
    w = np.nan_to_num(np.where(out, predicted, np.abs(group.w)))
    share = np.where(out, sigma_sq / (sigma_sq + explained), group.redundancy)
    return w, np.nan_to_num(share) > CONTROLLED


def w_limits(groups: Sequence[Group], outs: Sequence[Mask], critical: float) -> list[float]:
    """Return the limit of w for each group, in units of its spread where that is more than one.

    Parameters
    ----------
    groups, outs
        As in `statistics`.
    critical : float
        Of a normal variable.
    """
    return [
        critical * _excess(np.where(out, np.nan, group.w))
        for group, out in zip(groups, outs, strict=True)
    ]


def _excess(w: Array) -> float:
    """Return by how much the spread of w exceeds one; one where chance alone may do so."""
    known = np.abs(w[np.isfinite(w)])
    if len(known) < FEW:
        return 1.0
    spread = float(np.median(known)) / 0.6745
    return spread if spread > 1 + 3 * MEDIAN_SIGMA / np.sqrt(len(known)) else 1.0


def tau_limits(groups: Sequence[Group], outs: Sequence[Mask], critical: float) -> list[float]:
    """Return the limit of w for each group, the same for all: tau's, in units of sigma0.

    Parameters
    ----------
    groups, outs, critical
        As in `w_limits`.
    """
    cost = redundancy = 0.0
    for group, out in zip(groups, outs, strict=True):
        part = group.used & ~out
        cost += float(np.sum(np.square(group.v[part] / group.sigma[part])))
        redundancy += float(np.sum(group.redundancy[part]))
    sigma0 = np.sqrt(cost / redundancy) if redundancy > 0 else 1.0
    return [sigma0 * critical_tau(critical, redundancy)] * len(groups)


def critical_tau(critical: float, redundancy: float) -> float:
    """Return the critical value of tau as probable as one of a normal variable.

    Parameters
    ----------
    critical : float
        Of a normal variable, two-sided.
    redundancy : float
        Degrees of freedom of sigma0; infinite where there is one or less, as tau is then one.

    Notes
    -----
    Pope (1976): tau^2 = r t^2 / (r - 1 + t^2), t of Student's distribution with r - 1.
    """
    expected.positive_number("critical", critical)
    if redundancy <= 1:
        return np.inf
    t = float(stats.t.isf(stats.norm.sf(critical), redundancy - 1))
    return t * float(np.sqrt(redundancy / (redundancy - 1 + t**2)))
