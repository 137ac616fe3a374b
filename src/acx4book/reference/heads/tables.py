"""Tables of the chapter, with headings for readers."""

from __future__ import annotations

import pandas as pd

from acx4book.typesetting import myst
from acx4book.typesetting.plain_text import Markup

_ANGLE, _SIGNED = ".3f", "+z.3f"


def rotations(table: pd.DataFrame, caption: str, *, name: str) -> str:
    """Return the heads' rotations and their sigma as MyST."""
    shown = pd.DataFrame(
        {
            "head": table["head"],
            "to": table["reference"],
            **{f"{axis} (°)": table[f"{axis}_deg"] for axis in "xyz"},
            **{f"σ {axis} (°)": table[f"{axis}_sigma_deg"] for axis in "xyz"},
        }
    )
    formats = {column: ".4f" if "σ" in column else _ANGLE for column in shown.columns[2:]}
    return myst.myst_table(shown, Markup(caption), name=name, formats=formats)


def beside(table: pd.DataFrame, caption: str, *, name: str) -> str:
    """Return the heads' rotations less those of the factory, and of the trial, as MyST."""
    columns: dict[str, pd.Series] = {}
    for whose in ("factory", "trial"):
        if not table[f"x_minus_{whose}_deg"].isna().all():
            columns |= {f"{whose} {a} (°)": table[f"{a}_minus_{whose}_deg"] for a in "xyz"}
    shown = pd.DataFrame({"head": table["head"], "to": table["reference"], **columns})
    formats = dict.fromkeys(columns, _SIGNED)
    return myst.myst_table(shown, Markup(caption), name=name, formats=formats)


def readings(table: pd.DataFrame, caption: str, *, name: str) -> str:
    """Return the readings of the factory's angles as MyST."""
    shown = table.rename(
        columns={
            "median_px": "median (px)",
            "least_px": "of the best head (px)",
            "largest_px": "of the worst head (px)",
        }
    )
    formats = dict.fromkeys(shown.columns[1:], ".2f")
    return myst.myst_table(shown, Markup(caption), name=name, formats=formats)


def places(table: pd.DataFrame, caption: str, *, name: str) -> str:
    """Return what the free places of the heads take from the rotations, as MyST."""
    shown = pd.DataFrame(
        {
            "head": table["head"],
            "to": table["reference"],
            "columns (px)": table["x_px"],
            "rows (px)": table["y_px"],
            "columns, places free (px)": table["x_left_px"],
            "rows, places free (px)": table["y_left_px"],
            "base along columns (mm)": table["base_x_mm"],
            "base against rows (mm)": table["base_y_mm"],
        }
    )
    formats = {column: "+.2f" if "px" in column else "+.0f" for column in shown.columns[2:]}
    return myst.myst_table(shown, Markup(caption), name=name, formats=formats)
