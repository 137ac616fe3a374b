"""Measured rays and their derivatives, compiled.

A camera pose varies by its position and by a rotation, both along the *camera's own* axes. Then
the derivatives of an image point by its pose depend on its direction only. A ray has two rows,
along x and y: six derivatives by the pose, ten by the interior orientation (`camera.INTERIOR`),
three by the point, and the residual, all divided by the standard deviation. The plain version is
`collinearity.image_derivatives`.
"""

from __future__ import annotations

from typing import NamedTuple

from acx4lib.bundle.compiled.small_products import SmallProduct
from acx4lib.compiling import uncounted_inlined
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.collinearity import (
    DENSITY,
    LAPSE,
    MOST_STEPS,
    NEAR_F_MM,
    NEAR_MM,
    REFRACTIVITY,
)

INTERIOR, POINT, RESIDUAL, WIDTH = 6, 16, 19, 24
"""In a ray's row: positions of the first interior parameter, of the first derivative by the point
and of the residual; and its length, which is a multiple of eight."""


class SortedRays(NamedTuple):
    """Measured rays, sorted by point and, within a point, by image.

    Attributes
    ----------
    start : ndarray, shape (n_points + 1,)
        Index of each point's first ray.
    point : ndarray, shape (n_points,)
        Indices of the points in the block.
    free : ndarray, shape (n_points,)
        Which points are unknowns.
    also : ndarray, shape (n_points,)
        Indices of the points in `Scene.V` and `Scene.h`; -1 for a point that is not there.
    row : ndarray, shape (n,)
        Index of each ray among the block's measurements.
    image : ndarray, shape (n,)
    xy : ndarray, shape (n, 2)
        Measured, mm.
    weight : ndarray, shape (n,)
        Reciprocal standard deviation, 1/mm.
    pair : ndarray, shape (n_images, band)
        Number of images i and i + d among the pairs that share points; -1 where they share none.
    """

    start: Index
    point: Index
    free: Mask
    also: Index
    row: Index
    image: Index
    xy: Array
    weight: Array
    pair: Index


class Scene(NamedTuple):
    """A state of the unknowns.

    Attributes
    ----------
    R_m_c : ndarray, shape (n_images, 3, 3)
    r_m_c : ndarray, shape (n_images, 3)
        m.
    camera : ndarray, shape (n_images,)
    interior : ndarray, shape (n_cameras, 10)
    x_m : ndarray, shape (n_points, 3)
        m, in the order of the rays: a pass does not wait for memory.
    V, h : ndarray, shapes (k, 3, 3) and (k, 3)
        Normal equations of some points from other observations.
    refraction : bool
        Whether rays bend in the standard atmosphere.
    adjusted : bool
        Whether distortion is that of the adjusted points, not of the measured ones.
    damping : float
        Added to the diagonal of the points' normal equations, as a share of it.
    """

    R_m_c: Array
    r_m_c: Array
    camera: Index
    interior: Array
    x_m: Array
    V: Array
    h: Array
    refraction: bool
    adjusted: bool
    damping: float


class Seen(NamedTuple):
    """The rays of one point, linearised.

    Attributes
    ----------
    J : ndarray, shape (n, 2, WIDTH)
        Rows of the measured image, in standard deviations.
    G : ndarray, shape (n, 2, WIDTH)
        Rows of the corrected image, mm.
    U : ndarray, shape (n, 2, 2)
        d(measured point, in standard deviations) / d(corrected point, mm): J is U G.
    """

    J: Array
    G: Array
    U: Array


