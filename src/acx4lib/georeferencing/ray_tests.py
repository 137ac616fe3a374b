"""How well the rays of a point fit each other, within the errors of pixels and trajectory."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from acx4lib.bundle.observations.shared_errors import SharedErrors
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.georeferencing import direct
from acx4lib.georeferencing.direct import Georeferenced, Intersections, Rays

CONTROLLED = 1e-6
"""A residual with a smaller share of its variance is not tested: nothing else checks it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RayTests:
    """Tests of rays that were intersected.

    Attributes
    ----------
    w : ndarray, shape (n,)
        The larger of the two normalised residuals of every ray; zero where nothing controls it.
    cost : float
        Weighted sum of squares of all residuals.
    """

    w: Array
    cost: float


def of(
    block: Block, georeferenced: Georeferenced, selected: Rays, *, refraction: str = "none"
) -> RayTests:
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


def _one_by_one(P: Array, fit: Intersections, selected: Rays) -> RayTests:
    """Test rays whose misclosures are independent."""
    B = fit.by_point
    normal = np.zeros((selected.n_groups, 3, 3))
    np.add.at(normal, selected.group, np.swapaxes(B, 1, 2) @ P @ B)
    cov_v = fit.cov_v - B @ np.linalg.inv(normal)[selected.group] @ np.swapaxes(B, 1, 2)
    Pv = np.einsum("nij,nj->ni", P, fit.v)
    w = _normalised(Pv, np.diagonal(P @ cov_v @ P, axis1=1, axis2=2), _diagonal(P))
    return RayTests(w=w.max(axis=1), cost=float(np.einsum("ni,nij,nj->", fit.v, P, fit.v)))


def _together(
    first: Intersections, selected: Rays, exposure: Index, cov_body: Array, shared: SharedErrors
) -> RayTests:
    """Test the rays of every group with their joint covariance; points move linearly."""
    w, cost = np.zeros(len(selected.group)), 0.0
    starts = np.searchsorted(selected.group, np.arange(selected.n_groups + 1))
    for start, end in pairwise(starts):
        rows = slice(start, end)
        B, e = first.by_point[rows].reshape(-1, 3), exposure[rows]
        one, other = (i.ravel() for i in np.indices((len(e), len(e))))
        same = (e[one] == e[other])[:, None, None]
        body = np.where(same, cov_body[e[one]], shared.between(e[one], e[other]))
        J = first.by_body[rows]
        blocks = (J[one] @ body @ np.swapaxes(J[other], 1, 2)).reshape(len(e), len(e), 2, 2)
        C = np.swapaxes(blocks, 1, 2).reshape(len(B), len(B))
        P = np.linalg.inv(C + np.diag(np.repeat(selected.sigma_px[rows] ** 2, 2)))
        PB, v = P @ B, first.v[rows].ravel()
        inverse = np.linalg.inv(B.T @ PB)
        Pv = P @ (v - B @ (inverse @ (PB.T @ v)))
        variance = np.diag(P) - np.einsum("ij,jk,ik->i", PB, inverse, PB)
        w[rows] = _normalised(Pv, variance, np.diag(P)).reshape(-1, 2).max(axis=1)
        cost += float(v @ Pv)
    return RayTests(w=w, cost=cost)


def _normalised(Pv: Array, variance: Array, weight: Array) -> Array:
    """Return |P v| by its own standard deviation, zero where a residual is not controlled."""
    controlled = variance > CONTROLLED * weight
    return np.nan_to_num(np.abs(Pv) / np.sqrt(np.where(controlled, variance, np.inf)))


def _diagonal(P: Array) -> Array:
    return np.diagonal(P, axis1=1, axis2=2)
