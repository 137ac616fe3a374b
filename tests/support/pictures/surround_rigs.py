"""A surround-view rig over a chequered ground, photographed by OpenCV's functions alone."""

from __future__ import annotations

import cv2
import numpy as np

from acx4book.reference.surround.cameras import FRAME_PX, FisheyeCamera
from acx4book.reference.surround.corners import corner_misfits

SIZE = (960, 640)
K = np.array([[300.0, 0, 480], [0, 320, 320], [0, 0, 1]])
K_UNDISTORTED = np.array([[150.0, 0, 470], [0, 240, 330], [0, 0, 1]])
THETA = np.array([-0.04, 0.01, -0.01, 0.002])

STATIONS = {
    "front": ((600.0, 540, 70), (0.0, -1)),
    "left": ((500.0, 730, 100), (-1.0, 0)),
    "back": ((600.0, 980, 95), (0.0, 1)),
    "right": ((700.0, 730, 100), (1.0, 0)),
}
"""Column, row and height in cm, and the direction of sight on the ground (column, row)."""

NAMES = tuple(STATIONS)
WIDTH, HEIGHT = FRAME_PX

DOWN = np.radians(42)
"""Of the axes under the horizon."""


def pose(name):
    """Return rotation and translation from (column, row, depth under the ground) to the camera."""
    (col, row, height), ahead = STATIONS[name]
    forward = np.array([*np.cos(DOWN) * np.array(ahead), np.sin(DOWN)])
    right = np.array([-ahead[1], ahead[0], 0.0])
    R = np.array([right, np.cross(forward, right), forward])
    return R, -R @ [col, row, -height]


def camera(name):
    """Return a camera whose homography is that of its pose."""
    R, t = pose(name)
    return FisheyeCamera(
        name=name,
        width_px=SIZE[0],
        height_px=SIZE[1],
        K=K,
        theta_coefficients=THETA,
        K_undistorted=K_UNDISTORTED,
        H_s_u=np.linalg.inv(K_UNDISTORTED @ np.column_stack([R[:, :2], t])),
    )


def chequered_ground():
    """Return a picture of the ground: a target of squares of 40 cm, dark and light."""
    width, height = FRAME_PX
    ground = np.full((height, width, 3), 120, dtype=np.uint8)
    dark = np.indices((25, 15)).sum(axis=0) % 2 == 0
    squares = dark.repeat(40, axis=0).repeat(40, axis=1)
    ground[300:1300, 300:900] = np.where(squares, 50, 180)[:, :, None]
    return cv2.GaussianBlur(ground, None, 3.0)  # a pixel far away has several centimetres


def photograph(name, ground):
    """Return what a camera's lens shows of a picture of the ground."""
    R, t = pose(name)
    colrow = np.stack(np.meshgrid(*map(np.arange, SIZE)), axis=-1).reshape(-1, 1, 2).astype(float)
    ray = cv2.fisheye.undistortPoints(colrow, K, THETA)[:, 0]
    ray = np.column_stack([ray, np.ones(len(ray))]) @ R
    centre = -R.T @ t
    with np.errstate(divide="ignore", invalid="ignore"):
        at = centre[:2] - ray[:, :2] * centre[2] / ray[:, 2:]
    at[(ray[:, 2] <= 0.02) | (np.abs(at).max(axis=1) > 1e4)] = -100
    col, row = at.astype(np.float32).T.reshape(2, SIZE[1], SIZE[0])
    return cv2.remap(ground, col, row, cv2.INTER_LINEAR, borderValue=(90, 90, 90))


def all_misfits(cameras, corners):
    return np.concatenate([corner_misfits(cameras, c)[1] for c in corners])
