"""What flew, beside what the paper says of its flight (section 3)."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.paper import printed as paper
from acx4lib.flight.block import Block
from acx4lib.flight.design import Level, levels
from acx4lib.flight.reader import Flight

PRINTED: dict[tuple[str, int], dict[str, str]] = {
    ("heads", 0): {
        "strips": "block_1_high_strips",
        "images": "block_1_high_images",
        "height": "block_1_high_m",
        "gsd": "block_1_high_gsd_m",
        "forward": "block_1_forward_overlap",
    },
    ("heads", 1): {
        "strips": "block_1_low_strips",
        "images": "block_1_low_images",
        "height": "block_1_low_m",
        "gsd": "block_1_low_gsd_m",
        "forward": "block_1_forward_overlap",
        "side": "block_1_side_overlap",
        "directions": "block_1_low_directions",
    },
    ("calibration", 0): {
        "strips": "block_2_high_strips",
        "images": "block_2_high_images",
        "height": "block_2_high_m",
        "gsd": "block_2_high_gsd_m",
        "forward": "block_2_forward_overlap",
        "side": "block_2_high_side_overlap",
    },
    ("calibration", 1): {
        "strips": "block_2_low_strips",
        "images": "block_2_low_images",
        "height": "block_2_low_m",
        "gsd": "block_2_low_gsd_m",
        "forward": "block_2_forward_overlap",
        "side": "block_2_low_side_overlap",
    },
    ("validation", 0): {
        "strips": "block_3_strips",
        "height": "block_3_m",
        "gsd": "block_3_gsd_m",
        "forward": "block_3_forward_overlap",
    },
}
"""The paper's statements on a block and its levels, the highest first."""

PRINTED_IMAGES = {
    "heads": "block_1_images",
    "calibration": "block_2_images",
    "validation": "block_3_images",
}
PRINTED_POINTS = {
    "heads": "field_points",
    "calibration": "field_points",
    "validation": "check_points",
}


def _beside(ours: float, printed: str | None, *, digits: int = 0, scale: float = 1.0) -> str:
    """Return our number with the paper's in brackets; empty where ours is not known."""
    if not np.isfinite(ours):
        return ""
    said = "" if printed is None else f" ({scale * paper.statement(printed):g})"
    return f"{ours:.{digits}f}{said}"


def level_table(flight: Flight) -> pd.DataFrame:
    """Return the blocks by flying height, in brackets what the paper says of its own.

    Overlaps and ground pixels are those of the synthetic images where there are any.

    Parameters
    ----------
    flight : Flight
    """
    rows = []
    for name in flight.blocks:
        for i, level in enumerate(levels(flight.mounted(name))):
            said = PRINTED.get((name, i), {}) if paper.applies(flight) else {}
            rows.append({"Block": name, **_level_cells(level, said)})
    return pd.DataFrame(rows)


def _level_cells(level: Level, said: dict[str, str]) -> dict[str, str]:
    get = said.get
    strips = float(len([strip for strip in level.strips if strip]) or np.nan)
    per_strip = level.images_per_strip if np.isfinite(strips) else np.nan
    return {
        "Flying height (m)": _beside(level.height_m, get("height")),
        "Ground pixel (cm)": _beside(100 * level.gsd_m, get("gsd"), digits=1, scale=100),
        "Strips": _beside(strips, get("strips")),
        "Directions": _beside(level.n_directions, get("directions")),
        "Images per strip": _beside(per_strip, get("images"), digits=int(per_strip % 1 > 0)),
        "Forward overlap (%)": _beside(100 * level.forward_overlap, get("forward")),
        "Side overlap (%)": _beside(100 * level.side_overlap, get("side")),
    }


def content_table(flight: Flight) -> pd.DataFrame:
    """Return what every block holds, in brackets what the paper says of its own.

    Parameters
    ----------
    flight : Flight
    """
    rows = []
    for name, block in flight.blocks.items():
        said = paper.applies(flight)
        rays = block.rays[block.rays > 0]
        surveyed = float(len(block.control) + len(block.check))
        per_camera = len(block.images) / len(block.cameras)
        digits = int(per_camera % 1 > 0)
        rows.append(
            {
                "Block": name,
                "Cameras": ", ".join(camera.name for camera in block.cameras),
                "Images each": _beside(
                    per_camera, PRINTED_IMAGES.get(name) if said else None, digits=digits
                ),
                "Surveyed": _beside(surveyed, PRINTED_POINTS.get(name) if said else None),
                "of these check": f"{len(block.check)}",
                "Tie points": f"{len(rays) - surveyed:.0f}",
                "Measured": f"{len(block.image_points)}",
                "Images per point": f"{rays.mean():.1f}" if len(rays) else "",
            }
        )
    return pd.DataFrame(rows)


def sigma_table(flight: Flight) -> pd.DataFrame:
    """Return the medians of the standard deviations with which every block comes."""
    return pd.DataFrame(
        [{"Block": name, **_sigmas(block)} for name, block in flight.blocks.items()]
    )


def _sigmas(block: Block) -> dict[str, float]:
    surveyed = np.concatenate([block.control.sigma_m, block.check.sigma_m])
    trajectory = block.trajectory
    attitude = np.degrees(trajectory.sigma_attitude)
    return {
        "Image points (px)": _median(block.image_points.sigma_px),
        "Survey, plan (m)": _median(surveyed[:, :2]),
        "height (m)": _median(surveyed[:, 2]),
        "GNSS, plan (m)": _median(trajectory.sigma_position[:, :2]),
        "its height (m)": _median(trajectory.sigma_position[:, 2]),
        "Roll, pitch (deg)": _median(attitude[:, :2]),
        "heading (deg)": _median(attitude[:, 2]),
    }


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else np.nan
