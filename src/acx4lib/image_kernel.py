"""Image points of a bundle in compiled code: the fused passes over all rays.

Camera poses and interior orientations are all that it knows; what a pose hangs on, eq. (14),
comes in afterwards by the chain rule (`reduction`). No derivative outlives its point. The plain
version that these passes must equal is `normal_equations.PlainNormals`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from acx4lib._typing import Array
from acx4lib.rays import Rays, Scene, compiled, inlined, linearise
from acx4lib.small_products import SmallProduct


def _small(*shape: int, **strides: Any) -> Callable[..., None]:
    rows, inner, width = shape
    return SmallProduct(rows=rows, inner=inner, width=width, **strides).compiled()


# rows of 16 numbers, a transpose on the left
_add_squares = _small(16, 2, 16, left=(1, 16), right=16, out=16, add=1, upper=True)
_point_by_ray = _small(3, 2, 16, left=(1, 3), right=16, out=16)
_add_point_by_ray = _small(3, 2, 16, left=(1, 3), right=16, out=16, add=1)
_whitened = _small(3, 3, 16, left=(1, 3), right=16, out=16)
_take_off_pair = _small(6, 3, 8, left=(1, 16), right=16, out=8, add=-1)
_take_off_border = _small(6, 3, 16, left=(1, 16), right=16, out=16, add=-1)
_take_off_corner = _small(16, 3, 16, left=(1, 16), right=16, out=16, add=-1)
# V^-1 times a point's derivatives, and covariances by it
_gain = _small(3, 3, 16, left=(3, 1), right=16, out=16)
_take_off_by_pose = _small(3, 6, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_by_interior = _small(3, 9, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_interior_by_pose = _small(3, 6, 16, left=(16, 1), right=16, out=16, add=-1)
_take_off_interior = _small(3, 9, 16, left=(16, 1), right=16, out=16, add=-1)
_add_rows = _small(3, 3, 16, left=(3, 1), right=16, out=16, add=1)
_row_times_square = _small(1, 16, 16, left=(16, 1), right=16, out=16)
_add_point_times_rays = _small(1, 3, 16, left=(3, 1), right=16, out=16, add=1)


class CameraNormals(NamedTuple):
    """Normal equations of camera poses and interior orientations, points eliminated.

    Attributes
    ----------
    M : ndarray, shape (n_images, 16, 16)
        Squares of each image's rays, before elimination; upper triangle.
    S : ndarray, shape (n_images, band, 6, 8)
        What elimination adds to image i against image i + d; two columns of padding.
    E : ndarray, shape (n_images, n_cameras, 6, 16)
        The same, image against interior orientation.
    I : ndarray, shape (n_cameras, n_cameras, 16, 16)
        The same, interior against interior.
    """

    M: Array
    S: Array
    E: Array
    I: Array  # noqa: E741 (of Interior)


def camera_normals(n_images: int, n_cameras: int, band: int) -> CameraNormals:
    """Return normal equations without any observation."""
    return CameraNormals(
        M=np.zeros((n_images, 16, 16)),
        S=np.zeros((n_images, band, 6, 8)),
        E=np.zeros((n_images, n_cameras, 6, 16)),
        I=np.zeros((n_cameras, n_cameras, 16, 16)),
    )


class CameraCovariances(NamedTuple):
    """Covariances of camera poses and interior orientations.

    Attributes
    ----------
    Q : ndarray, shape (n_images, 2 * band - 1, 6, 8)
        Pose of image i with that of image i + d - (band - 1).
    F : ndarray, shape (n_images, n_cameras, 6, 16)
        Pose with interior orientation, which fills columns 6 to 14.
    F_T : ndarray, shape (n_images, n_cameras, 9, 8)
        The same the other way round.
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


class Room(NamedTuple):
    """Working arrays for the rays of one point.

    Attributes
    ----------
    J, B : ndarray, shapes (n, 2, 16) and (n, 2, 3)
        Derivatives of its rays by camera and by point.
    T : ndarray, shape (3, 16)
        B^T J of a ray.
    Y, X : ndarray, shape (n, 3, 16)
        T of all rays in other forms.
    sums, Y_sums, X_sums : ndarray, shape (n_cameras, 3, 16)
        The same, summed over the rays of each camera.
    V, W, V_inv, C : ndarray, shape (3, 3)
        Normal matrix, inverse root, inverse, covariance.
    """

    J: Array
    B: Array
    T: Array
    Y: Array
    X: Array
    sums: Array
    Y_sums: Array
    X_sums: Array
    V: Array
    W: Array
    V_inv: Array
    C: Array


