"""What every strip of a block tells of the unknowns that all strips have in common.

Strips share the unknowns of cameras and of GNSS, and the points on the ground. Poses and drifts
belong to one strip. So the normal equations of each strip are reduced to what is shared, once, and
those of any choice of strips are a sum. This is exact for the points that take part; so that it is
quick, a part of the tie points takes part, with the weight of all. Where errors of the trajectory
change slowly, their correlation is kept along each strip, and neglected from one to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse

from acx4lib.bundle.network import Network
from acx4lib.expected import Array, Index
from acx4lib.flight.design import strip_of_exposure
from acx4lib.least_squares.statistical.correlated import Correlation

TIE_POINTS = 120
"""Tie points that take part, of a block that has more."""

FAR_M = 1000.0
"""Standard deviation of a point's coordinates before it is measured."""

UNSEEN = 1e-12
"""Share of the information on a common unknown that is there without any strip. So the covariance
exists where a choice leaves the unknown open, and is very large."""

GOLDEN = 0.6180339887498949


@dataclass(frozen=True, kw_only=True, eq=False)
class StripInformation:
    """Normal matrices of points and common unknowns, in this order; poses are eliminated.

    Attributes
    ----------
    names : tuple of str
        The common unknowns, as `Network.column_names` has them.
    strips : tuple of str
    given : ndarray, shape (n, n)
        What belongs to no strip: control points, declared mountings.
    by_strip : ndarray, shape (n_strips, n, n)
    """

    names: tuple[str, ...]
    strips: tuple[str, ...]
    given: Array
    by_strip: Array

    def covariance(self, chosen: Sequence[int]) -> Array:
        """Return the covariance of the common unknowns from some of the strips, shape (k, k)."""
        N, k = self.given + self.by_strip[list(chosen)].sum(axis=0), len(self.names)
        L = linalg.cholesky(N, lower=True, overwrite_a=True, check_finite=False)[-k:, -k:]
        H = linalg.solve_triangular(L, np.eye(k), lower=True, check_finite=False)
        cov: Array = H.T @ H
        return cov


def of_strips(network: Network, *, tie_points: int = TIE_POINTS) -> StripInformation:
    """Return what every strip of a network tells, linearised at its approximate values.

    Parameters
    ----------
    network : Network
        As `uses.mounted_orientation` makes it.
    tie_points : int
        Largest number of tie points that take part.

    Raises
    ------
    ValueError
        Where an exposure belongs to no strip.
    """
    strips = tuple(dict.fromkeys(strip_of_exposure(network.block)))
    if "" in strips:
        msg = "every image must have a strip"
        raise ValueError(msg)
    owner = _owners(network, strips)
    common = np.flatnonzero(owner[:-1] < 0)
    points, weight = _taking_part(network, tie_points)
    rows, strip_of_row = _whitened(network, points, weight, owner)
    shared = np.append(np.arange(3 * len(points)), 3 * len(points) + common)
    own = [3 * len(points) + np.flatnonzero(owner[:-1] == k) for k in range(len(strips))]
    by_strip = [_reduced(rows[strip_of_row == k], shared, own[k]) for k in range(len(strips))]
    given = (rows[strip_of_row < 0].T @ rows[strip_of_row < 0]).toarray()[np.ix_(shared, shared)]
    total = np.diagonal(given + sum(by_strip))[3 * len(points) :]
    given[np.diag_indices(len(given))] += np.append(
        np.full(3 * len(points), FAR_M**-2), UNSEEN * total
    )
    names = network.column_names()
    return StripInformation(
        names=tuple(names[column] for column in common),
        strips=strips,
        given=given,
        by_strip=np.array(by_strip),
    )


def _owners(network: Network, strips: Sequence[str]) -> Index:
    """Return the strip to which each column belongs, -1 for what strips share."""
    owner = np.full(network.n_columns + 1, -1)  # column -1 is held
    of_pose = np.array([strips.index(name) for name in strip_of_exposure(network.block)])
    of_drift = [strips.index(name) for name in network.observed.strips.names]
    for columns, of in ((network.layout.pose, of_pose), (network.layout.drift, of_drift)):
        for column, strip in zip(columns, of, strict=True):
            owner[column[column >= 0]] = strip
    return owner


