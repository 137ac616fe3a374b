"""Consensus by epipolar geometry: both rays of a point lie in one plane with both cameras."""

from __future__ import annotations

import numpy as np

from acx4lib.expected import Array, Mask
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4tools.measuring.pictures.views import View

ENOUGH = 12
"""Points by which the trend of their distances can be told from false matches."""

SIGMAS = 4.0
_ROUNDS = 8
_LEAST_BASE = 0.02  # of the distance to the ground; without a base every ray is in one plane


def distances(a: View, b: View, colrow_a: Array, colrow_b: Array) -> Array:
    """Return the distances of points from their epipolar lines, px of picture b, shape (n, 2).

    The second column is zero, unless the two pictures have no base: then the two rays should be
    parallel, and both columns are components of the angle between them.
    """
    ray_a, ray_b = (_rays(view, colrow) for view, colrow in ((a, colrow_a), (b, colrow_b)))
    base = b.T_m_c.r[0] - a.T_m_c.r[0]
    px = b.camera.interior.f / b.camera.pixel_mm
    high = max(abs(float(a.T_m_c.r[0, 2])), 1.0)
    if np.linalg.norm(base) < _LEAST_BASE * high:
        apart = (ray_b - ray_a) @ b.T_m_c.R[0]
        return np.asarray(px * apart[:, :2])
    normal = np.cross(base, ray_a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    across = px * np.sum(normal * ray_b, axis=1)
    return np.column_stack([across, np.zeros_like(across)])


def agree(a: View, b: View, colrow_a: Array, colrow_b: Array, *, least_px: float) -> Mask:
    """Tell which matches of a pair agree on an epipolar geometry, shape (n,).

    Errors of the orientations change the distances from the epipolar lines smoothly over the
    picture; a false match leaves this trend. A cubic polynomial takes it up, with the lens's part.

    Parameters
    ----------
    a, b : View
    colrow_a, colrow_b : ndarray, shape (n, 2)
    least_px : float
        A distance that is always allowed.
    """
    n = len(colrow_a)
    if n < ENOUGH:
        return np.zeros(n, dtype=bool)
    off = distances(a, b, colrow_a, colrow_b)
    size = np.array([a.camera.width_px, a.camera.height_px])
    x, y = (2 * colrow_a / size - 1).T
    degree = 3 if n > 60 else 2 if n > 25 else 1
    A = np.column_stack([x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)])
    weight = np.ones(n)
    left = off - np.median(off, axis=0)
    for _ in range(_ROUNDS):
        size_of = np.hypot(*left.T)
        scatter = max(1.4826 * float(np.median(size_of)), least_px / SIGMAS)
        weight = 1 / (1 + (size_of / (2 * scatter)) ** 2)  # Cauchy's
        WA = A * np.square(weight)[:, None]
        left = off - A @ np.linalg.lstsq(WA.T @ A, WA.T @ off, rcond=None)[0]
    near: Mask = np.hypot(*left.T) <= max(least_px, SIGMAS * scatter)
    return near if near.sum() >= max(ENOUGH, n / 3) else np.zeros(n, dtype=bool)


def _rays(view: View, colrow: Array) -> Array:
    one = Pose(R=np.broadcast_to(view.T_m_c.R[:1], (len(colrow), 3, 3)), r=view.T_m_c.r[:1])
    return rays(view.camera, one, np.asarray(colrow, float))
