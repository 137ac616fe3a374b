"""Cameras whose views of the ground fit each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from acx4book.reference.surround.cameras import (
    FisheyeCamera,
    frame_from_undistorted,
    image_from_frame,
    undistorted_from_frame,
)
from acx4book.reference.surround.corners import Corners, corner_misfits
from acx4lib.expected import Array

ROBUST_PX = 2.0
"""Misfit from which on it counts less than squared."""

TARGET_PX = ((300, 300), (900, 1300))
"""Upper left and lower right corner of the printed target in the frame: 6 x 10 m."""

IN_PLACE_CM = 5.0
"""How well the calibration has put each camera's view in its place, by points of the target."""

Free = Literal["rotations", "homographies", "in place"]
"""What a refinement estimates."""


def refined(
    cameras: Sequence[FisheyeCamera], corners: Sequence[Corners], *, free: Free
) -> tuple[FisheyeCamera, ...]:
    """Return the cameras after their views were made to fit.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
    corners : sequence of Corners
        Of overlaps that connect all cameras.
    free : {"rotations", "homographies", "in place"}
        Three angles of each camera but the first, as of heads; the eight numbers of each
        homography but the first; or those of all, with the ground where it was to `IN_PLACE_CM`.

    Returns
    -------
    tuple of FisheyeCamera

    Notes
    -----
    Robust least squares of the misfits on the ground.
    """
    n, held = {"rotations": (3, 1), "homographies": (8, 1), "in place": (8, 0)}[free]
    ground = [target_seen(c) for c in cameras] if held == 0 else []

    def moved(x: Array) -> tuple[FisheyeCamera, ...]:
        changes = zip(cameras[held:], x.reshape(-1, n), strict=True)
        return (*cameras[:held], *(_changed(c, row) for c, row in changes))

    def residuals(x: Array) -> Array:
        now = moved(x)
        apart = [corner_misfits(now, c)[1] for c in corners]
        shifts = [
            shift(c, new, colrow) / IN_PLACE_CM
            for c, new, colrow in zip(cameras, now, ground, strict=bool(ground))
        ]
        return np.concatenate([*apart, *shifts]).ravel()

    start = np.zeros(n * (len(cameras) - held))
    fit = least_squares(residuals, start, loss="soft_l1", f_scale=ROBUST_PX, x_scale="jac")
    return moved(fit.x)


def shift(before: FisheyeCamera, after: FisheyeCamera, colrow: Array) -> Array:
    """Return how far a refinement moved what a camera shows at places of the frame, (n, 2), px."""
    return frame_from_undistorted(after, undistorted_from_frame(before, colrow)) - colrow


def target_seen(camera: FisheyeCamera) -> Array:
    """Return places of the target that a camera shows, every half metre, shape (n, 2)."""
    (left, top), (right, bottom) = TARGET_PX
    grid = np.meshgrid(np.arange(left, right + 1, 50.0), np.arange(top, bottom + 1, 50.0))
    colrow = np.stack(grid, axis=-1).reshape(-1, 2)
    return colrow[np.isfinite(image_from_frame(camera, colrow)[:, 0])]


def _changed(camera: FisheyeCamera, x: Array) -> FisheyeCamera:
    """Return a camera after three angles, or eight numbers, were added in its own axes."""
    if len(x) == 3:
        change = Rotation.from_rotvec(x).as_matrix()
    else:
        change = np.eye(3) + np.append(x, 0.0).reshape(3, 3)
    K = camera.K_undistorted
    return replace(camera, H_s_u=camera.H_s_u @ K @ change @ np.linalg.inv(K))


def left_out_misfits(
    cameras: Sequence[FisheyeCamera], corners: Sequence[Corners], *, free: Free
) -> list[Array]:
    """Return the misfits of corners that the refinement did not know, overlap by overlap.

    Every second corner is left out, then the others: what a refinement takes up of the errors of
    single corners does not make these smaller.
    """
    out: list[list[Array]] = [[] for _ in corners]
    for part in (0, 1):
        known = refined(cameras, [_every_second(c, part) for c in corners], free=free)
        for d, c in zip(out, corners, strict=True):
            d.append(corner_misfits(known, _every_second(c, 1 - part))[1])
    return [np.concatenate(d) for d in out]


def _every_second(corners: Corners, first: int) -> Corners:
    return replace(
        corners, colrow_a=corners.colrow_a[first::2], colrow_b=corners.colrow_b[first::2]
    )
