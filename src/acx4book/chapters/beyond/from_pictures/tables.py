"""Tables of the chapter: the pictures, and the camera beside its truth."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.from_pictures.whole import Whole
from acx4book.typesetting.labels import LABELS, value_and_sigma, with_unit
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup


def pictures(whole: Whole) -> pd.DataFrame:
    """Return a row for every picture, with its measurements."""
    block = whole.block
    points, rays = block.image_points, block.rays
    control = np.isin(points.point_idx, block.control.point_idx)
    surveyed = np.median(block.control.x_m[:, 2])
    rows = []
    for k, (name, strip) in enumerate(zip(block.images.names, block.images.strips, strict=True)):
        own = points.image_idx == k
        pose = block.T_m_b_images[k : k + 1]
        nose = pose.R[0] @ [1.0, 0, 0]
        tie = own & ~control
        rows.append(
            {
                "picture": name,
                "strip": strip,
                "heading (°)": float(np.degrees(np.arctan2(nose[0], nose[1])) % 360),
                "height (m)": float(pose.r[0, 2] - surveyed),
                "tie points": int(tie.sum()),
                "of 3 rays and more": int(np.sum(rays[points.point_idx[tie]] >= 3)),
                "control points": int(np.sum(own & control)),
            }
        )
    return pd.DataFrame(rows)


PICTURE_FORMATS = {"heading (°)": ".0f", "height (m)": ".0f"}


def camera(whole: Whole) -> pd.DataFrame:
    """Return the estimated parameters with their standard deviations, beside the truth."""
    rows = []
    for one in whole.parameters:
        off = (one.value - whole.truth[one.name]) / one.sigma
        rows.append(
            {
                "parameter": with_unit(LABELS[one.name], one.unit),
                "estimate": value_and_sigma(one.value, one.sigma),
                "truth": _truth(whole.truth[one.name]),
                "difference / σ": off,
            }
        )
    return pd.DataFrame(rows)


def _truth(value: float) -> Markup:
    """Return a value that is exact, with all its digits."""
    return Markup(scientific(value, digits=1) if abs(value) < 1e-3 else f"{value:.6g}")


CAMERA_FORMATS = {"difference / σ": "+.1f"}