def _taking_part(network: Network, most: int) -> tuple[Index, Array]:
    """Return points that take part, spread over all, and the weight of the rays to each."""
    is_control = np.zeros(network.n_points, dtype=bool)
    is_control[network.control.point_idx] = True
    free = network.free_points
    ties = np.flatnonzero(free & ~is_control)
    order = np.argsort(np.arange(len(ties)) * GOLDEN % 1.0, kind="stable")
    chosen = np.sort(ties[order[:most]])
    points = np.concatenate([np.flatnonzero(is_control), chosen])
    weight = np.zeros(network.n_points)
    weight[points] = 1.0
    weight[chosen] = len(ties) / max(len(chosen), 1)
    return points, weight


def _whitened(
    network: Network, points: Index, weight: Array, owner: Index
) -> tuple[sparse.csr_array, Index]:
    """Return all equations, each of unit variance, and the strip to which each belongs.

    Columns are the coordinates of the points that take part, then the columns of the network.
    """
    first = np.full((network.n_points, 3), -1)
    first[points] = np.arange(3 * len(points)).reshape(-1, 3)
    first[~network.free_points] = -1
    parts, strips = [], []
    for e in network.equations(network.start):
        point = np.full(len(e.v), -1) if e.point is None else e.point
        rows = np.flatnonzero((point < 0) | (weight[point] > 0))
        A, columns = e.A[rows], e.columns[e.unit[rows]]
        strip = owner[columns].max(axis=1, initial=-1)
        strips.append(np.repeat(strip, e.v.shape[1]))
        columns = np.where(columns < 0, -1, 3 * len(points) + columns)
        if e.B is not None:
            A = np.concatenate([A, e.B[rows]], axis=2)
            columns = np.concatenate([columns, first[point[rows]]], axis=1)
        by_rays = np.sqrt(weight[point[rows]]) if e.kind == "image_point" else np.ones(len(rows))
        A = A * by_rays[:, None, None] / e.sigma[rows][:, :, None]
        part = _sparse(A, columns, 3 * len(points) + network.n_columns)
        parts.append(part if e.correlation is None else _uncorrelated(e.correlation, strip) @ part)
    return sparse.vstack(parts, format="csr"), np.concatenate(strips)


def _sparse(A: Array, columns: Index, n: int) -> sparse.csr_array:
    """Return rows with their columns in a sparse matrix, those of held unknowns left out."""
    m, d, _ = A.shape
    row = np.broadcast_to(np.arange(m * d).reshape(m, d, 1), A.shape)
    column = np.broadcast_to(columns[:, None, :], A.shape)
    there = column >= 0
    return sparse.csr_array((A[there], (row[there], column[there])), shape=(m * d, n))


def _uncorrelated(correlation: Correlation, strip: Index) -> sparse.csr_array:
    """Return what makes rows independent that are correlated along their strips."""
    factors = correlation.factors
    d, m = len(factors), len(factors[0])
    row, column = np.nonzero(np.triu(np.equal.outer(strip, strip)))
    parts = [(U[row, column], (d * row + c, d * column + c)) for c, U in enumerate(factors)]
    values, places = zip(*parts, strict=True)
    where = tuple(np.concatenate(one) for one in zip(*places, strict=True))
    return sparse.csr_array((np.concatenate(values), where), shape=(m * d, m * d))


def _reduced(rows: sparse.csr_array, shared: Index, own: Index) -> Array:
    """Return the normal matrix of what is shared, what belongs to the strip alone eliminated."""
    N = rows.T @ rows
    N_so = N[shared][:, own].toarray()
    L = linalg.cholesky(N[own][:, own].toarray(), lower=True)
    half = linalg.solve_triangular(L, N_so.T, lower=True)
    reduced: Array = N[shared][:, shared].toarray() - half.T @ half
    return reduced
