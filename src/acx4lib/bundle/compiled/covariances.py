"""Covariances of a bundle's points and redundancy numbers of its rays, in compiled code.

The plain version that it must equal is `normal_equations.PlainNormals.precision`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acx4lib.bundle.compiled.elimination import (
    Room,
    add_point_by_ray,
    dot_16,
    factor,
    point_by_ray,
    small,
)
from acx4lib.bundle.compiled.rays import POINT, RESIDUAL, WIDTH, Scene, SortedRays, linearise
from acx4lib.compiling import load, uncounted, uncounted_inlined
from acx4lib.expected import Array

# products with V^-1 times a point's derivatives
_gain = small(3, 3, 16, left=(3, 1), right=16, out=16)
_take_off_by_pose = small(3, 6, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_by_interior = small(3, 10, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_interior_by_pose = small(3, 6, 16, left=(16, 1), right=16, out=16, add=-1)
_take_off_interior = small(3, 10, 16, left=(16, 1), right=16, out=16, add=-1)
_ray_times_square = small(2, 16, 16, left=(WIDTH, 1), right=16, out=16)
_add_ray_by_point = small(3, 2, 8, left=(2, 1), right=WIDTH, out=8, add=1)


class CameraCovariances(NamedTuple):
    """Covariances of camera poses and interior orientations.

    Attributes
    ----------
    Q : ndarray, shape (n_pairs, 2, 6, 8)
        Poses of the two images of each of `SortedRays.pair`, and the transpose.
    F : ndarray, shape (n_images, n_cameras, 6, 16)
        Pose with interior orientation, which fills columns 6 to 15.
    F_T : ndarray, shape (n_images, n_cameras, 10, 8)
        The transposes of F: interior orientation with pose.
    H : ndarray, shape (n_cameras, n_cameras, 10, 16)
        Interior with interior, columns 6 to 15.
    K : ndarray, shape (n_images, 16, 16)
        Pose and interior orientation of each image together.
    """

    Q: Array
    F: Array
    F_T: Array
    H: Array
    K: Array


# --- one point -------------------------------------------------------------------------------


@uncounted_inlined
def _with_cameras(rays: SortedRays, p: int, room: Room, cov: CameraCovariances) -> None:
    """Fill X and X_sums with the covariances of a point with the poses and the interiors."""
    T, G, X, X_sums = room.T, room.Y, room.X, room.X_sums
    start, n = rays.start[p], rays.start[p + 1] - rays.start[p]
    n_cameras = cov.H.shape[0]
    _square(room.W, room.V_inv)
    for c in range(n_cameras):
        _gain(room.Y_sums, c * 48, room.V_inv, 0, room.sums, c * 48)
    for k in range(n):
        point_by_ray(T, 0, room.seen.J, k * 48 + POINT, room.seen.J, k * 48)
        _gain(G, k * 48, room.V_inv, 0, T, 0)
    for k in range(n):
        i = rays.image[start + k]
        for j in range(n):
            other = rays.image[start + j]
            block = 2 * rays.pair[other, i - other] if j < k else 2 * rays.pair[i, other - i] + 1
            _take_off_by_pose(X, k * 48, G, j * 48, cov.Q, block * 48)
        for c in range(n_cameras):
            block = i * n_cameras + c
            _take_off_by_interior(X, k * 48, room.Y_sums, c * 48 + 6, cov.F_T, block * 80)
            _take_off_interior_by_pose(X_sums, c * 48, G, k * 48, cov.F, block * 96)
    for c in range(n_cameras):
        for d in range(n_cameras):
            block = (d * n_cameras + c) * 160
            _take_off_interior(X_sums, c * 48, room.Y_sums, d * 48 + 6, cov.H, block)


@uncounted_inlined
def _square(W: Array, out: Array) -> None:
    """Fill in W W^T for an upper triangular W."""
    for a in range(3):
        for b in range(3):
            out[a, b] = 0.0
            for c in range(max(a, b), 3):
                out[a, b] += W[a, c] * W[b, c]


@uncounted_inlined
def _with_rays(rays: SortedRays, scene: Scene, p: int, room: Room) -> None:
    """Fill P with the covariances of a point with its rays, and C with its own."""
    J, X, X_sums, P, S, V_inv = room.seen.J, room.X, room.X_sums, room.P, room.S, room.V_inv
    S[:] = 0.0
    for k in range(rays.start[p + 1] - rays.start[p]):
        camera = scene.camera[rays.image[rays.start[p] + k]]
        for a in range(3):
            for row in range(2):
                at = k * 48 + row * WIDTH
                by_pose = dot_16(X, k * 48 + a * 16, J, at)
                P[k, a, row] = by_pose + dot_16(X_sums, camera * 48 + a * 16, J, at)
        _add_ray_by_point(S, 0, P, k * 6, J, k * 48 + POINT)
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for c in range(3):
                total += S[a, c] * V_inv[c, b]
            room.C[a, b] = room.C[b, a] = V_inv[a, b] - total


# --- the pass --------------------------------------------------------------------------------


class Tests(NamedTuple):
    """Covariances of points, residuals and redundancy numbers of rays.

    Attributes
    ----------
    cov_points : ndarray, shape (n, 3, 3)
        All points of the block; infinite for an open point, unchanged for a held one.
    v, redundancy : ndarray, shape (n_rays, 2)
        In the block's order; residuals along x and y, divided by their standard deviations.
    """

    cov_points: Array
    v: Array
    redundancy: Array


@uncounted
def precision(
    rays: SortedRays,
    scene: Scene,
    first: int,
    last: int,
    room: Room,
    cov: CameraCovariances,
    out: Tests,
) -> None:
    """Fill in the covariances of some points and the redundancy numbers of their rays.

    Parameters
    ----------
    rays, scene
    first, last : int
        The range of points.
    room : Room
    cov : CameraCovariances
    out : Tests
    """
    J, C, P, z = room.seen.J, room.C, room.P, room.z
    for p in range(first, last):
        start, n, at = rays.start[p], rays.start[p + 1] - rays.start[p], rays.point[p]
        room.sums[:] = 0.0
        room.X[:n] = 0.0
        room.X_sums[:] = 0.0
        C[:] = 0.0
        P[:n] = 0.0
        linearise(rays, scene, p, room.seen)
        for k in range(n):
            camera = scene.camera[rays.image[start + k]]
            add_point_by_ray(room.sums, camera * 48, J, k * 48 + POINT, J, k * 48)
        if rays.free[p]:
            if factor(rays, scene, p, room):
                _with_cameras(rays, p, room, cov)
                _with_rays(rays, scene, p, room)
            else:
                C[:] = np.inf
            for a in range(3):
                for b in range(3):
                    out.cov_points[at, a, b] = C[a, b]
        for k in range(n):
            at = rays.row[start + k]
            _ray_times_square(z, 0, J, k * 48, cov.K, rays.image[start + k] * 256)
            for row in range(2):
                total = dot_16(z, row * 16, J, k * 48 + row * WIDTH)
                for a in range(3):
                    total += 2 * J[k, row, POINT + a] * P[k, a, row]
                    for b in range(3):
                        total += J[k, row, POINT + a] * C[a, b] * J[k, row, POINT + b]
                out.v[at, row] = J[k, row, RESIDUAL]
                out.redundancy[at, row] = 1 - total


load(precision)