@compiled
def _room(rays: Rays, first: int, last: int, n_cameras: int) -> Room:
    """Return working arrays for the point with the most rays."""
    n = 1
    for p in range(first, last):
        n = max(n, rays.start[p + 1] - rays.start[p])
    return Room(
        np.zeros((n, 2, 16)),
        np.zeros((n, 2, 3)),
        np.zeros((3, 16)),
        np.zeros((n, 3, 16)),
        np.zeros((n, 3, 16)),
        np.zeros((n_cameras, 3, 16)),
        np.zeros((n_cameras, 3, 16)),
        np.zeros((n_cameras, 3, 16)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
        np.zeros((3, 3)),
    )


@inlined
def _factor(rays: Rays, scene: Scene, p: int, room: Room) -> bool:
    """Fill V and W with a point's damped normal matrix V = L L^T and L^-T; False if open."""
    B, V, W, also = room.B, room.V, room.W, rays.also[p]
    for a in range(3):
        for b in range(a, 3):
            V[a, b] = scene.V[also, a, b] if also >= 0 else 0.0
    for k in range(rays.start[p + 1] - rays.start[p]):
        for a in range(3):
            for b in range(a, 3):
                V[a, b] += B[k, 0, a] * B[k, 0, b] + B[k, 1, a] * B[k, 1, b]
    for a in range(3):
        V[a, a] *= 1 + scene.damping
    if not V[0, 0] > 0:
        return False
    a = 1 / np.sqrt(V[0, 0])
    l10, l20 = V[0, 1] * a, V[0, 2] * a
    d1 = V[1, 1] - l10 * l10
    if not d1 > 0:
        return False
    b = 1 / np.sqrt(d1)
    l21 = (V[1, 2] - l20 * l10) * b
    d2 = V[2, 2] - l20 * l20 - l21 * l21
    if not d2 > 0:
        return False
    c = 1 / np.sqrt(d2)
    W[0, 0], W[1, 1], W[2, 2] = a, b, c
    W[0, 1], W[1, 2] = -l10 * a * b, -l21 * b * c
    W[0, 2] = (l10 * l21 * b - l20) * a * c
    return True


@inlined
def _eliminate(rays: Rays, p: int, room: Room, out: CameraNormals) -> float:
    """Take a point's part off the normal equations; return the decrement of moving it alone."""
    J, B, T, Y, Y_sums = room.J, room.B, room.T, room.Y, room.Y_sums
    start, n = rays.start[p], rays.start[p + 1] - rays.start[p]
    band, n_cameras = out.S.shape[1], out.I.shape[0]
    for c in range(n_cameras):
        _whitened(Y_sums, c * 48, room.W, 0, room.sums, c * 48)
    for k in range(n):
        _point_by_ray(T, 0, B, k * 6, J, k * 32)
        _whitened(Y, k * 48, room.W, 0, T, 0)
    for k in range(n):
        i = rays.image[start + k]
        for j in range(k, n):
            d = rays.image[start + j] - i
            _take_off_pair(out.S, (i * band + d) * 48, Y, k * 48, Y, j * 48)
            if d == 0 and j > k:  # twice in one image
                _take_off_pair(out.S, i * band * 48, Y, j * 48, Y, k * 48)
        for c in range(n_cameras):
            _take_off_border(out.E, (i * n_cameras + c) * 96, Y, k * 48, Y_sums, c * 48)
    for a in range(n_cameras):
        for b in range(n_cameras):
            _take_off_corner(out.I, (a * n_cameras + b) * 256, Y_sums, a * 48, Y_sums, b * 48)
    decrement = 0.0
    for a in range(3):
        along = 0.0
        for c in range(n_cameras):
            along += Y_sums[c, a, 15]
        decrement += along * along
    return decrement


@inlined
def _point_covariance(rays: Rays, p: int, room: Room, cov: CameraCovariances) -> None:
    """Fill C with a point's covariance, X and X_sums with that of point and camera."""
    T, G, X, X_sums = room.T, room.Y, room.X, room.X_sums
    start, n = rays.start[p], rays.start[p + 1] - rays.start[p]
    middle, n_cameras = cov.Q.shape[1] // 2, cov.H.shape[0]
    _square(room.W, room.V_inv)
    for c in range(n_cameras):
        _gain(room.Y_sums, c * 48, room.V_inv, 0, room.sums, c * 48)
    for k in range(n):
        _point_by_ray(T, 0, room.B, k * 6, room.J, k * 32)
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
    """Fill in W W^T of an upper triangle."""
    for a in range(3):
        for b in range(3):
            out[a, b] = 0.0
            for c in range(max(a, b), 3):
                out[a, b] += W[a, c] * W[b, c]


@inlined
def _take_off_products(room: Room, n: int, n_cameras: int) -> None:
    """Fill C with V^-1 less the sum of X G^T over rays and cameras."""
    G, X, C = room.Y, room.X, room.C
    for a in range(3):
        for b in range(a, 3):
            total = 0.0
            for k in range(n):
                for c in range(8):  # X is zero in the last two
                    total += X[k, a, c] * G[k, b, c]
            for d in range(n_cameras):
                for c in range(6, 15):
                    total += room.X_sums[d, a, c] * room.Y_sums[d, b, c]
            C[a, b] = room.V_inv[a, b] - total
            C[b, a] = C[a, b]


# --- passes ----------------------------------------------------------------------------------


@compiled
def accumulate(
    rays: Rays, scene: Scene, first: int, last: int, out: CameraNormals
) -> tuple[bool, float]:
    """Add the normal equations of some points' rays, the points eliminated.

    Parameters
    ----------
    rays, scene
    first, last : int
        Which points.
    out : CameraNormals
        Added to.

    Returns
    -------
    ahead : bool
        Whether every point is in front of its cameras.
    decrement : float
        What moving the points alone would take off the cost, to first order.
    """
    room, decrement = _room(rays, first, last, out.I.shape[0]), 0.0
    J, B, sums = room.J, room.B, room.sums
    for p in range(first, last):
        start = rays.start[p]
        sums[:] = 0.0
        for k in range(rays.start[p + 1] - start):
            if not linearise(rays, scene, p, start + k, J, B, k):
                return False, 0.0
            i = rays.image[start + k]
            _add_squares(out.M, i * 256, J, k * 32, J, k * 32)
            _add_point_by_ray(sums, scene.camera[i] * 48, B, k * 6, J, k * 32)
        if rays.free[p] and _factor(rays, scene, p, room):
            if rays.also[p] >= 0:
                for a in range(3):
                    sums[0, a, 15] += scene.h[rays.also[p], a]
            decrement += _eliminate(rays, p, room, out)
    return True, decrement


@compiled
def move_points(rays: Rays, scene: Scene, first: int, last: int, step: Array, out: Array) -> None:
    """Fill in the steps of some points that follow from those of the cameras.

    Parameters
    ----------
    rays, scene
    first, last : int
        Which points.
    step : ndarray, shape (n_images, 16)
        Of camera pose and interior orientation, and a one.
    out : ndarray, shape (n, 3)
        Like `Scene.x_m`.
    """
    room, s = _room(rays, first, last, 1), np.zeros(3)
    J, B, W = room.J, room.B, room.W
    for p in range(first, last):
        if not rays.free[p]:
            continue
        also, start, at = rays.also[p], rays.start[p], rays.point[p]
        for c in range(3):
            s[c] = scene.h[also, c] if also >= 0 else 0.0
        for k in range(rays.start[p + 1] - start):
            linearise(rays, scene, p, start + k, J, B, k)
            i = rays.image[start + k]
            a = b = 0.0
            for c in range(16):
                a += J[k, 0, c] * step[i, c]
                b += J[k, 1, c] * step[i, c]
            for c in range(3):
                s[c] += B[k, 0, c] * a + B[k, 1, c] * b
        if _factor(rays, scene, p, room):
            a, b = W[0, 0] * s[0], W[0, 1] * s[0] + W[1, 1] * s[1]
            c = W[0, 2] * s[0] + W[1, 2] * s[1] + W[2, 2] * s[2]
            out[at, 0] = -(W[0, 0] * a + W[0, 1] * b + W[0, 2] * c)
            out[at, 1] = -(W[1, 1] * b + W[1, 2] * c)
            out[at, 2] = -W[2, 2] * c


class Tests(NamedTuple):
    """What is said of points and rays.

    Attributes
    ----------
    cov_points : ndarray, shape (n, 3, 3)
        Like `Scene.x_m`; infinite for points that are open, as it was for those that are held.
    v, redundancy : ndarray, shape (n_rays, 2)
        In the block's order; the residuals are along x and y, over their standard deviations.
    """

    cov_points: Array
    v: Array
    redundancy: Array


@compiled
def quality(
    rays: Rays, scene: Scene, first: int, last: int, cov: CameraCovariances, out: Tests
) -> None:
    """Fill in covariances of some points, and the tests of their rays.

    Parameters
    ----------
    rays, scene
    first, last : int
        Which points.
    cov : CameraCovariances
    out : Tests
    """
    room = _room(rays, first, last, cov.H.shape[0])
    J, B, C = room.J, room.B, room.C
    identity, z, twice = np.eye(3), np.zeros(16), np.zeros(3)
    for p in range(first, last):
        start, n, at = rays.start[p], rays.start[p + 1] - rays.start[p], rays.point[p]
        room.sums[:] = 0.0
        room.X[:] = 0.0
        room.X_sums[:] = 0.0
        C[:] = 0.0
        for k in range(n):
            linearise(rays, scene, p, start + k, J, B, k)
            camera = scene.camera[rays.image[start + k]]
            _add_point_by_ray(room.sums, camera * 48, B, k * 6, J, k * 32)
        if rays.free[p]:
            if _factor(rays, scene, p, room):
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
