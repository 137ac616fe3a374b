"""Measured rays and their derivatives, compiled.

A camera pose varies by its position and by a rotation, both along the *camera's own* axes. Then
the derivatives of an image point by its pose depend on its direction only. A ray has two rows,
along x and y, of sixteen numbers: six derivatives by the pose, nine by the interior orientation
(`camera.INTERIOR`), and the residual, all divided by the standard deviation. The plain version
is `collinearity.image_derivatives`.
"""

from __future__ import annotations

from typing import NamedTuple

from acx4lib.compiling import inlined
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.refraction import DENSITY, LAPSE, REFRACTIVITY

INTERIOR, RESIDUAL = 6, 15
"""Positions, in a ray's row, of the first interior parameter and of the residual."""


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
    """

    start: Index
    point: Index
    free: Mask
    also: Index
    row: Index
    image: Index
    xy: Array
    weight: Array


class Scene(NamedTuple):
    """A state of the unknowns.

    Attributes
    ----------
    R_m_c : ndarray, shape (n_images, 3, 3)
    r_m_c : ndarray, shape (n_images, 3)
        m.
    camera : ndarray, shape (n_images,)
    interior : ndarray, shape (n_cameras, 9)
    x_m : ndarray, shape (n_points, 3)
        m, in the order of the rays' points.
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


@inlined
def _appears_at(scene: Scene, i: int, p: int) -> float:
    """Return the apparent height of a point, by `refraction.refraction_lift`."""
    height, z = scene.r_m_c[i, 2], scene.x_m[p, 2]
    dx, dy = scene.x_m[p, 0] - scene.r_m_c[i, 0], scene.x_m[p, 1] - scene.r_m_c[i, 1]
    dz = z - height
    camera, ground = 1 - LAPSE * height, 1 - LAPSE * z
    integral = (ground ** (DENSITY + 1) - camera ** (DENSITY + 1)) / (LAPSE * (DENSITY + 1))
    K = REFRACTIVITY * (integral / -dz - camera**DENSITY)
    return z - K * (dx * dx + dy * dy + dz * dz) / dz


class Corrected(NamedTuple):
    """An image point free of distortion, mm, and its symmetric derivatives by the measured one."""

    x: float
    y: float
    xx: float
    yy: float
    xy: float


@inlined
def _corrected(interior: Array, camera: int, x: float, y: float) -> Corrected:
    """Correct a point relative to the principal point, as `camera.correct` does."""
    k1, k2, k3 = interior[camera, 3], interior[camera, 4], interior[camera, 5]
    p1, p2 = interior[camera, 6], interior[camera, 7]
    r2 = x * x + y * y
    left = 1 - r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
    return Corrected(
        x * left - p1 * (r2 + 2 * x * x) - 2 * p2 * x * y,
        y * left - p2 * (r2 + 2 * y * y) - 2 * p1 * x * y,
        left - x * x * slope - 6 * p1 * x - 2 * p2 * y,
        left - y * y * slope - 6 * p2 * y - 2 * p1 * x,
        -x * y * slope - 2 * p1 * y - 2 * p2 * x,
    )


class ByMisclosure(NamedTuple):
    """Derivatives of a residual, over its sigma, by projected minus corrected point."""

    xx: float
    xy: float
    yx: float
    yy: float


@inlined
def _put(M: Array, k: int, column: int, by: ByMisclosure, x: float, y: float) -> None:
    """Fill a column of M[k] with the derivatives of a residual, given those of the misclosure."""
    M[k, 0, column] = by.xx * x + by.xy * y
    M[k, 1, column] = by.yx * x + by.yy * y


@inlined
def linearise(rays: SortedRays, scene: Scene, p: int, q: int, J: Array, B: Array, k: int) -> bool:
    """Fill J[k], B[k] with ray q's derivatives by camera and point p; False if p is behind it."""
    i = rays.image[q]
    R, x_m, r_m_c = scene.R_m_c, scene.x_m, scene.r_m_c  # no slices: references are counted
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
    stretch = 1 + interior[camera, 8]
    x_i, y_i = rays.xy[q, 0] * stretch - xp, rays.xy[q, 1] - yp
    at = _corrected(interior, camera, x_i, y_i)
    x, y, by = x_i, y_i, ByMisclosure(w, 0.0, 0.0, w)
    if scene.adjusted:  # two steps of Newton's method, derivatives between them
        ex, ey, d = -f * u - at.x, -f * v - at.y, at.xx * at.yy - at.xy * at.xy
        x += (at.yy * ex - at.xy * ey) / d
        y += (at.xx * ey - at.xy * ex) / d
        at = _corrected(interior, camera, x, y)
        d = w / (at.xx * at.yy - at.xy * at.xy)
        by = ByMisclosure(at.yy * d / stretch, -at.xy * d / stretch, -at.xy * d, at.xx * d)
    m, r2, x_raw = -f * down, x * x + y * y, (x + xp) / stretch
    _put(J, k, 0, by, -m, 0.0)
    _put(J, k, 1, by, 0.0, -m)
    _put(J, k, 2, by, m * u, m * v)
    _put(J, k, 3, by, -f * u * v, -f * (1 + v * v))
    _put(J, k, 4, by, f * (1 + u * u), f * u * v)
    _put(J, k, 5, by, -f * v, f * u)
    _put(J, k, 6, by, -u, -v)
    _put(J, k, 7, by, at.xx, at.xy)
    _put(J, k, 8, by, at.xy, at.yy)
    _put(J, k, 9, by, x * r2, y * r2)
    _put(J, k, 10, by, x * r2 * r2, y * r2 * r2)
    _put(J, k, 11, by, x * r2 * r2 * r2, y * r2 * r2 * r2)
    _put(J, k, 12, by, r2 + 2 * x * x, 2 * x * y)
    _put(J, k, 13, by, 2 * x * y, r2 + 2 * y * y)
    _put(J, k, 14, by, -at.xx * x_raw, -at.xy * x_raw)
    _put(J, k, 15, by, -f * u - at.x, -f * v - at.y)
    J[k, 0, 15] += (x - x_i) * w / stretch
    J[k, 1, 15] += (y - y_i) * w
    _put(B, k, 0, by, m * (r00 - u * r02), m * (r01 - v * r02))
    _put(B, k, 1, by, m * (r10 - u * r12), m * (r11 - v * r12))
    _put(B, k, 2, by, m * (r20 - u * r22), m * (r21 - v * r22))
    return True
