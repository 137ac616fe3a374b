"""A real rig of four cameras with a published calibration: one image, and its misfits."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.reference import data
from acx4book.reference.surround import files
from acx4book.reference.surround.cameras import FisheyeCamera, ghost_cm, place
from acx4book.reference.surround.corners import (
    Corners,
    corner_misfits,
    find_corners,
    image_misfits,
    rms,
)
from acx4book.reference.surround.files import QUARTER_TURNS
from acx4book.reference.surround.greys import grey_samples, overlapping
from acx4book.reference.surround.target_fit import (
    Free,
    left_out_misfits,
    refined,
    shift,
    target_seen,
)
from acx4book.reference.surround.views import View, view
from acx4lib.expected import Array, Raster
from acx4lib.synthetic_image.response import ResponseFit, fit_response

FILES = "surround-rig"
"""The set of files."""

AS_PUBLISHED, BEST = "as published", "target held"
"""Names of refinements."""

REFINEMENTS: Mapping[str, Free | None] = {
    AS_PUBLISHED: None,
    "three angles": "rotations",
    "homographies": "homographies",
    BEST: "in place",
}
"""What a refinement estimates, by its name in tables."""

GHOST_CM = 10.0
"""Height of the objects that appear twice, for the table."""

LABELS = {
    "col_cm": "to the right (cm)",
    "row_cm": "to the back (cm)",
    "height_cm": "height (cm)",
    "ratio": "ratio of axes",
    "angle_deg": "angle of axes (deg)",
    "area_m2": "area (m²)",
    "before_percent": "grey, before (%)",
    "after_percent": "grey, after (%)",
    "floor_percent": "cell to cell (%)",
    "misfit_cm": "misfit (cm)",
    "largest_cm": "largest (cm)",
    "image_misfit_px": "misfit (px)",
    "ghost_cm": "ghost (cm)",
    "left_out_cm": "left out (cm)",
    "moved_cm": "moved (cm)",
    "moved_most_cm": "at most (cm)",
}
"""Headings of columns in the book."""

FORMATS = {
    "col_cm": ".0f",
    "row_cm": ".0f",
    "height_cm": ".0f",
    "ratio": ".3f",
    "angle_deg": ".1f",
    **dict.fromkeys([f"{a}-{b}" for a in QUARTER_TURNS for b in QUARTER_TURNS], ".2f"),
    **dict.fromkeys([name for name in LABELS if name.endswith(("_m2", "percent", "_px"))], ".1f"),
    **dict.fromkeys(["misfit_cm", "largest_cm", "ghost_cm", "left_out_cm"], ".1f"),
    **dict.fromkeys(["moved_cm", "moved_most_cm"], ".1f"),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Surround:
    """The rig, its photographs, and the results from them.

    Attributes
    ----------
    cameras : tuple of FisheyeCamera
        As published.
    images : tuple of ndarray, shape (rows, cols, 3)
    views : tuple of View
        The ground as seen by the cameras.
    fit : ResponseFit
        Gains of the cameras.
    corners : tuple of Corners
    refinements : mapping of str to tuple of FisheyeCamera
        By the names of `REFINEMENTS`.
    """

    cameras: tuple[FisheyeCamera, ...]
    images: tuple[Raster, ...]
    views: tuple[View, ...]
    fit: ResponseFit
    corners: tuple[Corners, ...]
    refinements: Mapping[str, tuple[FisheyeCamera, ...]]

    def equalised(self, refinement: str) -> tuple[View, ...]:
        """Return the views of refined cameras with equal brightness.

        No view is made darker, because saturated grey values must remain saturated.
        """
        gains = self.fit.response.coefficients
        gains = gains - [gains.max(), 0, 0]  # a free level, the same in all bands for the colours
        cameras = self.refinements[refinement]
        return tuple(
            view(camera, image, coefficients=own)
            for camera, image, own in zip(cameras, self.images, gains, strict=True)
        )


def load() -> tuple[tuple[FisheyeCamera, ...], tuple[Raster, ...]]:
    """Return the cameras as published, and their photographs.

    Raises
    ------
    ReferenceDataError
        Where a file is missing, or is not the indexed one.
    """
    cameras = tuple(
        files.read(data.path(f"{FILES}/{name}.yaml"), quarter_turns=turns)
        for name, turns in QUARTER_TURNS.items()
    )
    images = (files.read_image(data.path(f"{FILES}/{name}.png")) for name in QUARTER_TURNS)
    return cameras, tuple(images)


def solved() -> Surround:
    """Return the rig with all results from its photographs."""
    return _solved(data.folder())


@cache
def _solved(_folder: Path) -> Surround:
    """Compute the results, once for every folder of reference data."""
    cameras, images = load()
    views = tuple(view(c, image) for c, image in zip(cameras, images, strict=True))
    corners = tuple(find_corners(cameras, views))
    refinements = {
        name: cameras if free is None else refined(cameras, corners, free=free)
        for name, free in REFINEMENTS.items()
    }
    return Surround(
        cameras=cameras,
        images=images,
        views=views,
        fit=fit_response(grey_samples(views), n_heads=len(views), n_bands=3),
        corners=corners,
        refinements=refinements,
    )


# --- tables ----------------------------------------------------------------------------------


def places() -> pd.DataFrame:
    """Return the positions of the cameras from the published homographies.

    Returns
    -------
    DataFrame
        camera, col_cm, row_cm (in the frame), height_cm; ratio and angle_deg of the frame's axes
        in the camera, which are 1 and 90 for the homography of a camera.
    """
    rows = []
    for camera in load()[0]:
        found = place(camera)
        col, row, height = np.round(found.centre_cm, 1)
        rows.append(
            {
                "camera": camera.name,
                "col_cm": col,
                "row_cm": row,
                "height_cm": height,
                "ratio": round(found.ratio, 4),
                "angle_deg": round(float(np.degrees(found.angle)), 2),
            }
        )
    return pd.DataFrame(rows)


def around(views: Sequence[View]) -> list[tuple[int, int]]:
    """Return the overlaps in the order around the car."""
    return sorted(overlapping(views), key=lambda pair: (pair[1] - pair[0] != 1, pair))


def overlaps() -> pd.DataFrame:
    """Return the differences between neighbouring cameras, overlap by overlap.

    Returns
    -------
    DataFrame
        overlap, area_m2; before_percent, after_percent, floor_percent: robust RMS ratio of grey
        values before and after equalisation and from one cell to the next, mean over the bands;
        corners: their number; misfit_cm, largest_cm on the ground and image_misfit_px in the
        images; ghost_cm of an object in the middle of the corners.
    """
    found = solved()
    grey = {(o.head_a, o.head_b): o for o in found.fit.overlaps}
    corners = {(c.camera_a, c.camera_b): c for c in found.corners}
    rows = []
    for a, b in around(found.views):
        pair = [found.cameras[a], found.cameras[b]]
        middle, d = corner_misfits(found.cameras, corners[a, b])
        ghost = ghost_cm(pair, middle.mean(axis=0), height_cm=GHOST_CM)
        rows.append(
            {
                "overlap": f"{pair[0].name}-{pair[1].name}",
                "area_m2": round(float((found.views[a].seen & found.views[b].seen).sum() / 1e4), 2),
                "before_percent": round(100 * float(grey[a, b].before.mean()), 1),
                "after_percent": round(100 * float(grey[a, b].after.mean()), 1),
                "floor_percent": round(100 * float(grey[a, b].floor.mean()), 1),
                "corners": len(d),
                "misfit_cm": round(rms(d), 1),
                "largest_cm": round(float(np.linalg.norm(d, axis=1).max()), 1),
                "image_misfit_px": round(rms(image_misfits(found.cameras, corners[a, b])), 1),
                "ghost_cm": round(ghost, 1),
            }
        )
    return pd.DataFrame(rows)


def refinements() -> pd.DataFrame:
    """Return the effects of refinements on the misfits and on the frame.

    Returns
    -------
    DataFrame
        refinement; misfit_cm of all corners, image_misfit_px in the images, left_out_cm of corners
        that the refinement did not use; moved_cm, moved_most_cm: movement of the target in the
        frame.
    """
    found = solved()
    rows = []
    for name, cameras in found.refinements.items():
        free = REFINEMENTS[name]
        left_out = left_out_misfits(found.cameras, found.corners, free=free) if free else None
        moved = np.concatenate(
            [shift(c, new, target_seen(c)) for c, new in zip(found.cameras, cameras, strict=True)]
        )
        rows.append(
            {
                "refinement": name,
                "misfit_cm": round(_all(corner_misfits(cameras, c)[1] for c in found.corners), 1),
                "image_misfit_px": round(_all(image_misfits(cameras, c) for c in found.corners), 1),
                "left_out_cm": round(_all(left_out), 1) if left_out else np.nan,
                "moved_cm": round(rms(moved), 1),
                "moved_most_cm": round(float(np.linalg.norm(moved, axis=1).max()), 1),
            }
        )
    return pd.DataFrame(rows)


def _all(parts: Iterable[Array]) -> float:
    return rms(np.concatenate(list(parts)))
