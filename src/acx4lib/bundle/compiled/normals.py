"""Normal equations of a bundle block with its image points compiled.

The plain version that it must equal is `normal_equations.PlainNormals`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from scipy import linalg

from acx4lib.bundle.compiled import elimination
from acx4lib.bundle.compiled.chain_rule import (
    Hanging,
    camera_covariances,
    camera_steps,
    reduced_normals,
)
from acx4lib.bundle.compiled.elimination import CameraNormals, Room, Tests, camera_normals, room_for
from acx4lib.bundle.compiled.packing import Packed
from acx4lib.bundle.compiled.rays import Scene
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares import processors
from acx4lib.least_squares.adjustment import of_points
from acx4lib.least_squares.normal_equations import (
    Equations,
    Precision,
    cost_of,
    gather,
    of_pairs,
    point_normals,
)
from acx4lib.least_squares.reduced_system import (
    LARGEST_DENSE,
    Banded,
    BandedInverse,
    Bordered,
    BorderedCovariance,
    Dense,
    Inverse,
    held_at_zero,
    places,
    too_large,
)
from acx4lib.least_squares.statistics import Correlation, Group

R = TypeVar("R")


def _in_parts(packed: Packed, work: Callable[..., R], *each: Sequence[object]) -> list[R]:
    """Return the results of the work for all parts; several parts run on threads."""
    first, last = zip(*packed.parts, strict=True)
    if len(packed.parts) == 1:
        return list(map(work, first, last, *each))
    with ThreadPoolExecutor(min(processors.cores(), len(packed.parts))) as pool:
        return list(pool.map(work, first, last, *each))


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkNormals:
    """The normal equations of a block at one state: `normal_equations.Normals`.

    Attributes
    ----------
    packed : Packed
    scene : Scene
        Images in the order of `Packed.image`.
    hanging : Hanging
        Poses in the order of `Packed.pose`.
    n_columns : int
        Number of unknowns that are not points.
    border : ndarray, shape (n_cameras, PER_CAMERA)
        Columns of interior orientation and mounting, -1 where held.
    pose_columns : ndarray, shape (n_poses, 6)
        Columns of the poses in the order of `Packed.pose`, -1 where held.
    sigma_px : ndarray, shape (n,)
        Sigma of the image points, in the block's order.
    n_points : int
        Number of points of the block, measured or not.
    others : sequence of Equations
        The observations that are no image points; a unit depends on one pose at most.
    joined : Joined, optional
        Points that some of these join to others.
    room : ndarray, optional
        Memory for the band: new memory takes longer than to fill it.
    """

    packed: Packed
    scene: Scene
    hanging: Hanging
    n_columns: int
    border: Index
    pose_columns: Index
    sigma_px: Array
    n_points: int
    others: Sequence[Equations]
    joined: Joined | None = None
    room: Array | None = None

    # --- assembled ---------------------------------------------------------------------------

    def _room(self, first: int, last: int) -> Room:
        return room_for(self.packed.rays, first, last, self.hanging.n_cameras)

    @cached_property
    def _images(self) -> tuple[Bordered, float, float]:
        """Return the image points' reduced normal equations, cost, and predicted decrease of it."""
        packed = self.packed
        totals = [
            camera_normals(len(packed.image), self.hanging.n_cameras, packed.n_pairs)
            for _ in packed.parts
        ]

        def work(first: int, last: int, total: CameraNormals) -> tuple[bool, float]:
            room = self._room(first, last)
            return elimination.accumulate(packed.rays, self.scene, first, last, room, total)

        done = _in_parts(packed, work, totals)
        while len(totals) > 1:
            for total, more in zip(totals[0], totals.pop(1), strict=True):
                np.add(total, more, out=total)
        ahead = all(ahead for ahead, _ in done)
        cost = float(totals[0].cost.sum()) if ahead else np.inf
        reduced = reduced_normals(totals[0], self.hanging, packed.rays.pair, self.room)
        return reduced, cost, sum(less for _, less in done)

    @cached_property
    def cost(self) -> float:
        """Weighted sum of squared residuals; infinite with a point behind a camera."""
        return self._images[1] + cost_of(self.others)

    @cached_property
    def n_observations(self) -> int:
        """Number of observed components that take part."""
        others = sum(int(np.isfinite(e.sigma).sum()) for e in self.others)
        return 2 * len(self.sigma_px) + others

    @property
    def _n_border(self) -> int:
        return self.n_columns - int(np.sum(self.pose_columns >= 0))

    @cached_property
    def _order(self) -> Index:
        """The unknown to which each column of the bordered system belongs, -1 for a held one."""
        border = np.setdiff1d(np.arange(self.n_columns), self.pose_columns)
        return np.concatenate([border, self.pose_columns.ravel()])

    @cached_property
    def _system(self) -> Bordered:
        """The damped reduced normal equations."""
        m, order, damping = self._n_border, self._order, self.scene.damping
        full = self._images[0]
        columns = self.border.ravel()
        free = columns >= 0
        C, D = np.zeros((m, full.C.shape[1])), np.zeros((m, m))
        C[columns[free]] = full.C[free]
        D[np.ix_(columns[free], columns[free])] = full.D[np.ix_(free, free)]
        g, diagonal = np.zeros(len(order)), np.zeros(len(order))
        n_full = len(columns)
        for out, source in ((g, full.g), (diagonal, full.diagonal)):
            out[columns[free]] = source[:n_full][free]
            out[m:] = source[n_full:]
        more = 6 * self.packed.band - full.P.shape[1]
        P = np.pad(full.P, ((0, 0), (0, more))) if more > 0 else full.P
        system = Bordered(P=P, C=C, D=D, g=g, diagonal=diagonal)
        place = np.append(places(order), -1)
        for e in self.others:
            if e.A.shape[2]:
                _add(system, e, place)
        if self.joined:
            self.joined.reduce(system, place)
        held = order[m:] < 0
        if held.any():
            system.hold(held)
        if damping:
            D[np.diag_indices(m)] += damping * diagonal[:m]
            system.P[:, 0] += damping * diagonal[m:]
        return system

    @cached_property
    def _solver(self) -> Dense | Banded:
        system = self._system
        if not self.packed.dense:
            large = len(system.g) > LARGEST_DENSE
            try:
                return Banded(system if large else replace(system, P=system.P.copy()))
            except linalg.LinAlgError:
                if large:
                    raise too_large() from None
        return Dense(N=system.dense(), diagonal=system.diagonal)

    # --- solved ------------------------------------------------------------------------------

    @cached_property
    def _ordered_step(self) -> Array:
        """The step of columns, in the order of the bordered system."""
        return -self._solver.solve(self._system.g)

    def give_up_band(self) -> Array | None:
        """Return the memory of the band; what needs it is computed again where it is asked for."""
        known = vars(self)
        assembled = known.pop("_images", None)
        for name in ("_system", "_solver"):
            known.pop(name, None)
        return assembled[0].P if assembled else None

    @cached_property
    def promised(self) -> float:
        """Decrease of the cost that the step predicts."""
        return self._images[2] - float(self._system.g @ self._ordered_step)

    def step(self) -> tuple[Array, Array]:
        """Return the step of columns and points."""
        packed = self.packed
        dx = self._ordered_step[places(self._order)]
        border, poses = gather(dx, self.border).ravel(), gather(dx, self.pose_columns)
        along = camera_steps(self.hanging, border, poses)
        dp, scene = np.zeros((self.n_points, 3)), self._pulled(dx)

        def work(first: int, last: int) -> None:
            room = self._room(first, last)
            elimination.move_points(packed.rays, scene, first, last, room, along, dp)

        _in_parts(packed, work)
        return dx, dp

    def _pulled(self, dx: Array) -> Scene:
        """Return the scene with what the steps of joining unknowns add to the points' sides."""
        if self.joined is None:
            return self.scene
        h, number = self.scene.h.copy(), np.full(self.n_points, -1)
        number[self.packed.rays.point] = self.packed.rays.also
        h[number[self.joined.points]] += self.joined.pulled(dx)
        return self.scene._replace(h=h)

    def first_rows(self, n: int) -> tuple[Array, Array]:
        """Return the first n rows of the matrix, and the right side, points eliminated."""
        system, place = self._system, places(self._order)
        return np.hstack([system.D[:n], system.C[:n]])[:, place], system.g[place]

    def covariance(self, columns: Index) -> Array:
        """Return the covariance of some unknowns, without that of all, shape (k, k)."""
        if not isinstance(self._solver, Banded):
            inverse = self._solver.inverse().reordered(self._order)
            return inverse.at(columns[:, None], columns)
        place = places(self._order)[columns]
        unit = np.zeros((len(self._order), len(place)))
        unit[place, np.arange(len(place))] = 1.0
        return self._solver.solve(unit)[place]

    def precision(self) -> Precision:
        """Return covariances, residuals and redundancy numbers, all without damping."""
        packed, solver, m = self.packed, self._solver, self._n_border
        inverse: Inverse
        if isinstance(solver, Banded):
            part = solver.inverse()
            inverse = BandedInverse(factored=solver, part=part, order=self._order)
        else:
            dense = solver.inverse()
            part = BorderedCovariance.of(dense.dense, m, self._system.P.shape[1] // 6)
            inverse = dense.reordered(self._order)
        _cut_off(part, self._order[m:] < 0)
        cov = camera_covariances(_padded(part, self.border), self.hanging, packed.rays.pair)
        tests = Tests(
            cov_points=np.zeros((self.n_points, 3, 3)),
            v=np.empty((len(self.sigma_px), 2)),
            redundancy=np.empty((len(self.sigma_px), 2)),
        )

        def work(first: int, last: int) -> None:
            room = self._room(first, last)
            elimination.precision(packed.rays, self.scene, first, last, room, cov, tests)

        _in_parts(packed, work)
        coupled = self.joined.test(inverse, tests) if self.joined else np.zeros((0, 1))
        groups = [_tested(e, inverse, tests.cov_points, coupled) for e in self.others]
        return Precision(
            inverse=inverse,
            cov_points=tests.cov_points,
            groups=(self._image_points(tests), *groups),
        )

    def _image_points(self, tests: Tests) -> Group:
        """Return the group of the image points, residuals in pixels; rows count downwards."""
        sigma = np.broadcast_to(self.sigma_px[:, None], tests.v.shape)
        np.multiply(tests.v, sigma, out=tests.v)
        np.negative(tests.v[:, 1], out=tests.v[:, 1])
        return Group(kind="image_point", v=tests.v, sigma=sigma, redundancy=tests.redundancy)


def _cut_off(part: BorderedCovariance, held: Mask) -> None:
    """Set the rows and columns of poses that are held to zero, in place."""
    free = ~held.reshape(-1, 6)
    for d in range(part.P.shape[1]):
        i = slice(0, max(len(free) - d, 0))
        part.P[i, d] *= free[i, :, None] & free[d:, None, :]
    part.C[:, held] = 0.0


def _add(system: Bordered, e: Equations, place: Index) -> None:
    """Add observations without points; a unit depends on one pose at most."""
    if e.correlation is not None:
        _add_pairs(system, e, e.correlation, place)
        return
    weighted = e.A / e.sigma[:, :, None] ** 2
    columns = place[e.columns][e.unit]
    used = columns >= 0
    np.add.at(system.g, columns[used], np.einsum("mdk,md->mk", weighted, e.v)[used])
    np.add.at(system.diagonal, columns[used], np.sum(e.A * weighted, axis=1)[used])
    _scatter(system, np.swapaxes(e.A, 1, 2) @ weighted, columns, columns)


def _add_pairs(system: Bordered, e: Equations, correlation: Correlation, place: Index) -> None:
    """Add correlated observations, which link the poses of every pair."""
    columns, A = place[e.columns], e.A / e.sigma[:, :, None]
    by_row, used = np.swapaxes(A, 1, 2), columns >= 0
    weighted = correlation.times(e.v / e.sigma)
    np.add.at(system.g, columns[used], (by_row @ weighted[:, :, None])[:, :, 0][used])
    own, m = np.sum(A * (correlation.own[:, :, None] * A), axis=1), len(system.D)
    np.add.at(system.diagonal, columns[columns >= m], own[columns >= m])
    i, j = correlation.first, correlation.second
    N, before = by_row[i] @ (correlation.weight[:, :, None] * A[j]), system.D.diagonal().copy()
    _scatter(system, N, columns[i], columns[j])
    system.diagonal[:m] += system.D.diagonal() - before


def _scatter(system: Bordered, N: Array, rows: Index, columns: Index) -> None:
    """Add normal matrices of rows and columns, those of poses from the diagonal on."""
    m = len(system.D)
    row, column = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
    both = (row >= 0) & (column >= 0)
    corner, side = both & (row < m) & (column < m), both & (row < m) & (column >= m)
    pose = both & (row >= m) & (column >= row)
    np.add.at(system.D, (row[corner], column[corner]), N[corner])
    np.add.at(system.C, (row[side], column[side] - m), N[side])
    np.add.at(system.P, (row[pose] - m, column[pose] - row[pose]), N[pose])


def _padded(part: BorderedCovariance, border: Index) -> BorderedCovariance:
    """Return the covariance with `PER_CAMERA` border columns for each camera."""
    columns = border.ravel()
    free = columns >= 0
    C, D = np.zeros((len(columns), part.C.shape[1])), np.zeros((len(columns), len(columns)))
    C[free] = part.C[columns[free]]
    D[np.ix_(free, free)] = part.D[np.ix_(columns[free], columns[free])]
    return BorderedCovariance(P=part.P, C=C, D=D)


def _tested(e: Equations, inverse: Inverse, cov_points: Array, coupled: Array) -> Group:
    """Return the group of observations of points or columns; if of both, with their coupling."""
    if e.correlation is not None:
        return e.tested(of_pairs(e, inverse))
    explained = np.zeros_like(e.v)
    if e.B is not None and e.point is not None:
        explained += np.sum((e.B @ cov_points[e.point]) * e.B, axis=2)
    if e.A.shape[2]:
        cov = held_at_zero(inverse, e.columns[:, :, None], e.columns[:, None, :])
        explained += np.sum((e.A @ cov[e.unit]) * e.A, axis=2)
    if e.B is not None and e.A.shape[2]:
        explained += coupled
    return e.tested(explained)


# --- points that distances join to others -----------------------------------------------------
#
# A distance has two points. Its two halves, `observations.distance_equations`, have one each, and
# an unknown of the border that joins them. The compiled passes do not know such unknowns; here the
# few points that have some are treated in the way of `normal_equations.PlainNormals`.


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
