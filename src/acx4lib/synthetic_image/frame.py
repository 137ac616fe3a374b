"""The geometry of the synthetic image (section 2.1, Table 2, Figure 1).

The synthetic image is the plane Z = 0 of the frame `s`, x right, y up, in mm from the middle of
the image; its perspective centre is (0, 0, f). A head's perspective centre is (Xc, Yc, Zc), and
it sees a synthetic point (X, Y, 0) by eqs (1)-(11).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from acx4lib import expected, shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import (
    Camera,
    colrow_from_xy,
    correct,
    correct_by_point,
    distort,
    inside,
    xy_from_colrow,
)
from acx4lib.geometry.collinearity import pinhole, to_camera
from acx4lib.geometry.frames import Pose, rotation_from_opk, transform


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """Which heads see which part of the synthetic image.

    Attributes
    ----------
    xy : ndarray, shape (rows, cols, 2)
        Nodes over the synthetic image, mm.
    seen : ndarray, shape (n_heads, rows, cols)
    share : ndarray, shape (n_heads + 1,)
        Share of the image that is seen by 0, 1, ... heads.
    """

    xy: Array
    seen: Mask
    share: Array


def head_pose(orientation: RelativeOrientation, k: int) -> Pose:
    """Return T_s_h of a head, mm."""
    expected.place("k", k, len(orientation.heads))
    return Pose(R=rotation_from_opk(orientation.opk[k]), r=orientation.xyz_mm[k])


def head_from_synthetic(orientation: RelativeOrientation, k: int, xy: Array) -> Array:
    """Return the pixel coordinates of synthetic image points in a head, eqs (1)-(11).

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    xy : ndarray, shape (n, 2)
        Points of the synthetic image, mm.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Pixels of the head, also outside its sensor; NaN outside the lens model.

    Raises
    ------
    ValueError
        For an unknown head, or points of another shape.
    """
    xy = expected.numbers("xy", xy, ("n", 2))
    T, camera = head_pose(orientation, k), orientation.heads[k]
    x_s = np.column_stack([xy, np.zeros(len(xy))])
    poses = Pose(R=np.broadcast_to(T.R, (len(xy), 3, 3)), r=T.r)
    ideal = pinhole(camera.interior.f, to_camera(poses, x_s))
    colrow = np.full((len(xy), 2), np.nan)
    ahead = np.isfinite(ideal[:, 0])
    colrow[ahead] = colrow_from_xy(camera, distort(camera.interior, ideal[ahead]))
    return colrow


def synthetic_from_head(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return the synthetic image points of a head's measurements, shape (n, 2), mm.

    NaN for a ray that does not meet the plane of the synthetic image.
    """
    colrow = expected.numbers("colrow", colrow, ("n", 2))
    T, ray_s = head_pose(orientation, k), _rays_of_head(orientation, k, colrow)
    return T.r[:2] - ray_s[:, :2] * (T.r[2] / ray_s[:, 2:])


def _rays_of_head(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return the rays of measurements in the synthetic frame, (n, 3), mm; NaN if not downward."""
    camera = orientation.heads[k]
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow))
    ray_h = np.column_stack([ideal, np.full(len(ideal), -camera.interior.f)])
    ray_s = transform(head_pose(orientation, k).R, ray_h)
    return np.where(ray_s[:, 2:] < 0, ray_s, np.nan)


def synthetic_from_head_jacobian(orientation: RelativeOrientation, k: int, colrow: Array) -> Array:
    """Return d(`synthetic_from_head`) / d(colrow), shape (n, 2, 2), mm per pixel of the head."""
    colrow = expected.numbers("colrow", colrow, ("n", 2))
    T, camera = head_pose(orientation, k), orientation.heads[k]
    ray_s = _rays_of_head(orientation, k, colrow)
    along = ray_s[:, :2, None] / ray_s[:, 2:, None]
    by_ideal = -T.r[2] / ray_s[:, 2:, None] * (T.R[:2, :2] - along * T.R[2, :2])
    by_xy = correct_by_point(camera.interior, xy_from_colrow(camera, colrow))
    return by_ideal @ by_xy * np.array([camera.pixel_mm, -camera.pixel_mm])


def footprint(orientation: RelativeOrientation, k: int, *, per_side: int = 1) -> Array:
    """Return the outline of a head in the synthetic image, shape (4 per_side + 1, 2), mm.

    It follows the outer pixel edges from the upper-left corner clockwise, and is closed.
    """
    expected.place("k", k, len(orientation.heads))
    expected.whole("per_side", per_side)
    camera = orientation.heads[k]
    w, h = camera.width_px, camera.height_px
    corners = np.array([[0, 0], [w, 0], [w, h], [0, h], [0, 0]]) - 0.5
    steps = np.linspace(0, 1, per_side, endpoint=False)[:, None]
    sides = [a + steps * (b - a) for a, b in pairwise(corners)]
    return synthetic_from_head(orientation, k, np.concatenate([*sides, corners[:1]]))


def coverage(
    orientation: RelativeOrientation, synthetic: Camera, *, spacing_px: int = 60
) -> Coverage:
    """Return which heads see the nodes of a grid over the synthetic image and its borders."""
    expected.whole("spacing_px", spacing_px)
    w, h = synthetic.width_px, synthetic.height_px
    cols = np.linspace(0, w - 1, max(w // spacing_px, 1) + 1)
    rows = np.linspace(0, h - 1, max(h // spacing_px, 1) + 1)
    grid = np.stack(np.meshgrid(cols, rows), axis=-1)
    xy = xy_from_colrow(synthetic, grid)
    flat = xy.reshape(-1, 2)
    seen = np.stack(
        [
            inside(camera, head_from_synthetic(orientation, k, flat)).reshape(grid.shape[:2])
            for k, camera in enumerate(orientation.heads)
        ]
    )
    count = seen.sum(axis=0)
    share = np.bincount(count.ravel(), minlength=len(seen) + 1) / count.size
    return Coverage(xy=xy, seen=seen, share=share)


def reduced_camera(camera: Camera, k: int) -> Camera:
    """Return a camera whose image has 1/k of the size: k x k pixels become one.

    Parameters
    ----------
    camera : Camera
    k : int
        If it does not divide the size, the image covers the middle of the sensor.

    Returns
    -------
    Camera
        With the same interior orientation in mm.

    Raises
    ------
    ValueError
        Where `k` is not positive, no whole number, or larger than the image.
    """
    expected.instance("camera", camera, Camera)
    expected.whole("k", k)
    width, height = camera.width_px // k, camera.height_px // k
    if not (width and height):
        msg = f"{camera.name}: an image of {camera.width_px} x {camera.height_px} px has no 1/{k}"
        raise ValueError(msg)
    return replace(camera, width_px=width, height_px=height, pixel_mm=k * camera.pixel_mm)


def reduced_heads(orientation: RelativeOrientation, k: int) -> RelativeOrientation:
    """Return the same heads with images of 1/k of the size."""
    return replace(orientation, heads=tuple(reduced_camera(h, k) for h in orientation.heads))
