"""Small pictures with the measured points on them, to be looked at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from acx4lib.expected import Array
from acx4lib.results import whole_files
from acx4lib.results.whole_files import file_stem
from acx4tools.measuring.measure import Outcome
from acx4tools.measuring.views import View, pixels_of_view

SIDE_PX = 1400
"""Longer side of the pictures, at most."""

COLOURS = ((2, (31, 138, 229)), (4, (120, 154, 29)), (10**9, (160, 88, 33)))
"""Largest number of rays, and the colour of such a point: blue, green, red."""

SURVEYED = (48, 70, 191)


def write(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Write a JPEG for every picture that was measured.

    Tie points are dots, orange with two rays, green with three or four, blue with more; surveyed
    points are squares.

    Parameters
    ----------
    outcomes : sequence of Outcome
    folder : Path
        Each block gets a folder in it.
    """
    for one in outcomes:
        (folder / one.block).mkdir(parents=True)
        rays = one.matched.rays
        count = np.bincount(rays.point)[rays.point] if len(rays) else np.zeros(0)
        for k, view in enumerate(one.matched.views):
            own = rays.view == k
            surveyed = [
                (row.col_px, row.row_px) for row in one.surveyed.rows if row.image == view.name
            ]
            drawn = _drawn(view, rays.colrow[own], count[own], np.array(surveyed).reshape(-1, 2))
            _, coded = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, 85])
            place = folder / one.block / f"{file_stem(view.name)}.jpg"
            whole_files.write(place, coded.tobytes())


def _drawn(view: View, ties: Array, count: Array, surveyed: Array) -> np.ndarray:
    """Return a picture with its points, (rows, cols, 3), 8 bit."""
    image = pixels_of_view(view)
    k = max(-(-max(image.shape[:2]) // SIDE_PX), 1)
    grey = image[::k, ::k].mean(axis=2, dtype=np.float32)
    low, high = np.percentile(grey, (1, 99))
    bright = np.clip((grey - low) / max(float(high - low), 1.0) * 255, 0, 255).astype(np.uint8)
    out = np.ascontiguousarray(np.repeat(bright[:, :, None], 3, axis=2))
    for place, n in zip(ties / k, count, strict=True):
        colour = next(colour for most, colour in COLOURS if n <= most)
        cv2.circle(out, _whole(place), 4, colour, -1, cv2.LINE_AA)
    for place in view.own(surveyed) / k:
        corner = np.array([7, 7])
        cv2.rectangle(out, _whole(place - corner), _whole(place + corner), SURVEYED, 2)
    return out


def _whole(place: Array) -> tuple[int, int]:
    col, row = np.rint(place).astype(int).tolist()
    return col, row
