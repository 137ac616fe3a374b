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
        dp = np.zeros((self.n_points, 3))

        def work(first: int, last: int) -> None:
            room = self._room(first, last)
            elimination.move_points(packed.rays, self.scene, first, last, room, along, dp)

        _in_parts(packed, work)
        return dx, dp

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
        groups = [_tested(e, inverse, tests.cov_points) for e in self.others]
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


def _tested(e: Equations, inverse: Inverse, cov_points: Array) -> Group:
    """Return the group of observations of points or of columns."""
    if e.correlation is not None:
        return e.tested(of_pairs(e, inverse))
    explained = np.zeros_like(e.v)
    if e.B is not None and e.point is not None:
        explained += np.sum((e.B @ cov_points[e.point]) * e.B, axis=2)
    if e.A.shape[2]:
        cov = held_at_zero(inverse, e.columns[:, :, None], e.columns[:, None, :])
        explained += np.sum((e.A @ cov[e.unit]) * e.A, axis=2)
    return e.tested(explained)


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
