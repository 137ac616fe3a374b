"""Covariances of a bundle's points and redundancy numbers of its rays, in compiled code.

The plain version that it must equal is `normal_equations.PlainNormals.precision`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acx4lib.bundle.compiled.elimination import (
    Room,
    add_point_by_ray,
    factor,
    point_by_ray,
    room_for,
    small,
)
from acx4lib.bundle.compiled.rays import Scene, SortedRays, linearise
from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array

# products with V^-1 times a point's derivatives
_gain = small(3, 3, 16, left=(3, 1), right=16, out=16)
_take_off_by_pose = small(3, 6, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_by_interior = small(3, 9, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_interior_by_pose = small(3, 6, 16, left=(16, 1), right=16, out=16, add=-1)
_take_off_interior = small(3, 9, 16, left=(16, 1), right=16, out=16, add=-1)
_add_rows = small(3, 3, 16, left=(3, 1), right=16, out=16, add=1)
_row_times_square = small(1, 16, 16, left=(16, 1), right=16, out=16)
_add_point_times_rays = small(1, 3, 16, left=(3, 1), right=16, out=16, add=1)


class CameraCovariances(NamedTuple):
    """Covariances of camera poses and interior orientations.

    Attributes
    ----------
    Q : ndarray, shape (n_images, 2 * band - 1, 6, 8)
        Entry d: pose of image i with the pose of image i + d - (band - 1).
    F : ndarray, shape (n_images, n_cameras, 6, 16)
        Pose with interior orientation, which fills columns 6 to 14.
    F_T : ndarray, shape (n_images, n_cameras, 9, 8)
        The transposes of F: interior orientation with pose.
    H : ndarray, shape (n_cameras, n_cameras, 9, 16)
        Interior with interior, columns 6 to 14.
    K : ndarray, shape (n_images, 16, 16)
        Pose and interior orientation of each image together.
    """

    Q: Array
    F: Array
    F_T: Array
    H: Array
    K: Array


# --- one point -------------------------------------------------------------------------------


@inlined
def _point_covariance(rays: SortedRays, p: int, room: Room, cov: CameraCovariances) -> None:
    """Fill C with a point's covariance, X and X_sums with those of point and cameras."""
    T, G, X, X_sums = room.T, room.Y, room.X, room.X_sums
    start, n = rays.start[p], rays.start[p + 1] - rays.start[p]
    middle, n_cameras = cov.Q.shape[1] // 2, cov.H.shape[0]
    _square(room.W, room.V_inv)
    for c in range(n_cameras):
        _gain(room.Y_sums, c * 48, room.V_inv, 0, room.sums, c * 48)
    for k in range(n):
        point_by_ray(T, 0, room.B, k * 6, room.J, k * 32)
        _gain(G, k * 48, room.V_inv, 0, T, 0)
    for k in range(n):
        i = rays.image[start + k]
        for j in range(n):
            other = rays.image[start + j]
            block = (other * cov.Q.shape[1] + middle + i - other) * 48
            _take_off_by_pose(X, k * 48, G, j * 48, cov.Q, block)
        for c in range(n_cameras):
            block = i * n_cameras + c
            _take_off_by_interior(X, k * 48, room.Y_sums, c * 48 + 6, cov.F_T, block * 72)
            _take_off_interior_by_pose(X_sums, c * 48, G, k * 48, cov.F, block * 96)
    for c in range(n_cameras):
        for d in range(n_cameras):
            block = (d * n_cameras + c) * 144
            _take_off_interior(X_sums, c * 48, room.Y_sums, d * 48 + 6, cov.H, block)
    _take_off_products(room, n, n_cameras)


@inlined
def _square(W: Array, out: Array) -> None:
    """Fill in W W^T for an upper triangular W."""
    for a in range(3):
        for b in range(3):
            out[a, b] = 0.0
            for c in range(max(a, b), 3):
                out[a, b] += W[a, c] * W[b, c]


@inlined
def _take_off_products(room: Room, n: int, n_cameras: int) -> None:
    """Fill C with V^-1 minus the sum of X G^T over rays and cameras."""
    G, X, C = room.Y, room.X, room.C
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for k in range(n):
                for c in range(8):  # the last two columns of X are zero
                    total += X[k, a, c] * G[k, b, c]
            for d in range(n_cameras):
                for c in range(6, 15):
                    total += room.X_sums[d, a, c] * room.Y_sums[d, b, c]
            C[a, b] = room.V_inv[a, b] - total
            C[b, a] = C[a, b]


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


@compiled
def precision(
    rays: SortedRays, scene: Scene, first: int, last: int, cov: CameraCovariances, out: Tests
) -> None:
    """Fill in the covariances of some points and the redundancy numbers of their rays.

    Parameters
    ----------
    rays, scene
    first, last : int
        The range of points.
    cov : CameraCovariances
    out : Tests
    """
    room = room_for(rays, first, last, cov.H.shape[0])
    J, B, C = room.J, room.B, room.C
    identity, z, twice = np.eye(3), np.zeros(16), np.zeros(3)
    for p in range(first, last):
        start, n, at = rays.start[p], rays.start[p + 1] - rays.start[p], rays.point[p]
        room.sums[:] = 0.0
        room.X[:n] = 0.0
        room.X_sums[:] = 0.0
        C[:] = 0.0
        for k in range(n):
            linearise(rays, scene, p, start + k, J, B, k)
            camera = scene.camera[rays.image[start + k]]
            add_point_by_ray(room.sums, camera * 48, B, k * 6, J, k * 32)
        if rays.free[p]:
            if factor(rays, scene, p, room):
                _point_covariance(rays, p, room, cov)
            else:
                C[:] = np.inf
            out.cov_points[at] = C
        for k in range(n):
            i, at = rays.image[start + k], rays.row[start + k]
            _add_rows(room.X, k * 48, identity, 0, room.X_sums, scene.camera[i] * 48)
            for row in range(2):
                out.v[at, row] = J[k, row, 15]
                J[k, row, 15] = 0.0
                _row_times_square(z, 0, J, k * 32 + row * 16, cov.K, i * 256)
                total = 0.0
                for a in range(3):
                    twice[a] = 2 * B[k, row, a]
                    for b in range(3):
                        total += B[k, row, a] * C[a, b] * B[k, row, b]
                _add_point_times_rays(z, 0, twice, 0, room.X, k * 48)
                for c in range(16):
                    total += z[c] * J[k, row, c]
                out.redundancy[at, row] = 1 - total
