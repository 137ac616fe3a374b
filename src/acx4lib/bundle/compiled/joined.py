"""Points that are eliminated together with the unknowns that join them to others.

A distance has two points. Its two halves, `observations.distance_equations`, have one each, and
an unknown of the border that joins them. The compiled passes do not know such unknowns; here the
few points that have some are treated in the way of `normal_equations.PlainNormals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from acx4lib.bundle.compiled.covariances import Tests
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares.adjustment import of_points
from acx4lib.least_squares.normal_equations import Equations, point_normals
from acx4lib.least_squares.reduced_system import Bordered, Inverse, held_at_zero


@dataclass(frozen=True, kw_only=True, eq=False)
class _Point:
    """A joined point: what connects it with the columns of its rays and of its distances.

    Attributes
    ----------
    columns : ndarray, shape (c,)
    is_joint : ndarray of bool, shape (c,)
        Which of them are joining unknowns.
    strip : ndarray, shape (3, c)
        B^T P A.
    V_inv, h : ndarray, shapes (3, 3) and (3,)
        Inverse of its damped normal matrix, and its right side.
    rays, halves : tuple of ndarray
        Rows of its rays and halves of distances, and derivatives by the columns and the point.
    """

    columns: Index
    is_joint: Mask
    strip: Array
    V_inv: Array
    h: Array
    rays: tuple[Index, Array]
    halves: tuple[Index, Array]


@dataclass(frozen=True, kw_only=True, eq=False)
class Joined:
    """The free points with an unknown that joins them to others.

    Attributes
    ----------
    points : ndarray, shape (k,)
        Their numbers in the block.
    rows, halves : ndarray, shape (n,) and (h,)
        Their rays among the image points of the network, and their halves of distances.
    n_halves : int
        Number of all halves: a point without error has no others.
    equations : sequence of Equations
        These rays first, these halves last, between them what else observes these points; points
        are numbered from zero.
    joints : ndarray, shape (j,)
        Columns of the unknowns that join them.
    damping : float
    """

    points: Index
    rows: Index
    halves: Index
    n_halves: int
    equations: Sequence[Equations]
    joints: Index
    damping: float

    @cached_property
    def _each(self) -> list[_Point]:
        V, h = point_normals(np.ones(len(self.points), dtype=bool), self.equations)
        V_inv = np.linalg.inv(V + self.damping * (V * np.eye(3)))
        rays, halves = self.equations[0], self.equations[-1]
        out = []
        for p in range(len(self.points)):
            own = [(e, np.flatnonzero(e.point == p)) for e in (rays, halves)]
            columns = np.unique(np.concatenate([e.columns[e.unit[i]].ravel() for e, i in own]))
            columns = columns[columns >= 0]
            parts = [(e, i, _scattered(e, i, columns)) for e, i in own]
            strip = sum(
                np.einsum("mdi,mdc->ic", J[:, :, -3:] / e.sigma[i][:, :, None] ** 2, J[:, :, :-3])
                for e, i, J in parts
            )
            out.append(
                _Point(
                    columns=columns,
                    is_joint=np.isin(columns, self.joints),
                    strip=np.asarray(strip),
                    V_inv=V_inv[p],
                    h=h[p],
                    rays=(own[0][1], parts[0][2]),
                    halves=(own[1][1], parts[1][2]),
                )
            )
        return out

    def reduce(self, system: Bordered, place: Index) -> None:
        """Take off the elimination's part that belongs to the joining unknowns.

        Parameters
        ----------
        system : Bordered
            Normal equations of which the points are eliminated but for this part.
        place : ndarray, shape (n_columns + 1,)
            Where the unknowns stand in it, -1 for one that is held.
        """
        m = len(system.D)
        for one in self._each:
            at, own = place[one.columns], one.strip[:, one.is_joint]
            rows, N = at[one.is_joint], own.T @ one.V_inv @ one.strip
            near, far = ~one.is_joint & (at < m), at >= m
            system.D[np.ix_(rows, rows)] -= N[:, one.is_joint]
            system.D[np.ix_(rows, at[near])] -= N[:, near]
            system.D[np.ix_(at[near], rows)] -= N[:, near].T
            system.C[np.ix_(rows, at[far] - m)] -= N[:, far]
            system.g[rows] -= own.T @ one.V_inv @ one.h

    def pulled(self, dx: Array) -> Array:
        """Return what the steps of the joining unknowns add to the points' right sides, (k, 3)."""
        return np.array(
            [one.strip[:, one.is_joint] @ dx[one.columns[one.is_joint]] for one in self._each]
        )

    def test(self, inverse: Inverse, out: Tests) -> Array:
        """Fill in the points' covariances and the redundancy numbers of their rays.

        Returns
        -------
        ndarray, shape (n_halves, 1)
            What the covariances of points and joining unknowns add to the variances of the
            adjusted halves of the distances.
        """
        sigma, coupled = self.equations[0].sigma, np.zeros((self.n_halves, 1))
        for point, one in zip(self.points, self._each, strict=True):
            gain = one.V_inv @ one.strip
            Q = held_at_zero(inverse, one.columns[:, None], one.columns)
            cross = -gain @ Q
            cov = out.cov_points[point] = one.V_inv - cross @ gain.T
            rows, J = one.rays
            explained = np.sum((J @ np.block([[Q, cross.T], [cross, cov]])) * J, axis=2)
            out.redundancy[self.rows[rows]] = 1 - explained / sigma[rows] ** 2
            rows, J = one.halves
            coupled[self.halves[rows]] = 2 * np.sum((J[:, :, -3:] @ cross) * J[:, :, :-3], axis=2)
        return coupled


def _scattered(e: Equations, rows: Index, columns: Index) -> Array:
    """Return derivatives by some columns and by the point, shape (rows, d, len(columns) + 3)."""
    n, d = len(rows), e.v.shape[1]
    out = np.zeros((n, d, len(columns) + 4))  # the last one collects what is held
    at = np.where(e.columns < 0, len(columns) + 3, np.searchsorted(columns, e.columns))
    into = np.broadcast_to(at[e.unit[rows]][:, None], (n, d, at.shape[1]))
    np.put_along_axis(out, into, e.A[rows], axis=2)
    out[:, :, len(columns) : -1] = 0.0 if e.B is None else e.B[rows]
    return out[:, :, :-1]


def by_points(points: Index, others: Sequence[Equations]) -> tuple[Array, Array]:
    """Return normal matrices and right sides of some points, by observations but their rays.

    Parameters
    ----------
    points : ndarray, shape (k,)
        Sorted.
    others : sequence of Equations
    """
    own = [of_points(e, points)[0] for e in others if e.B is not None]
    return point_normals(np.ones(len(points), dtype=bool), own)
