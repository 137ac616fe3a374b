"""What the paper says of its flight (section 3), in the form of the tables of a flight."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.paper import printed as paper
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

COLUMNS = {
    "height above ground (m)": ("height", 1),
    "ground pixel (cm)": ("gsd", 100),
    "strips": ("strips", 1),
    "directions": ("directions", 1),
    "images per strip": ("images", 1),
    "forward overlap (%)": ("forward", 1),
    "side overlap (%)": ("side", 1),
}
"""Columns of `design.level_table`: their names in `PRINTED`, and the factor to their unit."""


def beside_paper(flown: pd.DataFrame, flight: Flight) -> pd.DataFrame:
    """Return levels of blocks, each above what the paper says of its own.

    Parameters
    ----------
    flown : DataFrame
        By ``block`` and ``level``, as `design.level_table` has them.
    flight : Flight
        Without the paper's cameras nothing is added.
    """
    table = flown.copy()
    if paper.applies(flight):
        said = pd.DataFrame([_said(*key) for key in flown.index], index=flown.index)
        said = said.dropna(how="all")
        both = pd.concat({"flown": flown, "paper": said}, names=["of"])
        order = [
            (of, *key)
            for key in flown.index
            for of in ("flown", "paper")
            if of == "flown" or key in said.index
        ]
        table = both.loc[order].reorder_levels(["block", "level", "of"])
    table.attrs["formats"] = {
        **dict.fromkeys(table, ".0f"),
        "ground pixel (cm)": ".1f",
        "images per strip": ".3g",
    }
    return table


def _said(block: str, level: int) -> dict[str, float]:
    names = PRINTED.get((block, level - 1), {})
    return {
        column: factor * paper.statement(names[key]) if key in names else np.nan
        for column, (key, factor) in COLUMNS.items()
    }


def printed_contents(flight: Flight) -> pd.DataFrame:
    """Return the paper's numbers of images and of surveyed points, to be joined by the block."""
    names = list(flight.blocks) if paper.applies(flight) else []
    said = {
        "paper: images each": {n: paper.statement(PRINTED_IMAGES[n]) for n in names},
        "paper: surveyed": {n: paper.statement(PRINTED_POINTS[n]) for n in names},
    }
    found = pd.DataFrame(said, index=pd.Index(names, name="block", dtype=object))
    return found if names else found[[]]
