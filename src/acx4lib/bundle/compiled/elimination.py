"""Image points of a bundle in compiled code: the fused passes over all rays.

One pass eliminates the points; another returns to them for their covariances and the redundancy
numbers of their rays. The passes know camera poses and interior orientations only; `chain_rule`
then applies eq. (14). The derivatives of one point are overwritten by those of the next. The
plain version that these passes must equal is `normal_equations.PlainNormals`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from acx4lib.bundle.compiled.rays import POINT, RESIDUAL, WIDTH, Scene, Seen, SortedRays, linearise
from acx4lib.bundle.compiled.small_products import SmallProduct, aligned, dot
from acx4lib.compiling import load, uncounted, uncounted_inlined
from acx4lib.expected import Array


def _small(*shape: int, **strides: Any) -> Callable[..., None]:
    """Return a compiled product of matrices of rows, inner, width: see `SmallProduct`.

    Its callers give the position in an array at which a matrix begins: 48 k for J[k], shape
    (2, 24), and 16 more for B[k], which is a part of it; 48 k for T and Y, (3, 16); 256 k for M
    and I, (16, 16); 96 k for E, (6, 16); 48 k for S, (6, 8).
    """
    rows, inner, width = shape
    return SmallProduct(rows=rows, inner=inner, width=width, **strides).compiled()


# all have a transposed matrix on the left
_add_squares = _small(16, 2, 16, left=(1, WIDTH), right=WIDTH, out=16, add=1, upper=True)
_point_by_ray = _small(3, 2, 16, left=(1, WIDTH), right=WIDTH, out=16)
_add_point_by_ray = _small(3, 2, 16, left=(1, WIDTH), right=WIDTH, out=16, add=1)
_add_gradient = _small(1, 2, 16, left=(1, WIDTH), right=WIDTH, out=16, add=1)
_whitened = _small(3, 3, 16, left=(1, 3), right=16, out=16)
_take_off_pair = _small(6, 3, 8, left=(1, 16), right=16, out=8, add=-1)
_take_off_border = _small(6, 3, 16, left=(1, 16), right=16, out=16, add=-1)
_take_off_corner = _small(16, 3, 16, left=(1, 16), right=16, out=16, add=-1)
_take_off_gradient = _small(1, 3, 16, left=(3, 1), right=16, out=16, add=-1)
_dot_16 = dot(16)


class CameraNormals(NamedTuple):
    """Normal equations of camera poses and interior orientations, points eliminated.

    Attributes
    ----------
    M : ndarray, shape (n_images, 16, 16)
        Normal matrix of each image's rays before elimination; upper triangle.
    S : ndarray, shape (n_pairs, 6, 8)
        The part that elimination adds for `SortedRays.pair`; two columns of padding.
    E : ndarray, shape (n_images, n_cameras, 6, 16)
        The same for image and interior orientation.
    I : ndarray, shape (n_cameras, n_cameras, 16, 16)
        The same for two interior orientations.
    g : ndarray, shape (n_images, 16)
        Right sides, of which each image's rays are a part, after elimination.
    cost : ndarray, shape (n_images,)
        Sum of squares of the residuals of each image's rays.
    """

    M: Array
    S: Array
    E: Array
    I: Array  # noqa: E741 (of Interior)
    g: Array
    cost: Array


def camera_normals(n_images: int, n_cameras: int, n_pairs: int) -> CameraNormals:
    """Return normal equations that are all zero."""
    return CameraNormals(
        M=aligned(n_images, 16, 16),
        S=aligned(n_pairs, 6, 8),
        E=aligned(n_images, n_cameras, 6, 16),
        I=aligned(n_cameras, n_cameras, 16, 16),
        g=aligned(n_images, 16),
        cost=aligned(n_images),
    )


# --- one point -------------------------------------------------------------------------------


class Room(NamedTuple):
    """Working arrays for the rays of one point.

    It is made outside compiled passes, which therefore count no references.

    Attributes
    ----------
    seen : Seen
        Its rays, linearised: derivatives by the camera, J, and by the point, B.
    T : ndarray, shape (3, 16)
        B^T J of a ray.
    Y, X : ndarray, shape (n, 3, 16)
        Products of T, one for each ray.
    sums, Y_sums, X_sums : ndarray, shape (n_cameras, 3, 16)
        T, Y and X summed over the rays of each camera.
    W, V_inv, C : ndarray, shape (3, 3)
        Of the normal matrix, the transposed inverse of its Cholesky factor, and the inverse;
        the covariance.
    P : ndarray, shape (n, 3, 2)
        Covariance of the point with each of its rays.
    S : ndarray, shape (3, 8)
        P B, summed over the rays, in the first three columns.
    z, s : ndarray, shapes (2, 16) and (3,)
        Of a ray, and of the point.
    """

    seen: Seen
    T: Array
    Y: Array
    X: Array
    sums: Array
    Y_sums: Array
    X_sums: Array
    W: Array
    V_inv: Array
    C: Array
    P: Array
    S: Array
    z: Array
    s: Array


def room_for(rays: SortedRays, first: int, last: int, n_cameras: int) -> Room:
    """Return working arrays for the point with the most rays."""
    n = int(np.diff(rays.start[first : last + 1]).max(initial=1))
    return Room(
        seen=Seen(J=aligned(n, 2, WIDTH), G=aligned(n, 2, WIDTH), U=aligned(n, 2, 2)),
        T=aligned(3, 16),
        Y=aligned(n, 3, 16),
        X=aligned(n, 3, 16),
        sums=aligned(n_cameras, 3, 16),
        Y_sums=aligned(n_cameras, 3, 16),
        X_sums=aligned(n_cameras, 3, 16),
        W=aligned(3, 3),
        V_inv=aligned(3, 3),
        C=aligned(3, 3),
        P=aligned(n, 3, 2),
        S=aligned(3, 8),
        z=aligned(2, 16),
        s=aligned(3),
    )


@uncounted_inlined
def _factor(rays: SortedRays, scene: Scene, p: int, room: Room) -> bool:
    """Fill W with L^-T of a point's damped normal matrix L L^T; False if that is open."""
    J, W, also, grown = room.seen.J, room.W, rays.also[p], 1 + scene.damping
    v00 = v01 = v02 = v11 = v12 = v22 = 0.0
    for k in range(rays.start[p + 1] - rays.start[p]):
        for row in range(2):
            x, y, z = J[k, row, POINT], J[k, row, POINT + 1], J[k, row, POINT + 2]
            v00, v01, v02 = v00 + x * x, v01 + x * y, v02 + x * z
            v11, v12, v22 = v11 + y * y, v12 + y * z, v22 + z * z
    if also >= 0:
        V = scene.V
        v00, v01, v02 = v00 + V[also, 0, 0], v01 + V[also, 0, 1], v02 + V[also, 0, 2]
        v11, v12, v22 = v11 + V[also, 1, 1], v12 + V[also, 1, 2], v22 + V[also, 2, 2]
    v00, v11, v22 = v00 * grown, v11 * grown, v22 * grown
    if not v00 > 0:
        return False
    a = 1 / np.sqrt(v00)
    l10, l20 = v01 * a, v02 * a
    d1 = v11 - l10 * l10
    if not d1 > 0:
        return False
    b = 1 / np.sqrt(d1)
    l21 = (v12 - l20 * l10) * b
    d2 = v22 - l20 * l20 - l21 * l21
    if not d2 > 0:
        return False
    c = 1 / np.sqrt(d2)
    W[0, 0], W[1, 1], W[2, 2] = a, b, c
    W[0, 1], W[1, 2] = -l10 * a * b, -l21 * b * c
    W[0, 2] = (l10 * l21 * b - l20) * a * c
    return True


