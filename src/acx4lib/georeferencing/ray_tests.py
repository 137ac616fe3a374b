"""How well the rays of a point fit each other, within the errors of pixels and trajectory."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy import sparse

from acx4lib.bundle.observations.shared_errors import SharedErrors
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.georeferencing import direct
from acx4lib.georeferencing.direct import Georeferenced, Intersections, Rays
from acx4lib.georeferencing.error_sources import block_matrix
from acx4lib.least_squares import processors
from acx4lib.least_squares.covariance import half

CONTROLLED = 1e-6
"""A residual with a smaller share of its variance is not tested: nothing else checks it."""


def of(
    block: Block, georeferenced: Georeferenced, selected: Rays, *, refraction: str = "none"
) -> Array:
    """Test rays against the others of their group, with weights that include the trajectory's.

    Exposures are independent, unless the trajectory's errors change slowly: then all rays of a
    group have their joint covariance. What groups share plays no part.

    Parameters
    ----------
    block : Block
    georeferenced : Georeferenced
    selected : Rays
    refraction : str
        ``"none"`` or ``"standard"``.

    Returns
    -------
    w : ndarray, shape (n,)
        The larger of the two normalised residuals of every ray; zero where nothing controls it.

    Notes
    -----
    Baarda's test for correlated observations: w = (P v)_i / sqrt((P Q_vv P)_ii).
    """
    first = direct.intersect_rays(block, georeferenced, selected, refraction=refraction)
    if georeferenced.shared is not None:
        exposure = block.images.exposure_idx[selected.image_idx]
        return _together(first, selected, exposure, georeferenced.cov_body, georeferenced.shared)
    P = np.linalg.inv(first.cov_v)
    fit = direct.intersect_rays(block, georeferenced, selected, weights=P, refraction=refraction)
    return _one_by_one(P, fit, selected)


def _one_by_one(P: Array, fit: Intersections, selected: Rays) -> Array:
    """Test rays whose misclosures are independent."""
    B = fit.by_point
    normal = np.zeros((selected.n_groups, 3, 3))
    np.add.at(normal, selected.group, np.swapaxes(B, 1, 2) @ P @ B)
    cov_v = fit.cov_v - B @ np.linalg.inv(normal)[selected.group] @ np.swapaxes(B, 1, 2)
    Pv = np.einsum("nij,nj->ni", P, fit.v)
    w = _normalised(Pv, np.diagonal(P @ cov_v @ P, axis1=1, axis2=2), _diagonal(P))
    worst: Array = w.max(axis=1)
    return worst


def _together(
    first: Intersections, selected: Rays, exposure: Index, cov_body: Array, shared: SharedErrors
) -> Array:
    """Test the rays of every group with their joint covariance; points move linearly."""
    w = np.zeros(len(selected.group))
    starts = np.searchsorted(selected.group, np.arange(selected.n_groups + 1))
    for start, end in pairwise(starts):
        rows = slice(start, end)
        B, e = first.by_point[rows].reshape(-1, 3), exposure[rows]
        C = direct.by_trajectory(first.by_body[rows], e, cov_body, shared)
        P = np.linalg.inv(C + np.diag(np.repeat(selected.sigma_px[rows] ** 2, 2)))
        PB, v = P @ B, first.v[rows].ravel()
        inverse = np.linalg.inv(B.T @ PB)
        Pv = P @ (v - B @ (inverse @ (PB.T @ v)))
        variance = np.diag(P) - np.einsum("ij,jk,ik->i", PB, inverse, PB)
        w[rows] = _normalised(Pv, variance, np.diag(P)).reshape(-1, 2).max(axis=1)
    return w


def _normalised(Pv: Array, variance: Array, weight: Array) -> Array:
    """Return |P v| by its own standard deviation, zero where a residual is not controlled."""
    controlled = variance > CONTROLLED * weight
    return np.nan_to_num(np.abs(Pv) / np.sqrt(np.where(controlled, variance, np.inf)))


def _diagonal(P: Array) -> Array:
    return np.diagonal(P, axis1=1, axis2=2)


def cost(
    block: Block, georeferenced: Georeferenced, selected: Rays, *, refraction: str = "none"
) -> float:
    """Return the weighted sum of squares of all residuals, with all that rays have in common.

    Parameters
    ----------
    block, georeferenced, selected, refraction
        As `of` takes them.

    Returns
    -------
    float
        Where all sigma are right, it has the chi-square distribution, with a degree of freedom for
        every image coordinate less three for every point.

    Notes
    -----
    Rays of one exposure share the errors of its pose, whatever they show, and all share those of
    the calibration. With these errors, of covariance S, the residuals v of pixels alone, their
    derivatives A by them, and what is left of these beside the points, N = A^T P Q_vv P A, the
    least sum is v^T P v - b^T S (I + N S)^-1 b, with b = A^T P v.
    """
    fit = direct.intersect_rays(block, georeferenced, selected, refraction=refraction)
    n, sigma = len(selected.group), selected.sigma_px[:, None]
    if n == 0:
        return 0.0
    rows, v = np.arange(n), (fit.v / sigma).ravel()
    used, place = np.unique(block.images.exposure_idx[selected.image_idx], return_inverse=True)
    by_body = block_matrix(fit.by_body / sigma[:, None], rows, place, (n, len(used)))
    by_parameters = (fit.by_parameters / sigma[:, None]).reshape(2 * n, -1)
    A = sparse.hstack([by_body, sparse.csr_array(by_parameters)], format="csr")
    N, b = _beside_points(A, fit.by_point / sigma[:, None], selected), A.T @ v
    return float(v @ v - _explained(N, b, georeferenced, used))


def _beside_points(A: sparse.csr_array, by_point: Array, selected: Rays) -> sparse.csr_array:
    """Return A^T A less what the points take up of it."""
    groups = np.arange(selected.n_groups)
    normal = np.zeros((selected.n_groups, 3, 3))
    np.add.at(normal, selected.group, np.swapaxes(by_point, 1, 2) @ by_point)
    shape = (len(selected.group), selected.n_groups)
    by_points = block_matrix(by_point, np.arange(shape[0]), selected.group, shape)
    inverse = block_matrix(np.linalg.inv(normal), groups, groups, (shape[1], shape[1]))
    moved = A.T @ by_points
    return (A.T @ A - moved @ inverse @ moved.T).tocsr()


def _explained(N: sparse.csr_array, b: Array, georeferenced: Georeferenced, used: Index) -> float:
    """Return b^T S (I + N S)^-1 b, S of the poses of some exposures and of the calibration."""
    from scipy.sparse.linalg import splu  # noqa: PLC0415 loads long, and planning solves nothing

    g, n = georeferenced, len(used)
    if g.shared is not None:
        first, second = (i.ravel() for i in np.indices((n, n)))
        poses = g.shared.between(used[first], used[second])
        poses[first == second] = g.cov_body[used]
        among = block_matrix(poses, first, second, (n, n))
        S = sparse.block_diag([among, g.cov_parameters], format="csr")
        inner = np.eye(len(b)) + (N @ S).toarray()
        return float(np.asarray(S @ b) @ np.linalg.solve(inner, b))
    each = np.arange(n)
    own = block_matrix(half(g.cov_body[used]), each, each, (n, n))
    H = sparse.block_diag([own, half(g.cov_parameters)], format="csr")
    joint = (sparse.eye_array(len(b)) + H.T @ N @ H).tocsc()
    right = np.asarray(H.T @ b)
    with processors.on_one_thread():
        try:
            whole = splu(joint, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0)
        except RuntimeError as error:  # SuperLU has no error of its own
            raise np.linalg.LinAlgError(str(error)) from error
        return float(right @ whole.solve(right))