@uncounted_inlined
def _appears_at(scene: Scene, i: int, p: int) -> float:
    """Return the apparent height of a point, by `collinearity.refraction_lift`."""
    height, z = scene.r_m_c[i, 2], scene.x_m[p, 2]
    dx, dy = scene.x_m[p, 0] - scene.r_m_c[i, 0], scene.x_m[p, 1] - scene.r_m_c[i, 1]
    dz = z - height
    camera, ground = 1 - LAPSE * height, 1 - LAPSE * z
    integral = (ground ** (DENSITY + 1) - camera ** (DENSITY + 1)) / (LAPSE * (DENSITY + 1))
    K = REFRACTIVITY * (integral / -dz - camera**DENSITY)
    return z - K * (dx * dx + dy * dy + dz * dz) / dz


@uncounted_inlined
def _corrected(interior: Array, camera: int, x: float, y: float) -> tuple[float, ...]:
    """Return a point corrected, and d(x)/dx, d(y)/dy and d(x)/dy = d(y)/dx: `camera.correct`."""
    k1, k2, k3 = interior[camera, 3], interior[camera, 4], interior[camera, 5]
    p1, p2, r2 = interior[camera, 6], interior[camera, 7], x * x + y * y
    left = 1 - r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
    return (
        x * left - p1 * (r2 + 2 * x * x) - 2 * p2 * x * y,
        y * left - p2 * (r2 + 2 * y * y) - 2 * p1 * x * y,
        left - x * x * slope - 6 * p1 * x - 2 * p2 * y,
        left - y * y * slope - 6 * p2 * y - 2 * p1 * x,
        -x * y * slope - 2 * p1 * y - 2 * p2 * x,
    )


@uncounted_inlined
def _adjusted(
    interior: Array, camera: int, x: float, y: float, x_ideal: float, y_ideal: float
) -> tuple[float, float, bool]:
    """Return where the corrected point is the ideal one, and whether that was reached.

    The steps are those of `collinearity`.
    """
    s, shear = 1 / (1 + interior[camera, 8]), interior[camera, 9]
    near = NEAR_MM * min(1.0, interior[camera, 0] / NEAR_F_MM) ** 2
    for _ in range(MOST_STEPS):
        x_c, y_c, xx, yy, xy = _corrected(interior, camera, x, y)
        ex, ey, det = x_ideal - x_c, y_ideal - y_c, xx * yy - xy * xy
        if not (det > 0 and xx + yy > 0):
            break
        vx, vy = (yy * ex - xy * ey) / det, (xx * ey - xy * ex) / det
        x, y = x + vx, y + vy
        along = (vx - shear * vy) * s
        if along * along + vy * vy < near * near:
            return x, y, True
    return x, y, False


