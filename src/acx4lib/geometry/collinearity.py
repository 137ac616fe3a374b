"""Collinearity: the paper's eqs (1)-(5), and eq. (14) as the chain of two poses.

A camera pose has six unknowns: the perspective centre in the mapping frame, m, and a small
rotation about the *camera's* axes, ``R_m_c <- R_m_c exp(delta)``, rad.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import (
    INTERIOR,
    Camera,
    Interior,
    colrow_from_xy,
    correct,
    correct_by_point,
    correct_jacobian,
    distort,
    newton_step,
    xy_from_colrow,
)
from acx4lib.geometry.frames import Pose, skew, transform


def to_camera(T_m_c: Pose, x_m: Array) -> Array:
    """Return points in camera axes: (Dx, Dy, Dz) of eqs (3)-(5).

    Parameters
    ----------
    T_m_c : Pose
        One camera pose per point.
    x_m : ndarray, shape (n, 3)
        m.

    Returns
    -------
    x_c : ndarray, shape (n, 3)
        m; z is negative in front of the camera.
    """
    return np.einsum("nji,nj->ni", T_m_c.R, x_m - T_m_c.r)


def to_camera_jacobian(T_m_c: Pose, x_c: Array) -> tuple[Array, Array]:
    """Return the derivatives of `to_camera` by the camera pose and by the point.

    Parameters
    ----------
    T_m_c : Pose
    x_c : ndarray, shape (n, 3)
        The value of `to_camera`.

    Returns
    -------
    by_pose : ndarray, shape (n, 3, 6)
    by_point : ndarray, shape (n, 3, 3)
    """
    R_c_m = np.swapaxes(T_m_c.R, -1, -2)
    return np.concatenate([-R_c_m, skew(x_c)], axis=-1), R_c_m


def pinhole(f: Array | float, x_c: Array) -> Array:
    """Return ideal image points, the right sides of eqs (1)-(2): -f Dx/Dz, -f Dy/Dz.

    Parameters
    ----------
    f : float or ndarray, shape (n,)
        Focal length, mm.
    x_c : ndarray, shape (n, 3)
        Camera axes, m.

    Returns
    -------
    ndarray, shape (n, 2)
        mm from the principal point; NaN at and behind the camera.
    """
    z = np.where(x_c[:, 2] < 0, x_c[:, 2], np.nan)
    return -np.reshape(f, (-1, 1)) * x_c[:, :2] / z[:, None]


def pinhole_jacobian(f: Array | float, x_c: Array) -> Array:
    """Return d(pinhole) / d(x_c), shape (n, 2, 3), mm per m."""
    scale = -np.asarray(f) / x_c[:, 2]
    out = np.zeros((len(x_c), 2, 3))
    out[:, 0, 0] = out[:, 1, 1] = scale
    out[:, :, 2] = -scale[:, None] * x_c[:, :2] / x_c[:, 2:]
    return out


def mounted_jacobian(T_m_b: Pose, T_b_c: Pose) -> tuple[Array, Array]:
    """Return the derivatives of the camera pose ``T_m_b @ T_b_c`` (eq. 14) by its two factors.

    Parameters
    ----------
    T_m_b : Pose
        n body poses, varied by position in m and a rotation about the body's axes.
    T_b_c : Pose
        n mountings, varied by the lever arm in b and a rotation about the camera's axes.

    Returns
    -------
    by_body, by_mount : ndarray, shape (n, 6, 6)
    """
    by_body = np.zeros((len(T_m_b), 6, 6))
    by_body[:, :3, :3] = np.eye(3)
    by_body[:, :3, 3:] = -T_m_b.R @ skew(T_b_c.r)
    by_body[:, 3:, 3:] = np.swapaxes(T_b_c.R, -1, -2)
    by_mount = np.zeros((len(T_m_b), 6, 6))
    by_mount[:, :3, :3] = T_m_b.R
    by_mount[:, 3:, 3:] = np.eye(3)
    return by_body, by_mount


def project(camera: Camera, T_m_c: Pose, x_m: Array) -> Array:
    """Return the pixel coordinates of points: eqs (1)-(11), solved for the measured point.

    Parameters
    ----------
    camera : Camera
    T_m_c : Pose
        One camera pose per point.
    x_m : ndarray, shape (n, 3)
        m.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Pixels, also outside the sensor; NaN behind the camera or outside the lens model.

    Raises
    ------
    ValueError
        For points of another shape, or if the number of poses is neither one nor n.
    """
    x_m = expected.numbers("x_m", x_m, ("n", 3))
    if len(T_m_c.R) != 1:  # a single pose serves all points
        expected.shape("T_m_c.R", T_m_c.R, (len(x_m), 3, 3))
    ideal = pinhole(camera.interior.f, to_camera(T_m_c, x_m))
    colrow = np.full((len(x_m), 2), np.nan)
    ahead = np.isfinite(ideal[:, 0])
    colrow[ahead] = colrow_from_xy(camera, distort(camera.interior, ideal[ahead]))
    return colrow


def rays(camera: Camera, T_m_c: Pose, colrow: Array) -> Array:
    """Return unit vectors in the mapping frame from the camera towards measured points.

    Parameters
    ----------
    camera : Camera
    T_m_c : Pose
        One camera pose per measurement.
    colrow : ndarray, shape (n, 2)
        Pixels.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    colrow = expected.numbers("colrow", colrow, ("n", 2))
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow))
    ray_c = np.column_stack([ideal, np.full(len(ideal), -camera.interior.f)])
    return transform(T_m_c.R, ray_c / np.linalg.norm(ray_c, axis=1, keepdims=True))


