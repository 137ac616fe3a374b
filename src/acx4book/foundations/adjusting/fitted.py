"""Least squares of a small linear system, and what they tell: chapters 5 and 6 write it out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A linear system A dx = dl, adjusted.

    Attributes
    ----------
    dx : ndarray, shape (n,)
        Unknowns.
    cov : ndarray, shape (n, n)
        Their covariance, from the standard deviations a priori.
    v : ndarray, shape (m,)
        Residuals A dx - dl.
    sigma : ndarray, shape (m,)
        Of the observations.
    redundancy : ndarray, shape (m,)
        Share of an error of each observation that shows in its own residual.
    """

    dx: Array
    cov: Array
    v: Array
    sigma: Array
    redundancy: Array

    @property
    def degrees(self) -> int:
        """Degrees of freedom."""
        return len(self.v) - len(self.dx)

    @property
    def square(self) -> float:
        """Weighted sum of squared residuals."""
        return float(np.sum((self.v / self.sigma) ** 2))

    @property
    def w(self) -> Array:
        """Residuals over their own standard deviations, shape (m,)."""
        return self.v / (self.sigma * np.sqrt(self.redundancy))


def fit(A: Array, dl: Array, sigma: Array | float) -> Fit:
    """Adjust a linear system of uncorrelated observations.

    Parameters
    ----------
    A : ndarray, shape (m, n)
        Of full rank.
    dl : ndarray, shape (m,)
        Observed minus computed.
    sigma : float or ndarray, shape (m,)
        Standard deviations, in the units of `dl`.
    """
    sigma = np.broadcast_to(np.asarray(sigma, dtype=float), dl.shape)
    weighted = A / sigma[:, None]
    cov = np.linalg.inv(weighted.T @ weighted)
    dx = cov @ weighted.T @ (dl / sigma)
    explained = np.einsum("mi,ij,mj->m", weighted, cov, weighted)
    return Fit(dx=dx, cov=cov, v=A @ dx - dl, sigma=sigma, redundancy=1 - explained)
