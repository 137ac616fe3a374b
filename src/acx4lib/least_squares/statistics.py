"""Statistics of residuals.

Weighted squares, distributions, single and multiple tests, and slowly changing errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse, special

from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares import processors

# --- Residuals after an adjustment, with the terms for tests of single observations


LEAST = 1e-6
"""Control below which no other observation controls an observation."""


class Together(NamedTuple):
    """Terms for tests of correlated observations, which contain the other residuals.

    Attributes
    ----------
    weighted : ndarray, shape (m, d)
        sigma (P v), v the residuals and P their weights.
    control : ndarray, shape (m, d)
        sigma^2 times the diagonal of P Q_vv P, Q_vv the covariance of the residuals.
    own : ndarray, shape (m, d)
        sigma^2 times the diagonal of P.
    """

    weighted: Array
    control: Array
    own: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Residuals of one group after the adjustment.

    Attributes
    ----------
    kind : str
    v, sigma, redundancy : ndarray, shape (m, d)
        The redundancy number is the share of an error that shows in its own residual; NaN
        where the component takes no part.
    together : Together, optional
        Where the errors are correlated. With independent ones, `weighted` is v / sigma,
        `control` the redundancy number, and `own` one.
    """

    kind: str
    v: Array
    sigma: Array
    redundancy: Array
    together: Together | None = None

    @property
    def used(self) -> Mask:
        """Which components took part."""
        return np.isfinite(self.sigma)

    @property
    def _sigma_used(self) -> Array:
        return np.where(self.used, self.sigma, np.nan)

    @property
    def weighted(self) -> Array:
        """Weighted residuals times sigma, sigma (P v), shape (m, d)."""
        return self.v / self.sigma if self.together is None else self.together.weighted

    @property
    def squares(self) -> Array:
        """Contribution of each component to the weighted sum of squared residuals, shape (m, d)."""
        if self.together is None:
            return np.square(self.v / self.sigma)
        return self.v / self.sigma * self.together.weighted

    @property
    def control(self) -> Array:
        """Control of an observation by the others: sigma^2 (P Q_vv P)_ii, shape (m, d)."""
        return self.redundancy if self.together is None else self.together.control

    @property
    def error(self) -> Array:
        """Difference from the prediction, of observations with a very large sigma, shape (m, d)."""
        if self.together is None:
            return self.v
        return self._sigma_used * self.weighted / np.where(self.control > 0, self.control, np.nan)

    @property
    def explained(self) -> Array:
        """Variance of this prediction."""
        if self.together is None:
            return np.maximum(1 - self.redundancy, 0.0) * self.sigma**2
        return self._sigma_used**2 * (1 / np.where(self.control > 0, self.control, np.nan) - 1)

    @cached_property
    def w(self) -> Array:
        """Baarda's normalised residuals, a priori sigma; NaN where no observation controls them."""
        w = np.full_like(self.v, np.nan)
        controlled = self.used & (self.control > LEAST)
        control = self.control[controlled]
        if self.together is None:
            w[controlled] = self.v[controlled] / (self.sigma[controlled] * np.sqrt(control))
        else:
            w[controlled] = self.weighted[controlled] / np.sqrt(control)
        return w


# --- Tests of single observations, also of rejected ones: Baarda's w and Pope's tau


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
    """Return the limit of w for each group, times the spread of w if larger than one.

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
    """Return the spread of w if it is significantly larger than one; else one."""
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
    if redundancy <= 1:
        return np.inf
    t = t_isf(norm_sf(critical), redundancy - 1)
    return t * float(np.sqrt(redundancy / (redundancy - 1 + t**2)))


# --- Many tests at one joint level


def holm(p: Array) -> Array:
    """Return the probabilities of many tests, each comparable with one joint level, by Holm.

    If every test is rejected whose value is below the level, the probability that any true
    hypothesis is among the rejected ones is below the level, however the tests depend on each
    other. Bonferroni's factor, the number of tests, applies to the smallest probability; the
    others need less.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Of the single tests; NaN where there is none.

    Returns
    -------
    ndarray, shape (n,)
        Not below `p`, at most one; NaN stays.
    """
    order = np.argsort(p, kind="stable")  # NaN comes last
    n = int(np.isfinite(p).sum())
    ordered = p[order]
    ordered[:n] = np.minimum(1.0, np.maximum.accumulate(ordered[:n] * np.arange(n, 0, -1)))
    out = np.empty_like(ordered)
    out[order] = ordered
    return out


# --- Probabilities and quantiles of the distributions of tests, named as in ``scipy.stats``
#
# The values are those of that package to the last bit. It is not imported, since loading it takes
# longer than adjusting a small flight.


def norm_cdf(x: float) -> float:
    """Return the probability of a standard normal value below x."""
    return norm_sf(-x)


def norm_sf(x: float) -> float:
    """Return the probability of a standard normal value above x."""
    return float(special.ndtr(-x))


def norm_ppf(q: float) -> float:
    """Return the quantile q of the standard normal distribution."""
    return float(special.ndtri(q))


def chi2_cdf(x: float, df: float) -> float:
    """Return the probability of a chi-square value below x >= 0."""
    return float(special.chdtr(df, x))


def chi2_sf(x: float, df: float) -> float:
    """Return the probability of a chi-square value above x >= 0."""
    return float(special.chdtrc(df, x))


def chi2_ppf(q: float, df: float) -> float:
    """Return the quantile q of the chi-square distribution."""
    return float(2 * special.gammaincinv(df / 2, q))


def chi2_isf(q: float, df: float) -> float:
    """Return the value that a chi-square variable exceeds with probability q."""
    return float(special.chdtri(df, q))


def t_isf(q: float, df: float) -> float:
    """Return the value that Student's t exceeds with probability q."""
    return float(-special.stdtrit(df, q))


