"""Tests of single observations, also of rejected ones: Baarda's w and Pope's tau."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Mask
from acx4lib.least_squares.statistical import distributions
from acx4lib.least_squares.statistical.residuals import Group

OUT = 1e4
"""Factor on the sigma of a rejected observation: no effect, but its residual is computed."""

CONTROLLED = 1e-4
"""Redundancy number below which the other observations do not control an observation."""

FEW = 20
"""Number of w below which their spread is not judged."""

MEDIAN_SIGMA = 1.17
"""Standard deviation of a spread from the median size of n values w, times sqrt(n)."""


def statistics(group: Group, out: Mask) -> tuple[Array, Mask]:
    """Return the test statistics of a group's observations, used and rejected ones.

    Parameters
    ----------
    group : Group
        Adjusted with `OUT` times the sigma of rejected observations.
    out : ndarray
        Mask of rejected components; it is broadcast to the group's shape.

    Returns
    -------
    w : ndarray, shape (m, d)
        Absolute value of w. A rejected component is tested as if it alone were used again: its
        difference from the prediction by the others, over the sigma of this difference.
    controlled : ndarray, shape (m, d)
        Components that the other observations control.
    """
    explained = group.explained
    sigma_sq = np.square(np.where(out, group.sigma / OUT, group.sigma))
    predicted = np.abs(group.error) / np.sqrt(sigma_sq + explained)
    w = np.nan_to_num(np.where(out, predicted, np.abs(group.w)))
    share = np.where(out, sigma_sq / (sigma_sq + explained), group.control)
    return w, np.nan_to_num(share) > CONTROLLED


def w_limits(groups: Sequence[Group], outs: Sequence[Mask], critical: float) -> list[float]:
    """Return the limit of w for each group, times the spread of w where that exceeds one.

    Parameters
    ----------
    groups, outs
        As in `statistics`.
    critical : float
        Critical value of a normal variable.
    """
    return [
        critical * _excess(np.where(out, np.nan, group.w))
        for group, out in zip(groups, outs, strict=True)
    ]


def _excess(w: Array) -> float:
    """Return the spread of w where it exceeds one by more than chance explains; else one."""
    known = np.abs(w[np.isfinite(w)])
    if len(known) < FEW:
        return 1.0
    spread = float(np.median(known)) / 0.6745
    return spread if spread > 1 + 3 * MEDIAN_SIGMA / np.sqrt(len(known)) else 1.0


def tau_limits(groups: Sequence[Group], outs: Sequence[Mask], critical: float) -> list[float]:
    """Return the limit of w for each group: the critical tau times sigma0, the same for all.

    Parameters
    ----------
    groups, outs, critical
        As in `w_limits`.
    """
    cost = redundancy = 0.0
    for group, out in zip(groups, outs, strict=True):
        part = group.used & ~out
        cost += float(np.sum(group.squares[part]))
        redundancy += float(np.sum(group.redundancy[part]))
    sigma0 = np.sqrt(cost / redundancy) if redundancy > 0 else 1.0
    return [sigma0 * critical_tau(critical, redundancy)] * len(groups)


def critical_tau(critical: float, redundancy: float) -> float:
    """Return the critical tau with the probability of a normal variable's critical value.

    Infinite for a redundancy of one or less, as tau is then always one.

    Parameters
    ----------
    critical : float
        Critical value of a normal variable, two-sided.
    redundancy : float
        Degrees of freedom of sigma0.

    Notes
    -----
    Pope (1976): tau^2 = r t^2 / (r - 1 + t^2), t of Student's distribution with r - 1.
    """
    expected.positive_number("critical", critical)
    if redundancy <= 1:
        return np.inf
    t = distributions.t_isf(distributions.norm_sf(critical), redundancy - 1)
    return t * float(np.sqrt(redundancy / (redundancy - 1 + t**2)))
