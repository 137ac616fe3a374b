"""Observation equations and normal equations: the interface of an adjustment."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.reduced_system import Dense, Inverse, held_at_zero
from acx4lib.least_squares.statistics import Correlation, Group

S = TypeVar("S")


@dataclass(frozen=True, kw_only=True, eq=False)
class Equations:
    """One group of linearised observations, v = estimated - observed.

    Attributes
    ----------
    kind : str
        Name for reports.
    v, sigma : ndarray, shape (m, d)
        An infinite sigma excludes a component.
    A : ndarray, shape (m, d, k)
        dv / d(unknowns of the observation's unit); k may be zero.
    columns : ndarray, shape (n_units, k)
        Places of these unknowns in the reduced system; -1 where held.
    unit : ndarray, shape (m,)
        Observations of one unit share their columns.
    B : ndarray, shape (m, d, 3), optional
        dv / d(point).
    point : ndarray, shape (m,), optional
    correlation : Correlation, optional
        Of correlated observations: each must be a unit by itself, in order, without a point.
    """

    kind: str
    v: Array
    sigma: Array
    A: Array
    columns: Index
    unit: Index
    B: Array | None = None
    point: Index | None = None
    correlation: Correlation | None = None

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals."""
        z = self.v / self.sigma
        return float(np.sum(z**2 if self.correlation is None else z * self.correlation.times(z)))

    def weighed(self, x: Array) -> Array:
        """Return the weights times x, shape (m, d, ...)."""
        sigma = self.sigma.reshape(*self.sigma.shape, *(1,) * (x.ndim - 2))
        if self.correlation is None:
            return x / sigma**2
        return self.correlation.times(x / sigma) / sigma

    def tested(self, explained: Array) -> Group:
        """Return the residuals with their redundancy numbers.

        Parameters
        ----------
        explained : ndarray, shape (m, d), or (p, d) for the pairs of correlated observations
            Covariances of the adjusted observations.
        """
        redundancy: Array = 1 - explained / self.sigma**2 if self.correlation is None else explained
        used, together = np.isfinite(self.sigma), None
        if self.correlation is not None:
            sigma = self.sigma[self.correlation.first] * self.sigma[self.correlation.second]
            z = self.v / self.sigma
            redundancy, together = self.correlation.tested(z, explained / sigma)
        return Group(
            kind=self.kind,
            v=self.v,
            sigma=self.sigma,
            redundancy=np.where(used, redundancy, np.nan),
            together=together,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Precision:
    """Covariances, residuals and redundancy numbers from the normal equations.

    Attributes
    ----------
    inverse : Inverse
        Covariance of the reduced unknowns.
    cov_points : ndarray, shape (n_points, 3, 3)
        Zero for points that are held.
    groups : tuple of Group
    """

    inverse: Inverse
    cov_points: Array
    groups: tuple[Group, ...]


class Problem(Protocol[S]):
    """The interface of an application to the adjustment.

    A problem may also have a method ``normals(state, damping, before)`` that returns its own
    `Normals` and may reuse the memory of the previous ones; otherwise they are assembled from the
    equations.
    """

    @property
    def n_columns(self) -> int:
        """Number of reduced unknowns."""
        ...

    @property
    def n_points(self) -> int:
        """Number of points, free or held."""
        ...

    @property
    def free_points(self) -> Mask:
        """Which points are unknowns."""
        ...

    def equations(self, state: S) -> Sequence[Equations]:
        """Return the linearised observations; residuals are NaN at an impossible state."""
        ...

    def moved(self, state: S, dx: Array, dp: Array) -> S:
        """Return the state after a step in the columns and in the points."""
        ...

    def column_names(self) -> Sequence[str]:
        """Return a name per column, for messages."""
        ...


class Normals(Protocol):
    """Normal equations of a problem at one state."""

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals; infinite at an impossible state."""
        ...

    @property
    def n_observations(self) -> int:
        """Number of observed components that take part."""
        ...

    @property
    def promised(self) -> float:
        """The decrease of cost that the step predicts."""
        ...

    def step(self) -> tuple[Array, Array]:
        """Return the step of columns and points."""
        ...

    def first_rows(self, n: int) -> tuple[Array, Array]:
        """Return the first n rows of the matrix, and the right side A^T P v, points eliminated.

        Shapes (n, n_columns) and (n_columns,); the rows are those of the border.
        """
        ...

    def precision(self) -> Precision:
        """Return covariances, residuals and redundancy numbers, all without damping."""
        ...


# --- Normal equations, assembled unit by unit and point by point; no camera, no iteration
#
# This is the plain version, for any problem; `bundle.compiled.normals` is for image points.


CHUNK = 256
"""Points eliminated at a time; bounds the memory of the dense strips."""

ROUNDING = 1e-14
"""Singular value, as a share of the largest, below which there are only rounding errors."""


def cost_of(equations: Iterable[Equations]) -> float:
    """Return the weighted sum of squared residuals; infinite where it is not finite."""
    with np.errstate(over="ignore"):  # after a very large step
        cost = sum(e.cost for e in equations)
    return cost if np.isfinite(cost) else np.inf


def column_normals(n: int, equations: Sequence[Equations]) -> tuple[Array, Array]:
    """Return A^T P A and A^T P v over all groups, unit by unit."""
    N, g = np.zeros((n, n)), np.zeros(n)
    for e in equations:
        if e.correlation is not None:
            A, v = _dense_rows(n, [e])
            N += A.T @ A
            g += A.T @ v
            continue
        for rows, columns, held in units(e):
            P = 1 / e.sigma[rows] ** 2
            A = e.A[rows].reshape(-1, e.A.shape[2])[:, ~held]
            PA = P.reshape(-1, 1) * A
            N[np.ix_(columns, columns)] += A.T @ PA
            g[columns] += PA.T @ e.v[rows].ravel()
    return N, g


def _dense_rows(n: int, equations: Sequence[Equations]) -> tuple[Array, Array]:
    """Return A, shape (n_rows, n), and v of all groups, whitened to unit weights."""
    A: list[Array] = [np.zeros((0, n))]
    v: list[Array] = [np.zeros(0)]
    for e in equations:
        rows = np.zeros((*e.v.shape, n + 1))
        np.put_along_axis(rows, np.broadcast_to(e.columns[e.unit][:, None], e.A.shape), e.A, axis=2)
        whitened: tuple[Array, Array] = (rows[:, :, :n] / e.sigma[:, :, None], e.v / e.sigma)
        if e.correlation is not None:
            whitened = (e.correlation.whitened(whitened[0]), e.correlation.whitened(whitened[1]))
        A.append(whitened[0].reshape(-1, n))
        v.append(whitened[1].ravel())
    return np.concatenate(A), np.concatenate(v)


def units(e: Equations) -> Iterator[tuple[Index, Index, Mask]]:
    """Yield each unit's rows, its free columns in the reduced system, and the mask of held ones."""
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
            coordinate = (point[rows] - start)[:, None] * 3 + np.arange(3)
            flat = coordinate[:, :, None] * (n + 1) + columns[:, None, :]
            strip += np.bincount(flat.ravel(), product[rows].ravel(), minlength=len(strip))
        dense = strip.reshape(-1, 3, n + 1)[:, :, :n]
        dense[~free_points[chunk]] = 0.0
        yield chunk, dense


def gather(dx: Array, columns: Index) -> Array:
    """Return the entries of dx at columns, zero where a column is -1."""
    return np.append(dx, 0.0)[columns]


@dataclass(frozen=True, kw_only=True, eq=False)
class PlainNormals:
    """The normal equations of a linearised problem.

    Attributes
    ----------
    n_columns : int
    free_points : ndarray, shape (n_points,)
    equations : sequence of Equations
    damping : float
        Added to the diagonal, as a share of it.
    least : ndarray, shape (n_columns,), or float
        Least diagonal of the columns for damping.
    """

    n_columns: int
    free_points: Mask
    equations: Sequence[Equations]
    damping: float = 0.0
    least: Array | float = 0.0

    @cached_property
    def _columns(self) -> tuple[Array, Array]:
        return column_normals(self.n_columns, self.equations)

    @cached_property
    def diagonal(self) -> Array:
        """The diagonal of the columns that is damped, shape (n_columns,)."""
        return np.maximum(self._columns[0].diagonal(), self.least)

    @cached_property
    def cost(self) -> float:
        """Weighted sum of squared residuals."""
        return cost_of(self.equations)

    @cached_property
    def n_observations(self) -> int:
        """Number of observed components that take part."""
        return sum(int(np.isfinite(e.sigma).sum()) for e in self.equations)

    @property
    def promised(self) -> float:
        """The decrease of cost that the step predicts."""
        return self._step[2]

    def step(self) -> tuple[Array, Array]:
        """Return the step of columns and points."""
        return self._step[:2]

    def first_rows(self, n: int) -> tuple[Array, Array]:
        """Return the first n rows of the matrix, and the right side, points eliminated."""
        N, g, _, _ = self._reduced
        return N[:n], g

    @cached_property
    def _reduced(self) -> tuple[Array, Array, Array, Array]:
        """The damped matrix and right side, points eliminated, and those of the points."""
        N, g = (part.copy() for part in self._columns)
        V, h = point_normals(self.free_points, self.equations)
        N[np.diag_indices_from(N)] += self.damping * self.diagonal
        V = V + self.damping * (V * np.eye(3))
        for points, strip in strips(self.n_columns, self.free_points, self.equations):
            L_inv = np.linalg.inv(np.linalg.cholesky(V[points]))
            Z = (L_inv @ strip).reshape(3 * len(strip), -1)
            N -= Z.T @ Z
            g -= Z.T @ np.einsum("pij,pj->pi", L_inv, h[points]).ravel()
        return N, g, V, h

    @cached_property
    def _step(self) -> tuple[Array, Array, float]:
        free_points = self.free_points
        if not free_points.any():
            dx, decrement = self._orthogonal_step()
            return dx, np.zeros((len(free_points), 3)), decrement
        N, g, V, h = self._reduced
        V_inv = np.linalg.inv(V)
        dx = -Dense(N=N, diagonal=self._columns[0].diagonal()).solve(g)
        cross = np.zeros_like(h)
        for e in self.equations:
            if e.B is not None and e.point is not None and e.A.shape[2]:
                Adx = np.einsum("mdk,mk->md", e.A, gather(dx, e.columns)[e.unit])
                np.add.at(cross, e.point, np.einsum("mdi,md->mi", e.B, Adx / e.sigma**2))
        dp = -np.einsum("pij,pj->pi", V_inv, h + cross)
        dp[~free_points] = 0.0
        # the gradient in the full system is (g before reduction, h); g now holds g - W V^-1 h
        decrement = -float(g @ dx) + float(np.einsum("pi,pij,pj->", h, V_inv, h))
        return dx, dp, decrement

    def _orthogonal_step(self) -> tuple[Array, float]:
        """Return the step without points, by singular values: normal equations square them."""
        A, v = _dense_rows(self.n_columns, self.equations)
        N, g = self._columns
        scale = 1 / np.sqrt(np.where(N.diagonal() > 0, N.diagonal(), 1.0))
        damped = np.diag(np.sqrt(self.damping * self.diagonal))
        stacked = np.vstack([A, damped]) * scale
        right = -np.concatenate([v, np.zeros(self.n_columns)])
        dx = scale * np.linalg.lstsq(stacked, right, rcond=ROUNDING)[0]
        return dx, -float(g @ dx)

    def precision(self) -> Precision:
        """Return covariances, residuals and redundancy numbers, all without damping."""
        n, free_points = self.n_columns, self.free_points
        N, _ = column_normals(n, self.equations)
        diagonal = N.diagonal().copy()
        V, _ = point_normals(free_points, self.equations)
        V_inv = np.linalg.inv(V)
        for points, strip in strips(n, free_points, self.equations):
            Z = (np.linalg.inv(np.linalg.cholesky(V[points])) @ strip).reshape(3 * len(strip), -1)
            N -= Z.T @ Z
        inverse = Dense(N=N, diagonal=diagonal).inverse()
        explained = [
            np.zeros_like(e.v if e.correlation is None else e.correlation.weight)
            for e in self.equations
        ]
        cov_points = V_inv
        cov_points[~free_points] = 0.0
        for points, strip in strips(n, free_points, self.equations):
            gain = V_inv[points] @ strip  # -d(point)/d(columns)
            cross = -gain @ inverse.dense
            cov_points[points] -= cross @ np.swapaxes(gain, 1, 2)
            for e, part in zip(self.equations, explained, strict=True):
                _add_explained_by_points(part, e, points, cross, cov_points)
        groups = tuple(
            e.tested(part + _of_columns(e, inverse))
            for e, part in zip(self.equations, explained, strict=True)
        )
        return Precision(inverse=inverse, cov_points=cov_points, groups=groups)


def _of_columns(e: Equations, inverse: Inverse) -> Array:
    """Return the columns' part of the covariances of adjusted observations, as `Equations.tested`.

    Where they are correlated, those of every pair.
    """
    if e.correlation is not None:
        return of_pairs(e, inverse)
    explained = np.zeros_like(e.v)
    for rows, columns, held in units(e):
        A = e.A[rows][:, :, ~held]
        explained[rows] += np.sum((A @ inverse.dense[np.ix_(columns, columns)]) * A, axis=2)
    return explained


def of_pairs(e: Equations, inverse: Inverse) -> Array:
    """Return the covariances of the adjusted observations of every correlated pair, (p, d)."""
    assert e.correlation is not None
    i, j = e.correlation.first, e.correlation.second
    cov = held_at_zero(inverse, e.columns[i][:, :, None], e.columns[j][:, None, :])
    return np.sum((e.A[i] @ cov) * e.A[j], axis=2)


def _add_explained_by_points(
    total: Array, e: Equations, points: slice, cross: Array, cov_points: Array
) -> None:
    """Add the chunk's points' part to the variance of the adjusted observations."""
    if e.B is None or e.point is None:
        return
    rows = np.flatnonzero((e.point >= points.start) & (e.point < points.stop))
    B, point = e.B[rows], e.point[rows]
    total[rows] += np.sum((B @ cov_points[point]) * B, axis=2)
    if e.A.shape[2]:
        padded = np.concatenate([cross, np.zeros((*cross.shape[:2], 1))], axis=2)
        columns = e.columns[e.unit[rows]]
        local = padded[(point - points.start)[:, None], :, columns]  # (rows, k, 3)
        total[rows] += 2 * np.sum((e.A[rows] @ local) * B, axis=2)
