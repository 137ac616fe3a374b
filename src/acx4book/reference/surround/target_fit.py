"""Refined cameras, whose views of the ground fit each other."""

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
"""Misfit above which the loss grows more slowly than the square."""

TARGET_PX = ((300, 300), (900, 1300))
"""Upper left and lower right corner of the printed target in the frame: 6 x 10 m."""

IN_PLACE_CM = 5.0
"""Sigma of the position of each camera's view of the target in the published calibration."""

Free = Literal["rotations", "homographies", "in place"]
"""What a refinement estimates."""


def refined(
    cameras: Sequence[FisheyeCamera], corners: Sequence[Corners], *, free: Free
) -> tuple[FisheyeCamera, ...]:
    """Return the cameras after an adjustment of their views to each other.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
    corners : sequence of Corners
        Corners of overlaps that connect all cameras.
    free : {"rotations", "homographies", "in place"}
        Three angles of each camera except the first, as for heads; the eight numbers of each
        homography except the first; or those of all, with the target observed in its published
        position with the sigma `IN_PLACE_CM`.

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
    """Return the movement, by a refinement, of a camera's view at frame positions, (n, 2), px."""
    return frame_from_undistorted(after, undistorted_from_frame(before, colrow)) - colrow


def target_seen(camera: FisheyeCamera) -> Array:
    """Return positions on the target that a camera sees, every half metre, shape (n, 2)."""
    (left, top), (right, bottom) = TARGET_PX
    grid = np.meshgrid(np.arange(left, right + 1, 50.0), np.arange(top, bottom + 1, 50.0))
    colrow = np.stack(grid, axis=-1).reshape(-1, 2)
    return colrow[np.isfinite(image_from_frame(camera, colrow)[:, 0])]


def _changed(camera: FisheyeCamera, x: Array) -> FisheyeCamera:
    """Return a camera changed by three angles, or by eight numbers, in its own axes."""
    if len(x) == 3:
        change = Rotation.from_rotvec(x).as_matrix()
    else:
        change = np.eye(3) + np.append(x, 0.0).reshape(3, 3)
    K = camera.K_undistorted
    return replace(camera, H_s_u=camera.H_s_u @ K @ change @ np.linalg.inv(K))


def left_out_misfits(
    cameras: Sequence[FisheyeCamera], corners: Sequence[Corners], *, free: Free
) -> list[Array]:
    """Return the misfits of corners that the refinement did not use, overlap by overlap.

    Every second corner is left out, then the others. So these misfits do not become smaller by
    adjusting to the errors of single corners.
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