@uncounted_inlined
def _eliminate(rays: SortedRays, p: int, room: Room, out: CameraNormals) -> float:
    """Subtract a point's part from the normal equations; return its own decrease of the cost."""
    J, T, Y, Y_sums = room.seen.J, room.T, room.Y, room.Y_sums
    W, s, start, n = room.W, room.s, rays.start[p], rays.start[p + 1] - rays.start[p]
    n_cameras = out.I.shape[0]
    s[2] = W[0, 2] * s[0] + W[1, 2] * s[1] + W[2, 2] * s[2]
    s[1] = W[0, 1] * s[0] + W[1, 1] * s[1]
    s[0] *= W[0, 0]
    for c in range(n_cameras):
        _whitened(Y_sums, c * 48, W, 0, room.sums, c * 48)
    for k in range(n):
        _point_by_ray(T, 0, J, k * 48 + POINT, J, k * 48)
        _whitened(Y, k * 48, W, 0, T, 0)
    for k in range(n):
        i = rays.image[start + k]
        _take_off_gradient(out.g, i * 16, s, 0, Y, k * 48)
        for j in range(k, n):
            d = rays.image[start + j] - i
            pair = rays.pair[i, d] * 48
            _take_off_pair(out.S, pair, Y, k * 48, Y, j * 48)
            if d == 0 and j > k:  # the point is measured twice in one image
                _take_off_pair(out.S, pair, Y, j * 48, Y, k * 48)
        for c in range(n_cameras):
            _take_off_border(out.E, (i * n_cameras + c) * 96, Y, k * 48, Y_sums, c * 48)
    for a in range(n_cameras):
        for b in range(n_cameras):
            _take_off_corner(out.I, (a * n_cameras + b) * 256, Y_sums, a * 48, Y_sums, b * 48)
    return s[0] * s[0] + s[1] * s[1] + s[2] * s[2]


# --- passes ----------------------------------------------------------------------------------


