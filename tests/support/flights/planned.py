"""Plans for tests: one of a single camera, and eight unlike the study's flights."""

from __future__ import annotations

import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning import plan as plans
from acx4book.planning.flown import simulate
from acx4sim import files
from acx4sim.plan import Options

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


def strip(line: str, height_m: float = 600.0, *, overlap: float = 0.75):
    """Return a strip of six images."""
    base = (1 - overlap) * height_m * 40.0568 / 50.0
    return {
        "flying_height_m": height_m,
        "length_m": 5 * base,
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


# --- eight flights that are unlike the study's, each of which lacks something ------------------


CHECKED = {
    "east_m": 386500.0,
    "strips": {"map-1": strip("north"), "map-2": strip("south")},
}
"""A block for the validation; it needs a number of check points."""

HELD = {"stages": {"mounting": {"estimate": ["f_mm"], "fix": ["lever_arm", "boresight"]}}}

PARALLEL = {
    "width_px": 1280,
    "height_px": 960,
    "pixel_um": 3.75,
    "focal_mm": 4.0,
    "mount_kappa_deg": 90.0,
}


def _plans() -> dict[str, dict[str, Any]]:
    """Return the plans by what is said of the flight."""
    low = {"low-1": strip("north"), "low-2": strip("south")}
    far = {
        **{name: strip | {"left_m": strip.get("left_m", 0.0)} for name, strip in low.items()},
        "far-1": strip("north") | {"forward_m": 300_000.0, "left_m": 150.0},
        "far-2": strip("south") | {"forward_m": -300_000.0, "left_m": -150.0},
    }
    heads = {f"B{k}": dict(PARALLEL) for k in range(1, 5)}
    low_heads = {
        "tie_points": 150,
        "tie_area_m": [300.0, 300.0],
        "strips": {
            name: {
                "flying_height_m": 120.0,
                "length_m": 100.0,
                "base_m": 20.0,
                "course_deg": course,
            }
            for name, course in (("a", 0.0), ("b", 90.0), ("c", 180.0))
        },
    }
    synthetic = {
        "cameras": {**heads, "S": dict(PARALLEL)},
        "synthetic": {"camera": "S", "heads": list(heads)},
        "heads": low_heads,
    }
    plans = {
        "no check point": values(),
        "one strip, one check point": values(
            calibration={"strips": {"only": strip("north")}},
            validation={**CHECKED, "check": {"number": 1, "layout": "corners", "area_m": [1, 1]}},
        ),
        "one height, three check points": values(
            calibration={"strips": low},
            validation={
                **CHECKED,
                "check": {"number": 3, "layout": "corners", "area_m": [300, 300]},
            },
        ),
        "nothing estimated": values(
            stages={"mounting": {"estimate": [], "fix": ["lever_arm", "boresight"]}}
        ),
        "mounting held": values(**HELD),
        "parallel heads": values(**synthetic, control={"number": [3, 3], "area_m": [150, 150]}),
        "heads without control": values(**synthetic),
        "300 km": values(calibration={"strips": far}),
    }
    for of_heads in ("parallel heads", "heads without control"):
        plans[of_heads].pop("calibration")
        plans[of_heads].pop("stages")
    plans["heads without control"].pop("control")
    return plans


NAMES = tuple(_plans())

CHECKED_INSIDE = {"mounting held": ("P01", "P05", "P09")}
"""Points of a block for the calibration that are check points there."""


def write(name: str, folder: Path) -> Path:
    """Write one of the flights below a folder; it does not say that it is simulated."""
    plan = plans.from_values(_plans()[name])
    flown = simulate(plan, seed=4, options=Options())
    path = folder / re.sub(r"\W+", "-", name)
    files.write(flown, path)
    if name in CHECKED_INSIDE:
        table = pd.read_csv(path / "control_points.csv")
        inside = table["point"].isin(CHECKED_INSIDE[name])
        table["role"] = np.where(inside, "check", "control")
        table.to_csv(path / "control_points.csv", index=False)
    toml = path / "flight.toml"
    said = re.sub(r"(?m)^simulated = true\n", "", toml.read_text("utf-8"))
    toml.write_text(said.replace(", simulated", ""), "utf-8")
    Path(f"{path}.truth.json").unlink(missing_ok=True)
    return path
