"""Statistics: covariance matrices, standard deviations and correlations; medians of groups."""

from __future__ import annotations

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

    Raises
    ------
    ValueError
        Where the shapes of the matrices do not match.
    """
    expected.square("cov", cov)
    expected.shape("J", J, (..., "k", cov.shape[-1]))
    return J @ cov @ np.swapaxes(J, -1, -2)


def sigmas(cov: Array) -> Array:
    """Return the standard deviations of covariance matrices, shape (..., n)."""
    expected.square("cov", cov)
    # rounding may make a variance of zero slightly negative
    return np.sqrt(np.maximum(np.diagonal(cov, axis1=-2, axis2=-1), 0.0))


def correlation(cov: Array) -> Array:
    """Return the correlation matrix of a covariance matrix; zero beside a variance of zero."""
    expected.square("cov", cov)
    expected.symmetric("cov", cov)
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
    expected.square("cov", cov)
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
