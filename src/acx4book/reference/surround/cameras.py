"""Four fisheye cameras over flat ground: pixels of the ground and the images, and positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array

FRAME_PX = (1200, 1600)
"""Width and height of the frame, an image of the ground: a pixel is 1 cm, the car's front up."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FisheyeCamera:
    """One camera of the rig and its position over the ground.

    Attributes
    ----------
    name : str
    width_px, height_px : int
        Size of the image, and of the undistorted image.
    K : ndarray, shape (3, 3)
        Camera matrix, px.
    theta_coefficients : ndarray, shape (4,)
        Coefficients of theta^2, theta^4, theta^6, theta^8 in OpenCV's fisheye model.
    K_undistorted : ndarray, shape (3, 3)
        Camera matrix of the undistorted image, px.
    H_s_u : ndarray, shape (3, 3)
        Homography from pixels of the undistorted image to pixels of the frame.
    """

    name: str
    width_px: int
    height_px: int
    K: Array
    theta_coefficients: Array
    K_undistorted: Array
    H_s_u: Array


# --- from pixels to pixels -------------------------------------------------------------------


def undistorted_from_frame(camera: FisheyeCamera, colrow: Array) -> Array:
    """Return the positions of ground points in the undistorted image of a camera.

    Parameters
    ----------
    camera : FisheyeCamera
    colrow : ndarray, shape (n, 2)
        Pixels of the frame.

    Returns
    -------
    ndarray, shape (n, 2)
        Pixels, also outside the image; NaN behind the camera.
    """
    h = np.column_stack([colrow, np.ones(len(colrow))]) @ np.linalg.inv(camera.H_s_u).T
    depth = _ground_sign(camera) * h[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(depth[:, None] > 0, h[:, :2] / h[:, 2:], np.nan)


def fisheye_from_undistorted(camera: FisheyeCamera, colrow: Array) -> Array:
    """Return the positions of pixels of the undistorted image in the original image, (n, 2).

    Notes
    -----
    OpenCV's fisheye model: a ray at the angle theta from the axis has the image distance
    theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), in focal lengths.
    """
    K, K_u = camera.K, camera.K_undistorted
    ray = (colrow - K_u[:2, 2]) / [K_u[0, 0], K_u[1, 1]]
    tangent = np.linalg.norm(ray, axis=1)
    theta = np.arctan(tangent)
    powers = theta[:, None] ** [2, 4, 6, 8]
    distance = theta * (1 + powers @ camera.theta_coefficients)
    ratio = np.divide(distance, tangent, out=np.ones_like(theta), where=tangent > 0)
    return ratio[:, None] * ray * [K[0, 0], K[1, 1]] + K[:2, 2]


def frame_from_undistorted(camera: FisheyeCamera, colrow: Array) -> Array:
    """Return the ground points of pixels of the undistorted image, frame pixels, shape (n, 2)."""
    h = np.column_stack([colrow, np.ones(len(colrow))]) @ camera.H_s_u.T
    return h[:, :2] / h[:, 2:]


def image_from_frame(camera: FisheyeCamera, colrow: Array) -> Array:
    """Return the positions of ground points in the image of a camera.

    Valid inside the undistorted image, for which the camera was calibrated. Outside, the
    polynomial of the lens is wrong.

    Parameters
    ----------
    camera : FisheyeCamera
    colrow : ndarray, shape (n, 2)
        Pixels of the frame.

    Returns
    -------
    ndarray, shape (n, 2)
        Pixels of the original image; NaN where the camera is not valid.
    """
    undistorted = undistorted_from_frame(camera, colrow)
    seen = border_px(camera, undistorted) >= 0
    return np.where(seen[:, None], fisheye_from_undistorted(camera, undistorted), np.nan)


def border_px(camera: FisheyeCamera, undistorted: Array) -> Array:
    """Return the distances of pixels of the undistorted image from its border, shape (n,), px.

    Negative outside; NaN for NaN.
    """
    far = np.array([camera.width_px - 1, camera.height_px - 1])
    return np.minimum(undistorted, far - undistorted).min(axis=1)


# --- positions -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """The position of a camera, from its homography.

    Attributes
    ----------
    centre_cm : ndarray, shape (3,)
        Column and row in the frame, and height above the ground.
    ratio : float
        Ratio of the scales along the frame's two axes. It is 1 for the homography of a camera, but
        not for one fitted to measured points.
    angle : float
        Angle between these axes, radians; a right angle for a camera.
    """

    centre_cm: Array
    ratio: float
    angle: float


def place(camera: FisheyeCamera) -> Place:
    """Return the position of a camera.

    Notes
    -----
    Up to a factor, the inverse homography is [r1 r2 t] in the axes of the undistorted camera, with
    the frame's two axes r1, r2 and its origin t.
    """
    r1, r2, t = (np.linalg.inv(camera.K_undistorted) @ np.linalg.inv(camera.H_s_u)).T
    lengths = np.linalg.norm([r1, r2], axis=1)
    scale = np.sqrt(lengths.prod()) * _ground_sign(camera)
    U, _, Vt = np.linalg.svd(np.column_stack([r1, r2, np.cross(r1, r2) / scale]) / scale)
    col, row, down = -(U @ Vt).T @ t / scale
    return Place(
        centre_cm=np.array([col, row, -down]),  # columns right, rows down: the third axis is down
        ratio=float(lengths[0] / lengths[1]),
        angle=float(np.arccos(r1 @ r2 / lengths.prod())),
    )


def ghost_cm(cameras: Sequence[FisheyeCamera], colrow: Array, *, height_cm: float) -> float:
    """Return the distance, cm, between the top of an object in one camera and in another.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
        Two cameras.
    colrow : ndarray, shape (2,)
        Foot of the object, pixels of the frame.
    height_cm : float
        Height of the object; it must be lower than the cameras.
    """
    shifts = []
    for camera in cameras:
        col, row, above = place(camera).centre_cm
        shifts.append((colrow - [col, row]) * height_cm / (above - height_cm))
    return float(np.linalg.norm(shifts[0] - shifts[1]))


def _ground_sign(camera: FisheyeCamera) -> float:
    """Return the sign of a homography's third coordinate for points in front of the camera.

    The sign of a homography is arbitrary; the middle of the lower edge is on the ground.
    """
    lower_edge = np.array([camera.width_px / 2, camera.height_px, 1.0])
    return float(np.sign(camera.H_s_u[2] @ lower_edge))
