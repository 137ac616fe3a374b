"""Weights of observations whose errors are correlated, component by component."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from acx4lib import expected
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.least_squares import processors
from acx4lib.least_squares.statistical.residuals import Together

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

    def __post_init__(self) -> None:
        m = len(self.sigma)
        expected.not_negative("sigma", self.sigma)
        expected.shape("together", self.together, (m, m))

    def correlation(self, sigma: Array) -> Correlation:
        """Return the correlation of errors of which this is a part, and the rest is white.

        Parameters
        ----------
        sigma : ndarray, shape (m, d)
            Standard deviation of the whole error. Where it is larger than at first, white noise
            was added; where it is infinite, an observation takes no part and tells nothing.

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
    for c, own in enumerate(share.T):
        same = [inverse[b] for b in range(c) if np.array_equal(own, share[:, b])]
        inverse.append(same[0] if same else _inverse(own, together))
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
    P: Array = L_inv.T @ L_inv
    return P


@dataclass(frozen=True, kw_only=True, eq=False)
class Correlation:
    """The inverse correlation matrix of every component of m observations, as pairs.

    Errors far apart in a Gauss-Markov process tell nothing of each other once those between are
    known, so most of the inverse is zero.

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
        product: Array = np.add.reduceat(weight * z[self.second], self._starts, axis=0)
        return product

    @cached_property
    def factors(self) -> tuple[Array, ...]:
        """An upper triangle U, (m, m), of every component: the inverse is U^T U."""
        dense = (self._matrix(own).toarray() for own in self.weight.T)
        return tuple(np.linalg.cholesky(P).T for P in dense)

    def whitened(self, z: Array) -> Array:
        """Return what has the unit matrix for weights, shape (m, d, ...) as z.

        Parameters
        ----------
        z : ndarray
            Residuals or derivatives, divided by sigma.
        """
        each = [np.tensordot(U, z[:, c], axes=1) for c, U in enumerate(self.factors)]
        whitened: Array = np.stack(each, axis=1)
        return whitened

    def tested(self, z: Array, explained: Array) -> tuple[Array, Together]:
        """Return redundancy numbers, shape (m, d), and what tests need besides.

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
