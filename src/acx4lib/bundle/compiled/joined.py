"""Points that are eliminated together with the unknowns that join them to others.

A distance has two points. Its two halves, `observations.distance_equations`, have one each, and
an unknown of the border that joins them. The compiled passes do not know such unknowns; here the
few points that have some are treated in the way of `normal_equations.PlainNormals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from acx4lib.bundle.compiled.covariances import Tests
from acx4lib.expected import Array, Index
from acx4lib.least_squares.banded import Bordered
from acx4lib.least_squares.dense import Inverse, held_at_zero
from acx4lib.least_squares.normal_equations import Equations, point_normals, strips


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
    n_columns : int
    damping : float
    """

    points: Index
    rows: Index
    halves: Index
    n_halves: int
    equations: Sequence[Equations]
    joints: Index
    n_columns: int
    damping: float

    @cached_property
    def _eliminated(self) -> tuple[Array, Array, Array]:
        """Inverse of the points' damped normal matrices, right side, and strip to all columns."""
        free = np.ones(len(self.points), dtype=bool)
        V, h = point_normals(free, self.equations)
        found = [strip for _, strip in strips(self.n_columns, free, self.equations)]
        V_inv = np.linalg.inv(V + self.damping * (V * np.eye(3)))
        return V_inv, h, np.concatenate([np.zeros((0, 3, self.n_columns)), *found])

    def reduce(self, system: Bordered, place: Index) -> None:
        """Take off the elimination's part that belongs to the joining unknowns.

        Parameters
        ----------
        system : Bordered
            Normal equations of which the points are eliminated but for this part.
        place : ndarray, shape (n_columns + 1,)
            Where the unknowns stand in it, -1 for one that is held.
        """
        V_inv, h, strip = self._eliminated
        own = V_inv @ strip[:, :, self.joints]
        rows, m = place[self.joints], len(system.D)
        N = np.einsum("pij,pik->jk", own, strip)
        free = np.flatnonzero(place[:-1] >= 0)
        others = np.setdiff1d(free, self.joints)
        near, far = others[place[others] < m], others[place[others] >= m]
        system.D[np.ix_(rows, rows)] -= N[:, self.joints]
        system.D[np.ix_(rows, place[near])] -= N[:, near]
        system.D[np.ix_(place[near], rows)] -= N[:, near].T
        system.C[np.ix_(rows, place[far] - m)] -= N[:, far]
        system.g[rows] -= np.einsum("pij,pi->j", own, h)

    def pulled(self, dx: Array) -> Array:
        """Return what the steps of the joining unknowns add to the points' right sides, (k, 3)."""
        _, _, strip = self._eliminated
        pulled: Array = strip[:, :, self.joints] @ dx[self.joints]
        return pulled

    def test(self, inverse: Inverse, out: Tests) -> Array:
        """Fill in the points' covariances and the redundancy numbers of their rays.

        Returns
        -------
        ndarray, shape (m, 1)
            What the covariances of points and joining unknowns add to the variances of the
            adjusted halves of the distances.
        """
        V_inv, _, strip = self._eliminated
        rays, *others = self.equations
        halves = others[-1]
        coupled = np.zeros((self.n_halves, 1))
        for p, point in enumerate(self.points):
            own, half = np.flatnonzero(rays.point == p), np.flatnonzero(halves.point == p)
            used = np.unique(rays.columns[rays.unit[own]])
            columns = np.union1d(used[used >= 0], halves.columns[halves.unit[half]])
            gain = V_inv[p] @ strip[p][:, columns]
            Q = held_at_zero(inverse, columns[:, None], columns)
            cross = -gain @ Q
            cov = out.cov_points[point] = V_inv[p] - cross @ gain.T
            J = _scattered(rays, own, columns)
            joint = np.block([[Q, cross.T], [cross, cov]])
            out.redundancy[self.rows[own]] = (
                1 - np.sum((J @ joint) * J, axis=2) / rays.sigma[own] ** 2
            )
            J = _scattered(halves, half, columns)
            by_columns, by_point = J[:, :, : len(columns)], J[:, :, len(columns) :]
            coupled[self.halves[half]] = 2 * np.sum((by_point @ cross) * by_columns, axis=2)
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


def numbered(e: Equations, points: Index) -> tuple[Equations, Index]:
    """Return the observations of some points, which are renumbered, and their rows.

    Parameters
    ----------
    e : Equations
        With points.
    points : ndarray, shape (k,)
        Sorted.
    """
    of = np.asarray(e.point)
    rows = np.flatnonzero(np.isin(of, points))
    own = replace(
        e,
        v=e.v[rows],
        sigma=e.sigma[rows],
        A=e.A[rows],
        unit=e.unit[rows],
        B=None if e.B is None else e.B[rows],
        point=np.searchsorted(points, of[rows]),
    )
    return own, rows


def by_points(points: Index, others: Sequence[Equations]) -> tuple[Array, Array]:
    """Return normal matrices and right sides of some points, by observations but their rays.

    Parameters
    ----------
    points : ndarray, shape (k,)
        Sorted.
    others : sequence of Equations
    """
    own = [numbered(e, points)[0] for e in others if e.B is not None]
    return point_normals(np.ones(len(points), dtype=bool), own)
