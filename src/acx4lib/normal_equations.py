"""Normal equations, assembled unit by unit and point by point; no camera, no iteration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from acx4lib._typing import Array, Index, Mask

CHUNK = 256
"""Points eliminated at a time; bounds the memory of the dense strips."""

SINGULAR = 1e-11
"""Eigenvalue of the scaled normal matrix below which a direction is not determined."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """One group of linearised observations, v = estimated - observed.

    Attributes
    ----------
    kind : str
        For reports.
    v, sigma : ndarray, shape (m, d)
        An infinite sigma takes a component out.
    A : ndarray, shape (m, d, k)
        dv / d(unknowns of the observation's unit); k may be zero.
    columns : ndarray, shape (n_units, k)
        Where these unknowns stand in the reduced system; -1 for one that is held.
    unit : ndarray, shape (m,)
        Observations of one unit share their columns.
    B : ndarray, shape (m, d, 3), optional
        dv / d(point).
    point : ndarray, shape (m,), optional
    """

    kind: str
    v: Array
    sigma: Array
    A: Array
    columns: Index
    unit: Index
    B: Array | None = None
    point: Index | None = None


def column_normals(n: int, equations: Sequence[Equations]) -> tuple[Array, Array]:
    """Return A^T P A and A^T P v over all groups, unit by unit."""
    N, g = np.zeros((n, n)), np.zeros(n)
    for e in equations:
        for rows, columns, held in units(e):
            P = 1 / e.sigma[rows] ** 2
            A = e.A[rows].reshape(-1, e.A.shape[2])[:, ~held]
            PA = P.reshape(-1, 1) * A
            N[np.ix_(columns, columns)] += A.T @ PA
            g[columns] += PA.T @ e.v[rows].ravel()
    return N, g


def units(e: Equations) -> Iterator[tuple[Index, Index, Mask]]:
    """Yield the rows of every unit, its columns in the reduced system, and which are held."""
    if e.A.shape[2] == 0:
        return
    order = np.argsort(e.unit, kind="stable")
    ends = np.cumsum(np.bincount(e.unit, minlength=len(e.columns)))
    for unit, columns in enumerate(e.columns):
        rows = order[ends[unit - 1] if unit else 0 : ends[unit]]
        held = columns < 0
        if len(rows) and not held.all():
            yield rows, columns[~held], held


def point_normals(free_points: Mask, equations: Sequence[Equations]) -> tuple[Array, Array]:
    """Return B^T P B and B^T P v of every point; the identity where a point is held."""
    n_points = len(free_points)
    V, h = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
    for e in equations:
        if e.B is not None and e.point is not None:
            PB = e.B / e.sigma[:, :, None] ** 2
            _add_by_point(V, e.point, np.swapaxes(e.B, 1, 2) @ PB)
            _add_by_point(h, e.point, np.einsum("mdi,md->mi", PB, e.v))
    V[~free_points] = np.eye(3)
    h[~free_points] = 0.0
    return V, h


def _add_by_point(total: Array, point: Index, values: Array) -> None:
    """Add values to their points; fast where the points come in order."""
    if len(point) == 0:
        return
    if np.any(np.diff(point) < 0):
        np.add.at(total, point, values)
        return
    starts = np.flatnonzero(np.diff(point, prepend=-1))
    total[point[starts]] += np.add.reduceat(values, starts, axis=0)


def strips(
    n: int, free_points: Mask, equations: Sequence[Equations]
) -> Iterator[tuple[slice, Array]]:
    """Yield B^T P A of the points in chunks, dense, shape (points, 3, n)."""
    products = [
        (e, np.swapaxes(e.B, 1, 2) @ (e.A / e.sigma[:, :, None] ** 2))
        for e in equations
        if e.B is not None and e.point is not None and e.A.shape[2]
    ]
    for start in range(0, len(free_points), CHUNK):
        chunk = slice(start, min(start + CHUNK, len(free_points)))
        strip = np.zeros((chunk.stop - start) * 3 * (n + 1))
        for e, product in products:
            point = np.asarray(e.point)
            rows = np.flatnonzero((point >= start) & (point < chunk.stop))
            columns = np.where(e.columns < 0, n, e.columns)[e.unit[rows]]
            at = (point[rows] - start)[:, None] * 3 + np.arange(3)
            flat = at[:, :, None] * (n + 1) + columns[:, None, :]
            strip += np.bincount(flat.ravel(), product[rows].ravel(), minlength=len(strip))
        dense = strip.reshape(-1, 3, n + 1)[:, :, :n]
        dense[~free_points[chunk]] = 0.0
        yield chunk, dense


def gather(dx: Array, columns: Index) -> Array:
    """Return the entries of dx at columns, zero where a column is -1."""
    return np.append(dx, 0.0)[columns]


def solve_scaled(N: Array, g: Array, diagonal: Array) -> Array:
    """Solve N x = g scaled to a unit diagonal, of minimum norm where N is singular."""
    if len(N) == 0:
        return g
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    scaled = N * scale[:, None] * scale
    try:
        factor = linalg.cho_factor(scaled, lower=True)
        if np.min(np.abs(np.diagonal(factor[0]))) ** 2 > SINGULAR:
            return np.asarray(scale * linalg.cho_solve(factor, scale * g))
    except linalg.LinAlgError:
        pass
    values, vectors = linalg.eigh(scaled)
    keep = values > SINGULAR
    part = vectors[:, keep]
    return np.asarray(scale * (part @ ((part.T @ (scale * g)) / values[keep])))


def damped_step(
    n: int, free_points: Mask, equations: Sequence[Equations], damping: float
) -> tuple[Array, Array, float]:
    """Return the damped Gauss-Newton step and the decrease of cost that it predicts."""
    N, g = column_normals(n, equations)
    V, h = point_normals(free_points, equations)
    diagonal = N.diagonal().copy()
    N[np.diag_indices_from(N)] += damping * diagonal
    V = V + damping * (V * np.eye(3))
    V_inv = np.linalg.inv(V)
    for points, strip in strips(n, free_points, equations):
        L_inv = np.linalg.inv(np.linalg.cholesky(V[points]))
        Z = (L_inv @ strip).reshape(3 * len(strip), -1)
        N -= Z.T @ Z
        g -= Z.T @ np.einsum("pij,pj->pi", L_inv, h[points]).ravel()
    dx = -solve_scaled(N, g, diagonal)
    cross = np.zeros_like(h)
    for e in equations:
        if e.B is not None and e.point is not None and e.A.shape[2]:
            Adx = np.einsum("mdk,mk->md", e.A, gather(dx, e.columns)[e.unit])
            np.add.at(cross, e.point, np.einsum("mdi,md->mi", e.B, Adx / e.sigma**2))
    dp = -np.einsum("pij,pj->pi", V_inv, h + cross)
    dp[~free_points] = 0.0
    # the undamped gradient in the full system is (g before reduction, h); g now holds g - W V^-1 h
    decrement = -float(g @ dx) + float(np.einsum("pi,pij,pj->", h, V_inv, h))
    return dx, dp, decrement
