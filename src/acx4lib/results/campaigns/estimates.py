"""Vectors with known covariances: tests of one, and a line through several, by least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.least_squares.covariance import sigmas
from acx4lib.least_squares.statistical import distributions

KNOWN = np.inf
"""Degrees of freedom of a variance factor that is known, not estimated."""


@dataclass(frozen=True, kw_only=True)
class JointTest:
    """A test whether a vector is zero, by its covariance.

    Attributes
    ----------
    chi_square : float
        d^T C^-1 d.
    dof : int
        Number of independent components of d.
    redundancy : float
        Of the adjustments that estimated the variance factor of C, the smallest; infinite where
        it is known.
    """

    chi_square: float
    dof: int
    redundancy: float = KNOWN

    @property
    def p(self) -> float:
        """Probability of such a chi-square, or a larger one, if the vector is zero.

        Where the variance factor was estimated, that of Fisher's F = chi_square / dof. NaN for an
        empty vector.
        """
        if self.dof == 0:
            return np.nan
        if np.isinf(self.redundancy):
            return distributions.chi2_sf(self.chi_square, self.dof)
        return distributions.f_sf(self.chi_square / self.dof, self.dof, self.redundancy)


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """Vectors fitted by X B, all together.

    Attributes
    ----------
    coefficients : ndarray, shape (m, k)
        B: one row for each column of X.
    cov : ndarray, shape (m, k, m, k)
    residuals : ndarray, shape (n, k)
        Fitted minus given.
    chi_square : float
        Weighted sum of squared residuals, with their joint covariances.
    dof : int
        (n - m) k.
    """

    coefficients: Array
    cov: Array
    residuals: Array
    chi_square: float
    dof: int


def joint_test(d: Array, cov: Array, *, redundancy: float = KNOWN) -> JointTest:
    """Test whether a vector is zero.

    Parameters
    ----------
    d : ndarray, shape (k,)
    cov : ndarray, shape (k, k)
        Positive definite.
    redundancy : float
        As in `JointTest`.
    """
    expected.shape("d", d, ("k",))
    expected.shape("cov", cov, (len(d), len(d)))
    sigma = sigmas(cov)  # units differ by many powers of ten
    z, related = d / sigma, cov / sigma[:, None] / sigma
    chi_square = float(z @ np.linalg.solve(related, z)) if len(d) else 0.0
    return JointTest(chi_square=chi_square, dof=len(d), redundancy=redundancy)


def fit(values: Array, covs: Array, X: Array) -> Fit:
    """Fit independent vectors by X B, by least squares with their covariances.

    Parameters
    ----------
    values : ndarray, shape (n, k)
    covs : ndarray, shape (n, k, k)
        Positive definite.
    X : ndarray, shape (n, m)
        Known factors, of full column rank; a column of ones gives the mean.

    Notes
    -----
    With W_i = C_i^-1, the normal equations are sum_i (x_i x_i^T) (x) W_i and sum_i x_i (x) W_i v_i.
    """
    expected.shape("values", values, ("n", "k"))
    n, k = values.shape
    expected.shape("covs", covs, (n, k, k))
    expected.shape("X", X, (n, "m"))
    scale = np.sqrt(np.mean(np.diagonal(covs, axis1=1, axis2=2), axis=0))
    z = values / scale
    W = np.linalg.inv(covs / scale[:, None] / scale)
    m = X.shape[1]
    N = np.einsum("ia,ijl,ib->ajbl", X, W, X).reshape(m * k, m * k)
    cov = np.linalg.inv(N)
    B = (cov @ np.einsum("ia,ijl,il->aj", X, W, z).ravel()).reshape(m, k)
    v = X @ B - z
    return Fit(
        coefficients=B * scale,
        cov=cov.reshape(m, k, m, k) * scale[:, None, None] * scale,
        residuals=v * scale,
        chi_square=float(np.einsum("ij,ijl,il->", v, W, v)),
        dof=(n - m) * k,
    )


def same_values(values: Array, covs: Array, *, redundancy: float = KNOWN) -> Sequence[JointTest]:
    """Test every component by itself for being the same in all vectors.

    Parameters
    ----------
    values : ndarray, shape (n, k)
    covs : ndarray, shape (n, k, k)
    redundancy : float
        As in `JointTest`.

    Returns
    -------
    sequence of JointTest
        k tests of n - 1 degrees of freedom, about the component's own weighted mean.
    """
    variance = np.diagonal(covs, axis1=1, axis2=2)
    weight = 1 / variance
    mean = np.sum(weight * values, axis=0) / weight.sum(axis=0)
    chi_square = np.sum((values - mean) ** 2 * weight, axis=0)
    return [
        JointTest(chi_square=float(c), dof=len(values) - 1, redundancy=redundancy)
        for c in chi_square
    ]
