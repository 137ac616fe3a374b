"""Observation equations and normal equations: the interface of an adjustment."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np
from scipy import sparse

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


# --- Normal equations of sparse rows, points eliminated; no camera, no iteration
#
# This is the plain version, for any problem; `bundle.compiled.normals` is for image points.


ROUNDING = 1e-14
"""Singular value, as a share of the largest, below which there are only rounding errors."""


def cost_of(equations: Iterable[Equations]) -> float:
    """Return the weighted sum of squared residuals; infinite where it is not finite."""
    with np.errstate(over="ignore"):  # after a very large step
        cost = sum(e.cost for e in equations)
    return cost if np.isfinite(cost) else np.inf


def column_normals(n: int, equations: Sequence[Equations]) -> tuple[Array, Array]:
    """Return A^T P A and A^T P v over all groups."""
    N, g = np.zeros((n, n)), np.zeros(n)
    for e in equations:
        A, v = _whitened(n, e)
        N += (A.T @ A).toarray()
        g += A.T @ v
    return N, g


def _whitened(n: int, e: Equations) -> tuple[sparse.csr_array, Array]:
    """Return A, shape (m d, n), and v of a group, whitened to unit weights."""
    A = column_rows(n, e, e.A / e.sigma[:, :, None])
    v: Array = e.v / e.sigma
    if e.correlation is None:
        return A, v.ravel()
    dense = e.correlation.whitened(A.toarray().reshape(*v.shape, n))
    return sparse.csr_array(dense.reshape(v.size, n)), e.correlation.whitened(v).ravel()


def column_rows(n: int, e: Equations, A: Array) -> sparse.csr_array:
    """Return derivatives of a group as the rows of a matrix, shape (m d, n)."""
    columns = np.broadcast_to(e.columns[e.unit][:, None], A.shape)
    return _sparse(A, columns, n)


def _sparse(values: Array, columns: Index, n: int) -> sparse.csr_array:
    """Return a matrix of rows with entries in columns, both of shape (m, d, k); -1 is left out."""
    m, d, _ = values.shape
    rows = np.broadcast_to(np.arange(m * d).reshape(m, d, 1), values.shape)
    used = columns >= 0
    return sparse.csr_array((values[used], (rows[used], columns[used])), shape=(m * d, n))


def point_normals(free_points: Mask, equations: Sequence[Equations]) -> tuple[Array, Array]:
    """Return B^T P B and B^T P v of every point; the identity where a point is held."""
    n_points = len(free_points)
    V, h = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
    for e in equations:
        if e.B is not None and e.point is not None:
            PB = e.B / e.sigma[:, :, None] ** 2
            np.add.at(V, e.point, np.swapaxes(e.B, 1, 2) @ PB)
            np.add.at(h, e.point, np.einsum("mdi,md->mi", PB, e.v))
    V[~free_points] = np.eye(3)
    h[~free_points] = 0.0
    return V, h


def point_rows(n: int, free_points: Mask, equations: Sequence[Equations]) -> Array:
    """Return B^T P A of every point, shape (n_points, 3, n); zero where a point is held."""
    total = np.zeros((3 * len(free_points), n))
    for e in equations:
        if e.B is not None and e.point is not None and e.A.shape[2]:
            coordinates = np.broadcast_to(3 * e.point[:, None, None] + np.arange(3), e.B.shape)
            B = _sparse(e.B / e.sigma[:, :, None] ** 2, coordinates, len(total))
            total += (B.T @ column_rows(n, e, e.A)).toarray()
    W = total.reshape(len(free_points), 3, n)
    W[~free_points] = 0.0
    return W


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
        L_inv = np.linalg.inv(np.linalg.cholesky(V))
        Z = (L_inv @ self._beside).reshape(3 * len(V), self.n_columns)
        N -= Z.T @ Z
        g -= Z.T @ np.einsum("pij,pj->pi", L_inv, h).ravel()
        return N, g, V, h

    @cached_property
    def _beside(self) -> Array:
        return point_rows(self.n_columns, self.free_points, self.equations)

    @cached_property
    def _step(self) -> tuple[Array, Array, float]:
        free_points = self.free_points
        if not free_points.any():
            dx, decrement = self._orthogonal_step()
            return dx, np.zeros((len(free_points), 3)), decrement
        N, g, V, h = self._reduced
        V_inv = np.linalg.inv(V)
        dx = -Dense(N=N, diagonal=self._columns[0].diagonal()).solve(g)
        dp = -np.einsum("pij,pj->pi", V_inv, h + self._beside @ dx)
        dp[~free_points] = 0.0
        # the gradient in the full system is (g before reduction, h); g now holds g - W V^-1 h
        decrement = -float(g @ dx) + float(np.einsum("pi,pij,pj->", h, V_inv, h))
        return dx, dp, decrement

    def _orthogonal_step(self) -> tuple[Array, float]:
        """Return the step without points, by singular values: normal equations square them."""
        whitened = [_whitened(self.n_columns, e) for e in self.equations]
        A = np.vstack([part.toarray() for part, _ in whitened])
        v = np.concatenate([part for _, part in whitened])
        N, g = self._columns
        scale = 1 / np.sqrt(np.where(N.diagonal() > 0, N.diagonal(), 1.0))
        damped = np.diag(np.sqrt(self.damping * self.diagonal))
        stacked = np.vstack([A, damped]) * scale
        right = -np.concatenate([v, np.zeros(self.n_columns)])
        dx = scale * np.linalg.lstsq(stacked, right, rcond=ROUNDING)[0]
        return dx, -float(g @ dx)

    def precision(self) -> Precision:
        """Return covariances, residuals and redundancy numbers, all without damping."""
        N, _ = column_normals(self.n_columns, self.equations)
        diagonal = N.diagonal().copy()
        V, _ = point_normals(self.free_points, self.equations)
        V_inv = np.linalg.inv(V)
        gain = V_inv @ self._beside  # -d(point)/d(columns)
        V_inv[~self.free_points] = 0.0
        Z = np.linalg.inv(np.linalg.cholesky(V)) @ self._beside
        Z = Z.reshape(3 * len(V), self.n_columns)
        N -= Z.T @ Z
        inverse = Dense(N=N, diagonal=diagonal).inverse()
        return Precision(
            inverse=inverse,
            cov_points=V_inv + gain @ inverse.dense @ np.swapaxes(gain, 1, 2),
            groups=tuple(e.tested(_explained(e, inverse, gain, V_inv)) for e in self.equations),
        )


def _explained(e: Equations, inverse: Inverse, gain: Array, cov_points: Array) -> Array:
    """Return covariances of adjusted observations, as `Equations.tested` takes them.

    Points move by -gain dx, and have `cov_points` where the columns are known.
    """
    if e.correlation is not None:
        return of_pairs(e, inverse)
    n = gain.shape[2]
    A = column_rows(n, e, e.A).toarray().reshape(*e.v.shape, n)
    explained = np.zeros_like(e.v)
    if e.B is not None and e.point is not None:
        A -= e.B @ gain[e.point]
        explained += np.sum((e.B @ cov_points[e.point]) * e.B, axis=2)
    return explained + np.sum((A @ inverse.dense) * A, axis=2)


def of_pairs(e: Equations, inverse: Inverse) -> Array:
    """Return the covariances of the adjusted observations of every correlated pair, (p, d)."""
    assert e.correlation is not None
    i, j = e.correlation.first, e.correlation.second
    cov = held_at_zero(inverse, e.columns[i][:, :, None], e.columns[j][:, None, :])
    return np.sum((e.A[i] @ cov) * e.A[j], axis=2)
