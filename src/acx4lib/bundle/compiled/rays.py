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
from acx4lib.geometry.collinearity import MOST_STEPS, NEAR_MM
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


@inlined
def _by_point(interior: Array, camera: int, x: float, y: float) -> tuple[float, float, float]:
    """Return d(x)/dx, d(y)/dy and d(x)/dy = d(y)/dx of a corrected point, `camera.correct`."""
    k1, k2, k3 = interior[camera, 3], interior[camera, 4], interior[camera, 5]
    p1, p2, r2 = interior[camera, 6], interior[camera, 7], x * x + y * y
    left = 1 - r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
    return (
        left - x * x * slope - 6 * p1 * x - 2 * p2 * y,
        left - y * y * slope - 6 * p2 * y - 2 * p1 * x,
        -x * y * slope - 2 * p1 * y - 2 * p2 * x,
    )


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
    x, y = rays.xy[q, 0] * stretch - xp, rays.xy[q, 1] - yp
    xx, yy, xy = _by_point(interior, camera, x, y)
    k1, k2, k3 = interior[camera, 3], interior[camera, 4], interior[camera, 5]
    p1, p2, r2 = interior[camera, 6], interior[camera, 7], x * x + y * y
    left = 1 - r2 * (k1 + r2 * (k2 + r2 * k3))
    ex = -f * u - x * left + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    ey = -f * v - y * left + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    s, a, b, c, d = 1 / stretch, w, 0.0, 0.0, w  # of d(residual) / d(ideal point) / sigma
    v0, v1, x_0, y_0, reached = w * ex, w * ey, x, y, False
    for _ in range(MOST_STEPS if scene.adjusted else 0):  # `collinearity` has the same steps
        det = xx * yy - xy * xy
        if not (det > 0 and xx + yy > 0):
            break
        vx, vy = (yy * ex - xy * ey) / det, (xx * ey - xy * ex) / det
        x, y = x + vx, y + vy
        xx, yy, xy = _by_point(interior, camera, x, y)
        if vx * vx * s * s + vy * vy < NEAR_MM * NEAR_MM:
            reached = True
            break
        r2 = x * x + y * y
        left = 1 - r2 * (k1 + r2 * (k2 + r2 * k3))
        ex = -f * u - x * left + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
        ey = -f * v - y * left + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    if reached:
        v0, v1 = w * s * (x - x_0), w * (y - y_0)
        det = w / (xx * yy - xy * xy)
        a, b, c, d = yy * det * s, -xy * det * s, -xy * det, xx * det
    elif scene.adjusted:  # no image there: the correction at the measured point
        x, y = x_0, y_0
        xx, yy, xy = _by_point(interior, camera, x, y)
    r2 = x * x + y * y
    # these are applied to ray and point
    au, cu, ax, cx = a * u + b * v, c * u + d * v, a * x + b * y, c * x + d * y
    by_xp_0, by_xp_1 = a * xx + b * xy, c * xx + d * xy
    m, r4, x_raw = -f * down, r2 * r2, (x + xp) * s
    J[k, 0, 0], J[k, 0, 1], J[k, 0, 2] = -m * a, -m * b, m * au
    J[k, 1, 0], J[k, 1, 1], J[k, 1, 2] = -m * c, -m * d, m * cu
    J[k, 0, 3], J[k, 0, 4], J[k, 0, 5] = -f * (b + v * au), f * (a + u * au), f * (b * u - a * v)
    J[k, 1, 3], J[k, 1, 4], J[k, 1, 5] = -f * (d + v * cu), f * (c + u * cu), f * (d * u - c * v)
    J[k, 0, 6], J[k, 0, 7], J[k, 0, 8] = -au, by_xp_0, a * xy + b * yy
    J[k, 1, 6], J[k, 1, 7], J[k, 1, 8] = -cu, by_xp_1, c * xy + d * yy
    J[k, 0, 9], J[k, 0, 10], J[k, 0, 11] = ax * r2, ax * r4, ax * r4 * r2
    J[k, 1, 9], J[k, 1, 10], J[k, 1, 11] = cx * r2, cx * r4, cx * r4 * r2
    J[k, 0, 12], J[k, 0, 13] = a * r2 + 2 * x * ax, b * r2 + 2 * y * ax
    J[k, 1, 12], J[k, 1, 13] = c * r2 + 2 * x * cx, d * r2 + 2 * y * cx
    J[k, 0, 14], J[k, 0, 15] = -by_xp_0 * x_raw, v0
    J[k, 1, 14], J[k, 1, 15] = -by_xp_1 * x_raw, v1
    a, b, c, d, au, cu = m * a, m * b, m * c, m * d, m * au, m * cu
    B[k, 0, 0], B[k, 1, 0] = a * r00 + b * r01 - au * r02, c * r00 + d * r01 - cu * r02
    B[k, 0, 1], B[k, 1, 1] = a * r10 + b * r11 - au * r12, c * r10 + d * r11 - cu * r12
    B[k, 0, 2], B[k, 1, 2] = a * r20 + b * r21 - au * r22, c * r20 + d * r21 - cu * r22
    return True