@uncounted_inlined
def _look(rays: SortedRays, scene: Scene, p: int, q: int, seen: Seen, k: int) -> bool:
    """Fill G[k] and U[k] for ray q to point p; False if that is behind the camera."""
    i, G, U = rays.image[q], seen.G, seen.U
    R, x_m, r_m_c = scene.R_m_c, scene.x_m, scene.r_m_c
    z_m = _appears_at(scene, i, p) if scene.refraction else x_m[p, 2]
    dx, dy, dz = x_m[p, 0] - r_m_c[i, 0], x_m[p, 1] - r_m_c[i, 1], z_m - r_m_c[i, 2]
    r00, r01, r02 = R[i, 0, 0], R[i, 0, 1], R[i, 0, 2]
    r10, r11, r12 = R[i, 1, 0], R[i, 1, 1], R[i, 1, 2]
    r20, r21, r22 = R[i, 2, 0], R[i, 2, 1], R[i, 2, 2]
    z_c = r02 * dx + r12 * dy + r22 * dz
    if not z_c < 0:
        return False
    down = 1 / z_c
    u = (r00 * dx + r10 * dy + r20 * dz) * down
    v = (r01 * dx + r11 * dy + r21 * dz) * down
    camera, interior, w = scene.camera[i], scene.interior, rays.weight[q]
    f, xp, yp = interior[camera, 0], interior[camera, 1], interior[camera, 2]
    s, shear = 1 / (1 + interior[camera, 8]), interior[camera, 9]
    x_0 = rays.xy[q, 0] * (1 + interior[camera, 8]) + shear * rays.xy[q, 1] - xp
    y_0 = rays.xy[q, 1] - yp
    x, y, reached = x_0, y_0, False
    if scene.adjusted:
        x, y, reached = _adjusted(interior, camera, x_0, y_0, -f * u, -f * v)
        if not reached:  # no image there: the correction at the measured point
            x, y = x_0, y_0
    x_c, y_c, xx, yy, xy = _corrected(interior, camera, x, y)
    if reached:
        det = w / (xx * yy - xy * xy)
        U[k, 0, 0], U[k, 0, 1] = (yy + shear * xy) * det * s, -(xy + shear * xx) * det * s
        U[k, 1, 0], U[k, 1, 1] = -xy * det, xx * det
        G[k, 0, RESIDUAL], G[k, 1, RESIDUAL] = (
            xx * (x - x_0) + xy * (y - y_0),
            xy * (x - x_0) + yy * (y - y_0),
        )
    else:
        U[k, 0, 0], U[k, 0, 1], U[k, 1, 0], U[k, 1, 1] = w, 0.0, 0.0, w
        G[k, 0, RESIDUAL], G[k, 1, RESIDUAL] = -f * u - x_c, -f * v - y_c
    m, y_i, r2 = -f * down, y + yp, x * x + y * y
    x_i = (x + xp - shear * y_i) * s
    r4 = r2 * r2
    G[k, 0, 0], G[k, 0, 1], G[k, 0, 2] = -m, 0.0, m * u
    G[k, 1, 0], G[k, 1, 1], G[k, 1, 2] = 0.0, -m, m * v
    G[k, 0, 3], G[k, 0, 4], G[k, 0, 5] = -f * u * v, f * (1 + u * u), -f * v
    G[k, 1, 3], G[k, 1, 4], G[k, 1, 5] = -f * (1 + v * v), f * u * v, f * u
    G[k, 0, 6], G[k, 0, 7], G[k, 0, 8] = -u, xx, xy
    G[k, 1, 6], G[k, 1, 7], G[k, 1, 8] = -v, xy, yy
    G[k, 0, 9], G[k, 0, 10], G[k, 0, 11] = x * r2, x * r4, x * r4 * r2
    G[k, 1, 9], G[k, 1, 10], G[k, 1, 11] = y * r2, y * r4, y * r4 * r2
    G[k, 0, 12], G[k, 0, 13], G[k, 0, 14] = r2 + 2 * x * x, 2 * x * y, -xx * x_i
    G[k, 1, 12], G[k, 1, 13], G[k, 1, 14] = 2 * x * y, r2 + 2 * y * y, -xy * x_i
    G[k, 0, 15], G[k, 1, 15] = -xx * y_i, -xy * y_i
    G[k, 0, 16], G[k, 1, 16] = m * (r00 - u * r02), m * (r01 - v * r02)
    G[k, 0, 17], G[k, 1, 17] = m * (r10 - u * r12), m * (r11 - v * r12)
    G[k, 0, 18], G[k, 1, 18] = m * (r20 - u * r22), m * (r21 - v * r22)
    return True


_measured_from_corrected = SmallProduct(
    rows=2, inner=2, width=WIDTH, left=(2, 1), right=WIDTH, out=WIDTH
).compiled()


@uncounted_inlined
def linearise(rays: SortedRays, scene: Scene, p: int, seen: Seen) -> bool:
    """Fill in the rows of point p's rays; False if it is behind a camera."""
    start, n = rays.start[p], rays.start[p + 1] - rays.start[p]
    for k in range(n):
        if not _look(rays, scene, p, start + k, seen, k):
            return False
    # apart, since numbers written one by one take a while until eight can be read at once
    for k in range(n):
        _measured_from_corrected(seen.J, k * 2 * WIDTH, seen.U, k * 4, seen.G, k * 2 * WIDTH)
    return True