def f_sf(x: float, dfn: float, dfd: float) -> float:
    """Return the probability of a value of Fisher's F above x >= 0."""
    return float(special.fdtrc(dfn, dfd, x))


# --- Weights of observations whose errors are correlated, component by component


NOTHING = 1e-8
"""Weight of a pair, as a share of the weights of both, that is left out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SlowErrors:
    """The correlated part of the errors of m observations of d components.

    Attributes
    ----------
    sigma : ndarray, shape (m, d)
        Its standard deviation.
    together : ndarray, shape (m, m)
        Its correlation, the same for all components.
    """

    sigma: Array
    together: Array

    def correlation(self, sigma: Array) -> Correlation:
        """Return the correlation of errors that consist of this part and white noise.

        Parameters
        ----------
        sigma : ndarray, shape (m, d)
            Standard deviation of the whole error. Where it is larger than at first, white noise
            was added; where it is infinite, an observation takes no part.

        Raises
        ------
        AdjustmentError
            Where two errors are the same.
        """
        share = np.minimum(self.sigma / sigma, 1.0)
        with processors.on_one_thread():
            return _inverted(share, self.together)


def _inverted(share: Array, together: Array) -> Correlation:
    """Return the weights for correlations of share_i share_j times those of the slow part."""
    inverse: list[Array] = []
    for c, column in enumerate(share.T):
        equal = [inverse[b] for b in range(c) if np.array_equal(column, share[:, b])]
        inverse.append(equal[0] if equal else _inverse(column, together))
    counts = np.zeros(together.shape, dtype=bool)
    for P in inverse:
        each = np.sqrt(P.diagonal())
        counts |= np.abs(P) > NOTHING * each[:, None] * each
    first, second = np.nonzero(counts)
    weight = np.stack([P[first, second] for P in inverse], axis=1)
    return Correlation(first=first, second=second, weight=weight)


def _inverse(share: Array, together: Array) -> Array:
    R = share[:, None] * together * share
    R[np.diag_indices_from(R)] = 1.0
    try:
        L_inv = np.linalg.inv(np.linalg.cholesky(R))
    except np.linalg.LinAlgError:
        msg = (
            "correlated errors of two observations are the same: a share of the white noise is "
            "needed (a correlated share below 1), or exposures at different times"
        )
        raise AdjustmentError(msg) from None
    return L_inv.T @ L_inv


@dataclass(frozen=True, kw_only=True, eq=False)
class Correlation:
    """The inverse correlation matrix of every component of m observations, as pairs.

    Errors far apart in a Gauss-Markov process are conditionally independent given the errors
    between them, so most of the inverse is zero.

    Attributes
    ----------
    first, second : ndarray, shape (p,)
        Observations of each pair, both orders and each with itself, sorted.
    weight : ndarray, shape (p, d)
        Entries of the inverse. Divided by the two sigma they are weights.
    """

    first: Index
    second: Index
    weight: Array

    @cached_property
    def _starts(self) -> Index:
        return np.flatnonzero(np.diff(self.first, prepend=-1))

    @property
    def own(self) -> Array:
        """Diagonals of the inverse, shape (m, d): one where errors are independent."""
        return self.weight[self.first == self.second]

    def times(self, z: Array) -> Array:
        """Return the inverse times z, component by component, shape (m, d, ...) as z."""
        weight = self.weight.reshape(*self.weight.shape, *(1,) * (z.ndim - 2))
        return np.add.reduceat(weight * z[self.second], self._starts, axis=0)

    @cached_property
    def factors(self) -> tuple[Array, ...]:
        """An upper triangle U, (m, m), of every component: the inverse is U^T U."""
        dense = (self._matrix(weights).toarray() for weights in self.weight.T)
        return tuple(np.linalg.cholesky(P).T for P in dense)

    def whitened(self, z: Array) -> Array:
        """Return z whitened to unit weights, shape (m, d, ...) as z.

        Parameters
        ----------
        z : ndarray
            Residuals or derivatives, divided by sigma.
        """
        each = [np.tensordot(U, z[:, c], axes=1) for c, U in enumerate(self.factors)]
        return np.stack(each, axis=1)

    def tested(self, z: Array, explained: Array) -> tuple[Array, Together]:
        """Return redundancy numbers, shape (m, d), and the other terms of tests.

        Parameters
        ----------
        z : ndarray, shape (m, d)
            Residuals divided by sigma.
        explained : ndarray, shape (p, d)
            Covariances of the adjusted observations of every pair, divided by both sigma.

        Notes
        -----
        With the weights P and the residuals' covariance Q_vv = P^-1 - A Q A^T, the redundancy
        number is (Q_vv P)_ii, and the test of a single error of an observation is
        w = (P v)_i / sqrt((P Q_vv P)_ii) [1]_. Between observations of no common weight A Q A^T
        has no effect on either.

        References
        ----------
        .. [1] K.-R. Koch, "Parameter Estimation and Hypothesis Testing in Linear Models", 2nd
           edition, 1999, chapter 4.2.
        """
        shared = np.add.reduceat(self.weight * explained, self._starts, axis=0)
        control = np.empty_like(z)
        for c in range(z.shape[1]):
            P, S = self._matrix(self.weight[:, c]), self._matrix(explained[:, c])
            control[:, c] = P.diagonal() - np.asarray((P @ S).multiply(P).sum(axis=1)).ravel()
        return 1 - shared, Together(weighted=self.times(z), control=control, own=self.own)

    def _matrix(self, values: Array) -> sparse.csr_array:
        m = int(self.first[-1]) + 1
        return sparse.csr_array((values, (self.first, self.second)), shape=(m, m))