DISTORTION_AT = ("adjusted", "measured")
"""Points at which an adjustment evaluates Brown's correction: adjusted, or as measured."""

NEAR_MM, NEAR_F_MM, MOST_STEPS = 0.01, 50.0, 10
"""The length of a step of Newton's method that is the last one, for lenses of this focal length and
above, and the largest number of steps. Distortion bends with the square of the inverse focal
length: residuals of a strong short lens would else contradict their derivatives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurement:
    """Measured image points with the camera and the pose of each.

    Attributes
    ----------
    cameras : tuple of Camera
    camera_idx : ndarray, shape (n,)
    T_m_c : Pose
        n camera poses.
    colrow : ndarray, shape (n, 2)
        Pixels.
    distortion_at : str
        One of `DISTORTION_AT`, see `image_residuals`.

    Raises
    ------
    ValueError
        For another value of `distortion_at`.
    """

    cameras: tuple[Camera, ...]
    camera_idx: Index
    T_m_c: Pose
    colrow: Array
    distortion_at: str = "adjusted"

    def __post_init__(self) -> None:
        expected.one_of("distortion_at", self.distortion_at, DISTORTION_AT)

    def by_camera(self) -> Iterator[tuple[Camera, Mask, Array]]:
        """Yield each camera, the mask of its measurements, and these measurements in mm."""
        for k, camera in enumerate(self.cameras):
            of_camera = self.camera_idx == k
            yield camera, of_camera, xy_from_colrow(camera, self.colrow[of_camera])

    @property
    def px_per_mm(self) -> Array:
        """Pixels per mm along x and y, shape (n, 2); negative for y, as rows count downwards."""
        pixel_mm = np.array([camera.pixel_mm for camera in self.cameras])[self.camera_idx]
        return np.array([1.0, -1.0]) / pixel_mm[:, None]

    @property
    def f(self) -> Array:
        """Focal lengths, shape (n,), mm."""
        return np.array([camera.interior.f for camera in self.cameras])[self.camera_idx]


def directions(seen: Measurement) -> Array:
    """Return the unit rays of measurements, shape (n, 3), mapping frame."""
    out = np.zeros((len(seen.colrow), 3))
    for k, camera in enumerate(seen.cameras):
        of_camera = seen.camera_idx == k
        out[of_camera] = rays(camera, seen.T_m_c[of_camera], seen.colrow[of_camera])
    return out


def image_residuals(seen: Measurement, x_m: Array) -> Array:
    """Return the image residuals of eqs (1)-(11), estimated minus observed.

    Brown's correction holds at the error-free point. So the estimate is the point at which the
    equations hold, with the distortion there. With the correction at the noisy measured point
    instead, the coefficients go along with the noise, and are biased by its square. This is the
    way of many programs, ``distortion_at="measured"``: projected minus corrected measured points.

    Parameters
    ----------
    seen : Measurement
    x_m : ndarray, shape (n, 3)
        The point of each measurement, m.

    Returns
    -------
    v : ndarray, shape (n, 2)
        Along col and row, px; NaN for points behind the camera.
    """
    v = pinhole(seen.f, to_camera(seen.T_m_c, x_m))
    for camera, of_camera, xy in seen.by_camera():
        v[of_camera] = _misfit(seen, camera.interior, xy, v[of_camera])[0]
    return v * seen.px_per_mm


def _misfit(
    seen: Measurement, interior: Interior, xy: Array, ideal: Array
) -> tuple[Array, Array, Array]:
    """Return residuals in mm, where distortion is evaluated, and d(residual) / d(ideal).

    A point that has no image there is left with the correction at the measured point.
    """
    error, by_ideal = ideal - correct(interior, xy), np.tile(np.eye(2), (len(xy), 1, 1))
    if seen.distortion_at == "measured":
        return error, xy, by_ideal
    point, reached = _adjusted(interior, xy, ideal)
    point = np.where(reached[:, None], point, xy)
    by_ideal[reached] = np.linalg.inv(correct_by_point(interior, point[reached]))
    return np.where(reached[:, None], point - xy, error), point, by_ideal


def _adjusted(interior: Interior, xy: Array, ideal: Array) -> tuple[Array, Mask]:
    """Return the image points whose corrected point is `ideal`, and the mask of converged ones.

    Newton's method from the measured points; without a gross error the first step is the last, and
    leaves less than 1e-6 px.
    """
    near = NEAR_MM * min(1.0, interior.f / NEAR_F_MM) ** 2
    adjusted, reached = xy.copy(), np.zeros(len(xy), dtype=np.bool_)
    remaining = np.arange(len(xy))
    for _ in range(MOST_STEPS):
        step, _, valid = newton_step(interior, adjusted[remaining], ideal[remaining])
        adjusted[remaining] -= step
        reached[remaining] = valid & (np.sum(step**2, axis=1) < near**2)
        remaining = remaining[valid & ~reached[remaining]]
        if not len(remaining):
            break
    return adjusted, reached


def image_derivatives(seen: Measurement, x_m: Array) -> tuple[Array, Array, Array, Array]:
    """Return `image_residuals` and its derivatives.

    Parameters
    ----------
    seen : Measurement
    x_m : ndarray, shape (n, 3)

    Returns
    -------
    v : ndarray, shape (n, 2)
    by_interior : ndarray, shape (n, 2, 10)
        Columns in the order of `camera.INTERIOR`.
    by_pose : ndarray, shape (n, 2, 6)
        By the camera pose.
    by_point : ndarray, shape (n, 2, 3)
    """
    x_c = to_camera(seen.T_m_c, x_m)
    v = pinhole(seen.f, x_c)
    by_interior, by_x_c = np.zeros((len(x_m), 2, len(INTERIOR))), pinhole_jacobian(seen.f, x_c)
    by_interior[:, :, 0] = -x_c[:, :2] / x_c[:, 2:]
    for camera, of_camera, xy in seen.by_camera():
        v[of_camera], point, by_ideal = _misfit(seen, camera.interior, xy, v[of_camera])
        by_interior[of_camera] = by_ideal @ (
            by_interior[of_camera] - correct_jacobian(camera.interior, point)
        )
        by_x_c[of_camera] = by_ideal @ by_x_c[of_camera]
    by_pose, by_point = to_camera_jacobian(seen.T_m_c, x_c)
    scale = seen.px_per_mm[:, :, None]
    by_x_c *= scale
    return v * scale[:, :, 0], by_interior * scale, by_x_c @ by_pose, by_x_c @ by_point


# --- Refraction in the standard atmosphere: where points seem to be


LAPSE, DENSITY = 0.0065 / 288.15, 4.2559
"""Standard atmosphere: relative decrease of temperature with height, 1/m; exponent of density."""

REFRACTION = ("none", "standard")
"""Models of refraction: straight rays, or rays bent by the standard atmosphere."""

REFRACTIVITY = 2.78e-4
"""n - 1 of visible light in air at sea level, 15 degrees Celsius and 1013.25 hPa."""


def refraction_lift(r_m_c: Array, x_m: Array) -> Array:
    """Return the height by which refraction makes points appear too high, m.

    In horizontal layers of air a ray at the angle theta from the vertical is bent by
    K tan(theta). K is the mean refractive index between point and camera minus that at the
    camera. The straight ray meets the point if it is raised by K (Z_c - Z) / cos^2(theta).

    Parameters
    ----------
    r_m_c, x_m : ndarray, shape (n, 3)
        Cameras and points, m; heights are counted from the ellipsoid, up to 11 km.

    Returns
    -------
    ndarray, shape (n,)

    Notes
    -----
    In the ICAO standard atmosphere the density is (1 - LAPSE h)^DENSITY times its value at sea
    level; n - 1 is proportional to the density.
    """
    camera, ground = 1 - LAPSE * r_m_c[:, 2], 1 - LAPSE * x_m[:, 2]
    down = x_m - r_m_c
    integral = (ground ** (DENSITY + 1) - camera ** (DENSITY + 1)) / (LAPSE * (DENSITY + 1))
    K = REFRACTIVITY * (integral / -down[:, 2] - camera**DENSITY)
    return -K * np.sum(down * down, axis=1) / down[:, 2]


def refraction_taken_up(
    f: float, radius_mm: float, height_m: Array, ground_m: float, *, lever_arm: bool
) -> tuple[float, float]:
    """Return what a calibration without refraction adds to f and to the lever arm's height.

    Vertical images of level ground are compared with straight rays, along a radius of the image.
    By least squares the focal length, the radial distortion and the height of the cameras take up
    the difference.

    Parameters
    ----------
    f, radius_mm : float
        Focal length, and half of the image's diagonal, mm.
    height_m : ndarray, shape (n,)
        Of the cameras above the ellipsoid, m, up to 11 km.
    ground_m : float
        Height of the ground above the ellipsoid, m.
    lever_arm : bool
        Whether the height of the cameras against GNSS is free; cameras at one height do not tell
        it from f.

    Returns
    -------
    f_mm, z_m : float
        `z_m` is zero where it is not free.
    """
    s = np.linspace(0, 1, 51)[1:] * radius_mm
    rho, above = (part.ravel() for part in np.meshgrid(s, height_m - ground_m))
    zero = np.zeros_like(rho)
    camera = np.stack([zero, zero, above + ground_m], axis=1)
    point = np.stack([above * rho / f, zero, zero + ground_m], axis=1)
    seen = rho * above / (above - refraction_lift(camera, point))
    distortion = [(rho / radius_mm) ** power for power in (3, 5, 7)]
    lowered = [-rho / above] if lever_arm else []
    A = np.stack([rho / f, *lowered, *distortion], axis=1)
    scale = np.linalg.norm(A, axis=0)
    taken = np.linalg.lstsq(A / scale, seen - rho)[0] / scale
    return float(taken[0]), float(taken[1]) if lever_arm else 0.0


def as_seen(r_m_c: Array, x_m: Array, *, refraction: str) -> Array:
    """Return the apparent positions of points, to which rays are straight, m.

    Parameters
    ----------
    r_m_c, x_m : ndarray, shape (n, 3)
        Cameras and points, m.
    refraction : str
        ``"none"``, or ``"standard"`` for `refraction_lift`.

    Returns
    -------
    ndarray, shape (n, 3)

    Raises
    ------
    ValueError
        For another kind of refraction.
    """
    expected.one_of("refraction", refraction, REFRACTION)
    if refraction == "none":
        return x_m
    return x_m + refraction_lift(r_m_c, x_m)[:, None] * np.array([0.0, 0.0, 1.0])
