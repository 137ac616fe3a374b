"""Collinearity: the paper's eqs (1)-(5), and eq. (14) as the chain of two poses.

A camera pose varies by six numbers: the perspective centre in the mapping frame, m, and a small
rotation about the *camera's* axes, ``R_m_c <- R_m_c exp(delta)``, rad.
"""

from __future__ import annotations

import numpy as np

from acx4lib._typing import Array
from acx4lib.camera import Camera, colrow_from_xy, correct, distort, xy_from_colrow
from acx4lib.frames import Pose, skew, transform


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
    """Return where a camera sees points, eqs (1)-(11) solved for the measured point.

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
    """
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
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow))
    ray_c = np.column_stack([ideal, np.full(len(ideal), -camera.interior.f)])
    return transform(T_m_c.R, ray_c / np.linalg.norm(ray_c, axis=1, keepdims=True))


def refraction_lift(r_m_c: Array, x_m: Array) -> Array:
    """Return by how much refraction makes points appear too high, m.

    Standard atmosphere, valid up to 9 km. A ray that leaves the vertical by theta is bent by
    K tan(theta); the straight ray meets the point raised by K (Z_c - Z) / cos^2(theta).

    Parameters
    ----------
    r_m_c, x_m : ndarray, shape (n, 3)
        Cameras and points, m; heights are counted from the ellipsoid.

    Returns
    -------
    ndarray, shape (n,)

    References
    ----------
    .. [1] C. C. Slama (ed.), "Manual of Photogrammetry", 4th ed., 1980, chapter 9.
    """
    camera_km, ground_km = r_m_c[:, 2] / 1000, x_m[:, 2] / 1000

    def density_term(h: Array) -> Array:
        return 2410 * h / (h * h - 6 * h + 250)

    K = 1e-6 * (density_term(camera_km) - density_term(ground_km) * ground_km / camera_km)
    down = x_m - r_m_c
    return -K * np.sum(down * down, axis=1) / down[:, 2]
