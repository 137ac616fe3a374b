"""Tables of the chapter: the pictures, and the camera beside its truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup
from acx4lib.calibration.mounting import Mounting
from acx4lib.flight.block import Block


def pictures(block: Block) -> pd.DataFrame:
    """Return a row for every picture, with its measurements."""
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
    table = pd.DataFrame(rows)
    table.attrs["formats"] = {"heading (°)": ".0f", "height (m)": ".0f"}
    return table


def camera(mounting: Mounting, truth: Sequence[float]) -> pd.DataFrame:
    """Return the estimated parameters with their standard deviations, beside the truth.

    Parameters
    ----------
    mounting : Mounting
    truth : sequence of float
        As `whole.Whole.truth` returns it.
    """
    table = mounting.table()
    table["truth"] = [_exact(value) for value in truth]
    table["difference / σ"] = (table["value"] - np.array(truth)) / table["sigma"]
    table.attrs["formats"] = {"difference / σ": "+.1f"}
    return table


def _exact(value: float) -> Markup:
    """Return a value that is exact, with all its digits."""
    text = scientific(value, digits=1) if abs(value) < 1e-3 else f"{value:.6g}"
    return Markup(text.replace("-", "\N{MINUS SIGN}"))
