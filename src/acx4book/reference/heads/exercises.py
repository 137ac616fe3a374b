"""Solutions of the exercises: each found in two ways."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acx4book.notebooks.solution import Solution
from acx4book.reference.heads.parallax import predicted_px
from acx4lib.exchange.pictures import lens
from acx4lib.exchange.pictures.tags import Tags
from acx4lib.geometry.camera import Camera, Interior, colrow_from_xy
from acx4lib.geometry.collinearity import pinhole

F_PX, PIXEL_MM = 1459.0, 0.00375


def two_heights() -> Solution:
    """Compare the parallax of 25 mm at 55 m and at 120 m, also by projecting a point."""
    low, high = (predicted_px(0.025, height_m=h, f_px=F_PX) for h in (55.0, 120.0))
    f_mm = F_PX * PIXEL_MM
    camera = Camera(
        name="H", width_px=1280, height_px=960, pixel_mm=PIXEL_MM, interior=Interior(f=f_mm)
    )
    xyz = np.array([[base, 0.0, -h] for h in (55.0, 120.0) for base in (0.0, 0.025)])
    col = colrow_from_xy(camera, pinhole(f_mm, xyz))[:, 0]
    return Solution(
        text=(
            f"{low:.2f} px at 55 m, {high:.2f} px at 120 m. Heads that are turned to fit at one of "
            f"the heights miss each other by {low - high:.2f} px at the other."
        ),
        value=low - high,
        again=float(col[1] - col[0] - (col[3] - col[2])),
    )


def high_enough() -> Solution:
    """Return from which height a base of 30 mm shifts an image by less than a tenth of a pixel."""
    by_hand = F_PX * 0.03 / 0.1
    shift = [predicted_px(0.03, height_m=h, f_px=F_PX) for h in range(1, 1000)]
    again = 1 + next(i for i, px in enumerate(shift) if px < 0.1)
    return Solution(
        text=f"From {by_hand:.0f} m on. A camera like this flies at 60 to 120 m.",
        value=by_hand,
        again=float(again),
    )


def unit_of_focal_length() -> Solution:
    """Read a focal length that is written once in mm and once in pixels."""
    found = [lens.focal_px(_tags(value), PIXEL_MM) for value in ("5.47125", "1459")]
    wrong = 2 * np.degrees(np.arctan(1280 * PIXEL_MM / 2 / 1459.0))
    right = 2 * np.degrees(np.arctan(1280 / 2 / F_PX))
    return Solution(
        text=(
            f"5.47125 mm over {1000 * PIXEL_MM:g} µm are {found[0]:.0f} px: a field of "
            f"{right:.0f}° over 1280 columns. 1459 mm would be a telescope with a field of "
            f"{wrong:.2f}°. "
            "A number above a tenth of the columns is in pixels."
        ),
        value=found[0],
        again=found[1],
    )


def _tags(focal: str) -> Tags:
    return Tags(
        path=Path("IMG_0001_1.tif"),
        width_px=1280,
        height_px=960,
        samples=1,
        bits=16,
        exif={},
        xmp={lens.FOCAL: (focal,)},
        sha256="",
    )
