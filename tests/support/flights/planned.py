"""Plans for tests: one of a single camera, and changes of it."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

CAMERA = {
    "width_px": 11608,
    "height_px": 8708,
    "pixel_um": 4.6,
    "focal_mm": 50.0,
    "mount_kappa_deg": 90.0,
}

LINES = {
    "north": {"course_deg": 0.0, "left_m": 150.0},
    "south": {"course_deg": 180.0, "left_m": -150.0},
    "east": {"course_deg": 90.0, "forward_m": 100.0},
    "west": {"course_deg": 270.0, "forward_m": -100.0},
}
"""Places of four strips around the middle of the field."""


def strip(line: str, height_m: float = 600.0, *, n: int = 6, overlap: float = 0.75):
    """Return a strip of n images."""
    base = (1 - overlap) * height_m * 40.0568 / 50.0
    return {
        "flying_height_m": height_m,
        "length_m": (n - 1) * base,
        "base_m": base,
        **LINES[line],
    }


def values(**changes: Any) -> dict[str, Any]:
    """Return a plan of two heights and two pairs of opposite strips, with changed tables.

    A table that is given replaces the keys that it has.
    """
    whole = {
        "name": "two heights",
        "crs": "EPSG:32633",
        "heights": "ellipsoidal",
        "cameras": {"CAM": dict(CAMERA)},
        "apriori": {
            "image_point_px": 0.4,
            "gnss_horizontal_m": 0.02,
            "gnss_vertical_m": 0.03,
            "roll_pitch_deg": 0.006,
            "heading_deg": 0.015,
        },
        "stages": {
            "mounting": {
                "estimate": ["f_mm", "xp_mm", "yp_mm", "k1", "k2", "p1", "p2"],
                "fix": [],
            }
        },
        "field": {
            "east_m": 385000.0,
            "north_m": 5518000.0,
            "height_m": 430.0,
            "relief_m": 20.0,
        },
        "control": {"number": [3, 3], "area_m": [800.0, 800.0]},
        "calibration": {
            "tie_points": 400,
            "tie_area_m": [1200.0, 1200.0],
            "strips": {
                "low-1": strip("north"),
                "low-2": strip("south"),
                "high-1": strip("east", 1000.0),
                "high-2": strip("west", 1000.0),
            },
        },
    }
    for name, table in deepcopy(changes).items():
        whole[name] = {**whole.get(name, {}), **table} if isinstance(table, dict) else table
    return whole
