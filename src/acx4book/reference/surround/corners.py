"""Corners of the printed target in neighbouring cameras, and their misfits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from acx4book.reference.surround.cameras import (
    FisheyeCamera,
    fisheye_from_undistorted,
    frame_from_undistorted,
    undistorted_from_frame,
)
from acx4book.reference.surround.greys import overlapping
from acx4book.reference.surround.views import View
from acx4lib.expected import Array, Mask, Raster

HALF_PX, SEARCH_PX = 15, 25
"""Half of the side of the window around a corner, and largest distance of the search."""

BLUR_PX, FAINT = 4.0, 0.3
"""Smoothing before the search for saddle points; smallest curvature relative to the largest."""

ALIKE = 0.75
"""Smallest correlation of the windows around a corner."""

SAME_PX = 2.0
"""Largest distance of a corner from itself after a search in the other view and back."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Corners:
    """Corners of the printed target in two cameras.

    Attributes
    ----------
    camera_a, camera_b : int
    colrow_a, colrow_b : ndarray, shape (n, 2)
        Pixels of the cameras' undistorted images.
    """

    camera_a: int
    camera_b: int
    colrow_a: Array
    colrow_b: Array


def find_corners(cameras: Sequence[FisheyeCamera], views: Sequence[View]) -> list[Corners]:
    """Return the corners of all overlaps.

    Four squares meet in a saddle point of the grey values, which blur does not move. The saddle
    points of one view are searched in the other by correlation, and back.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
        The cameras of the views.
    views : sequence of View
    """
    grey = [np.asarray(cv2.cvtColor(v.image, cv2.COLOR_RGB2GRAY), dtype=np.uint8) for v in views]
    inner = [_inner(v.seen) for v in views]
    out = []
    for a, b in overlapping(views):
        from_a = _saddles(grey[a], _strongest_saddles(grey[a], inner[a] & inner[b]))
        in_b, found = _followed(grey[a], grey[b], from_a)
        back, again = _followed(grey[b], grey[a], in_b)
        same = found & again & (np.linalg.norm(back - from_a, axis=1) < SAME_PX)
        same &= inner[b][tuple(np.rint(in_b.T[::-1]).astype(int))]
        out.append(
            Corners(
                camera_a=a,
                camera_b=b,
                colrow_a=undistorted_from_frame(cameras[a], from_a[same]),
                colrow_b=undistorted_from_frame(cameras[b], in_b[same]),
            )
        )
    return out


def _inner(seen: Mask) -> Mask:
    """Return where a view has the whole window around a corner."""
    side = 2 * HALF_PX + 3
    kernel = np.ones((side, side), dtype=np.uint8)
    return cv2.erode(seen.astype(np.uint8), kernel, borderValue=0).astype(bool)


def _strongest_saddles(grey: Raster, where: Mask) -> Array:
    """Return the strongest saddle points of the grey values, whole pixels, shape (n, 2)."""
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), BLUR_PX)
    xx, yy, xy = (np.asarray(cv2.Sobel(smooth, -1, *order)) for order in ((2, 0), (0, 2), (1, 1)))
    strength = np.where(where, xy**2 - xx * yy, 0)
    around = np.ones((2 * HALF_PX + 1, 2 * HALF_PX + 1), dtype=np.uint8)
    peak = (strength == cv2.dilate(strength, around)) & (strength > FAINT * strength.max())
    return np.argwhere(peak)[:, ::-1].astype(float)


def _saddles(grey: Raster, colrow: Array) -> Array:
    """Return the saddle points next to given pixels, to fractions of a pixel."""
    if len(colrow) == 0:
        return colrow
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
    start = np.ascontiguousarray(colrow, dtype=np.float32)
    return cv2.cornerSubPix(grey, start, (HALF_PX // 2 + 1,) * 2, (-1, -1), stop).astype(float)


def _followed(grey_a: Raster, grey_b: Raster, colrow: Array) -> tuple[Array, Mask]:
    """Return the positions of one view's points in another, and whether they were found."""
    start, found = np.rint(colrow).astype(int), np.zeros(len(colrow), dtype=bool)
    place = start.copy()
    height, width = grey_a.shape
    reach = HALF_PX + SEARCH_PX
    for i, (col, row) in enumerate(start):
        if reach <= col < width - reach and reach <= row < height - reach:
            scores = cv2.matchTemplate(
                _square(grey_b, col, row, reach),
                _square(grey_a, col, row, HALF_PX),
                cv2.TM_CCOEFF_NORMED,
            )
            _, best, _, at = cv2.minMaxLoc(scores)
            place[i] += np.array(at) - SEARCH_PX
            found[i] = best > ALIKE
    return _saddles(grey_b, place), found


def _square(grey: Raster, col: int, row: int, half: int) -> Raster:
    return grey[row - half : row + half + 1, col - half : col + half + 1]


# --- misfits ---------------------------------------------------------------------------------


def corner_misfits(cameras: Sequence[FisheyeCamera], corners: Corners) -> tuple[Array, Array]:
    """Return the distances on the ground between the same corners in two cameras.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
    corners : Corners

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Midpoint of the two positions, pixels of the frame.
    d : ndarray, shape (n, 2)
        Second camera's position minus the first one's, pixels of the frame.
    """
    a = frame_from_undistorted(cameras[corners.camera_a], corners.colrow_a)
    b = frame_from_undistorted(cameras[corners.camera_b], corners.colrow_b)
    return 0.5 * (a + b), b - a


def image_misfits(cameras: Sequence[FisheyeCamera], corners: Corners) -> Array:
    """Return these misfits in the original images, px: in the first, then in the second.

    Returns
    -------
    ndarray, shape (2 n, 2)
        Position of a corner predicted from the other camera, minus its measured position.
    """
    a, b = cameras[corners.camera_a], cameras[corners.camera_b]
    out = []
    for this, own, other, there in (
        (a, corners.colrow_a, b, corners.colrow_b),
        (b, corners.colrow_b, a, corners.colrow_a),
    ):
        expected = undistorted_from_frame(this, frame_from_undistorted(other, there))
        out.append(fisheye_from_undistorted(this, expected) - fisheye_from_undistorted(this, own))
    return np.concatenate(out)


def rms(d: Array) -> float:
    """Return the root mean square length of vectors, shape (n, 2)."""
    return float(np.sqrt(np.square(d).sum(axis=1).mean()))
