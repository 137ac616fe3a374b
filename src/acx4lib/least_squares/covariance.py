"""Covariances: matrices, standard deviations, correlations; medians; errors that change slowly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Index


def propagate(J: Array, cov: Array) -> Array:
    """Return the propagated covariance J cov J^T, over leading axes.

    Parameters
    ----------
    J : ndarray, shape (..., k, n)
    cov : ndarray, shape (..., n, n)

    Returns
    -------
    ndarray, shape (..., k, k)
    """
    return J @ cov @ np.swapaxes(J, -1, -2)


def sigmas(cov: Array) -> Array:
    """Return the standard deviations of covariance matrices, shape (..., n)."""
    # rounding may make a variance of zero slightly negative
    return np.sqrt(np.maximum(np.diagonal(cov, axis1=-2, axis2=-1), 0.0))


def correlation(cov: Array) -> Array:
    """Return the correlation matrix of a covariance matrix; zero beside a variance of zero."""
    sigma = np.maximum(sigmas(cov), 1e-150)
    return cov / sigma[:, None] / sigma


def half(cov: Array) -> Array:
    """Return H with H H^T = cov, over leading axes; variances may be zero.

    Parameters
    ----------
    cov : ndarray, shape (..., n, n)

    Returns
    -------
    ndarray, shape (..., n, n)
    """
    sigma = np.maximum(sigmas(cov), 1e-150)[..., :, None]
    values, vectors = np.linalg.eigh(cov / sigma / np.swapaxes(sigma, -1, -2))
    return sigma * vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]


def medians(values: Array, group: Index, n_groups: int) -> Array:
    """Return the (lower) median of each group; zero for an empty one, NaN counts as infinite."""
    order = np.lexsort((values, group))
    count = np.bincount(group, minlength=n_groups)
    middle = np.cumsum(count) - count + (count - 1) // 2
    out = np.zeros(n_groups)
    out[count > 0] = np.nan_to_num(values[order[middle[count > 0]]], nan=np.inf)
    return out


# --- errors that change slowly beside white noise ---------------------------------------------


@dataclass(frozen=True, kw_only=True)
class GaussMarkov:
    """Correlation in time of errors with standard deviation sigma.

    Their covariance at the times t_i and t_j is
    ``sigma_i sigma_j (share**2 exp(-|t_i - t_j| / time_constant_s) + (1 - share**2) delta_ij)``:
    the variance sigma**2 is the sum of a slow part, share**2 of it, and white noise.

    Attributes
    ----------
    share : float
        Standard deviation of the slow part as a share of sigma, 0 to 1; 0, the default, is white
        noise alone. With 0.8, the white noise has 0.6 of sigma.
    time_constant_s : float
        Time after which the slow part's correlation is 1/e.
    """

    share: float = 0.0
    time_constant_s: float = 1.0

    def __post_init__(self) -> None:
        expected.positive("time_constant_s", self.time_constant_s)
        if not 0 <= self.share <= 1:
            raise ValueError(f"share: expected a number from 0 to 1, got {self.share}")

    def together(self, time_s: Array) -> Array:
        """Return the correlation of the slow part at n times, shape (n, n)."""
        lag: Array = np.abs(np.subtract.outer(time_s, time_s)) / self.time_constant_s
        return np.exp(-lag)


WHITE = GaussMarkov()
"""Independent errors."""