@uncounted
def accumulate(
    rays: SortedRays, scene: Scene, first: int, last: int, room: Room, out: CameraNormals
) -> tuple[bool, float]:
    """Add the normal equations of some points' rays, with the points eliminated.

    Parameters
    ----------
    rays, scene
    first, last : int
        The range of points.
    room : Room
    out : CameraNormals
        The sums to which they are added.

    Returns
    -------
    ahead : bool
        Whether every point is in front of its cameras.
    decrement : float
        Decrease of the cost, to first order, if only the points moved.
    """
    J, sums, s, decrement = room.seen.J, room.sums, room.s, 0.0
    for p in range(first, last):
        start, also = rays.start[p], rays.also[p]
        sums[:] = 0.0
        for c in range(3):
            s[c] = scene.h[also, c] if also >= 0 else 0.0
        if not linearise(rays, scene, p, room.seen):
            return False, 0.0
        for k in range(rays.start[p + 1] - start):
            i = rays.image[start + k]
            _add_squares(out.M, i * 256, J, k * 48, J, k * 48)
            _add_gradient(out.g, i * 16, J, k * 48 + RESIDUAL, J, k * 48)
            _add_point_by_ray(sums, scene.camera[i] * 48, J, k * 48 + POINT, J, k * 48)
            a, b = J[k, 0, RESIDUAL], J[k, 1, RESIDUAL]
            out.cost[i] += a * a + b * b
            for c in range(3):
                s[c] += J[k, 0, POINT + c] * a + J[k, 1, POINT + c] * b
        if rays.free[p] and _factor(rays, scene, p, room):
            decrement += _eliminate(rays, p, room, out)
    return True, decrement


@uncounted
def move_points(
    rays: SortedRays, scene: Scene, first: int, last: int, room: Room, step: Array, out: Array
) -> None:
    """Fill in the steps of some points that follow from the steps of the cameras.

    Parameters
    ----------
    rays, scene
    first, last : int
        The range of points.
    room : Room
    step : ndarray, shape (n_images, 16)
        Steps of camera pose and interior orientation.
    out : ndarray, shape (n, 3)
        All points of the block.
    """
    J, W, s = room.seen.J, room.W, room.s
    for p in range(first, last):
        if not rays.free[p]:
            continue
        also, start, at = rays.also[p], rays.start[p], rays.point[p]
        for c in range(3):
            s[c] = scene.h[also, c] if also >= 0 else 0.0
        linearise(rays, scene, p, room.seen)
        for k in range(rays.start[p + 1] - start):
            i = rays.image[start + k]
            a = _dot_16(J, k * 48, step, i * 16) + J[k, 0, RESIDUAL]
            b = _dot_16(J, k * 48 + WIDTH, step, i * 16) + J[k, 1, RESIDUAL]
            for c in range(3):
                s[c] += J[k, 0, POINT + c] * a + J[k, 1, POINT + c] * b
        if _factor(rays, scene, p, room):
            a, b = W[0, 0] * s[0], W[0, 1] * s[0] + W[1, 1] * s[1]
            c = W[0, 2] * s[0] + W[1, 2] * s[1] + W[2, 2] * s[2]
            out[at, 0] = -(W[0, 0] * a + W[0, 1] * b + W[0, 2] * c)
            out[at, 1] = -(W[1, 1] * b + W[1, 2] * c)
            out[at, 2] = -W[2, 2] * c


load(accumulate, move_points)


# --- covariances of points, redundancy numbers of rays ----------------------------------------


# products with V^-1 times a point's derivatives
_gain = _small(3, 3, 16, left=(3, 1), right=16, out=16)
_take_off_by_pose = _small(3, 6, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_by_interior = _small(3, 10, 8, left=(16, 1), right=8, out=16, add=-1)
_take_off_interior_by_pose = _small(3, 6, 16, left=(16, 1), right=16, out=16, add=-1)
_take_off_interior = _small(3, 10, 16, left=(16, 1), right=16, out=16, add=-1)
_ray_times_square = _small(2, 16, 16, left=(WIDTH, 1), right=16, out=16)
_add_ray_by_point = _small(3, 2, 8, left=(2, 1), right=WIDTH, out=8, add=1)


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
        _point_by_ray(T, 0, room.seen.J, k * 48 + POINT, room.seen.J, k * 48)
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
                by_pose = _dot_16(X, k * 48 + a * 16, J, at)
                P[k, a, row] = by_pose + _dot_16(X_sums, camera * 48 + a * 16, J, at)
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
            _add_point_by_ray(room.sums, camera * 48, J, k * 48 + POINT, J, k * 48)
        if rays.free[p]:
            if _factor(rays, scene, p, room):
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
                total = _dot_16(z, row * 16, J, k * 48 + row * WIDTH)
                for a in range(3):
                    total += 2 * J[k, row, POINT + a] * P[k, a, row]
                    for b in range(3):
                        total += J[k, row, POINT + a] * C[a, b] * J[k, row, POINT + b]
                out.v[at, row] = J[k, row, RESIDUAL]
                out.redundancy[at, row] = 1 - total


load(precision)
