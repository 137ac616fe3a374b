"""Tables of the same measurements with a synthetic image and without one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import heights, study
from acx4book.chapters.beyond.synthetic_cost.study import RIG, SYNTHETIC, Study
from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup

ACCURACY_FORMATS = {
    f"{what}, {way}": ".3f" for what in ("RMS (m)", "Predicted (m)") for way in (SYNTHETIC, RIG)
}
HEIGHT_FORMATS = {
    "Flying height (m)": ".0f",
    "RMS (px)": ".2f",
    "Largest (px)": ".2f",
    "Largest step at a seam (px)": ".2f",
    "That step on the ground (cm)": ".0f",
}
SQUARE_ROWS = ("f_mm", "k1", "k2", "k3", "p1", "p2", "lever_x_m", "lever_y_m", "lever_z_m")
"""Parameters of the table of squares; a boresight does not depend on them."""

PAPER = "Paper's Table 3"

HEIGHTS_M = (700.0, 1000.0, 1250.0, 1500.0, 2000.0, 3000.0)
"""Flying heights of the table."""


def accuracy_table(found: Study) -> pd.DataFrame:
    """Return RMS and predicted sigma at check points for both ways, and how much larger one is."""
    rows = [
        {
            "Over": row["over"],
            "Axis": row["axis"].removesuffix("_m"),
            **{f"RMS (m), {way}": row[f"rms_{way}"] for way in (SYNTHETIC, RIG)},
            **{f"Predicted (m), {way}": row[f"sigma_{way}"] for way in (SYNTHETIC, RIG)},
            "Larger by (%)": value_and_sigma(row["percent"], row["sigma_percent"]),
        }
        for row in study.accuracy(found).to_dict("records")
    ]
    return pd.DataFrame(rows)


def parameter_table(found: Study) -> pd.DataFrame:
    """Return the synthetic camera beside Table 3: mean, scatter over flights and stated sigma."""
    rows = [
        {
            "Parameter": with_unit(LABELS[row["parameter"]], unit(row["parameter"])),
            PAPER: printed.shown(3, row["parameter"], "single_step"),
            "Mean and scatter over flights": value_and_sigma(row["mean"], row["scatter"]),
            "Scatter over stated σ": f"{row['ratio']:.2f} ± {row['sigma_ratio']:.2f}",
        }
        for row in study.scatter(found, SYNTHETIC).to_dict("records")
    ]
    return pd.DataFrame(rows)


def print_of(parameter: str) -> tuple[float, float]:
    """Return a value of Table 3's single step, and its sigma."""
    of = 3, parameter, "single_step"
    return printed.value(*of), printed.sigma(*of)


def unit(parameter: str) -> str:
    """Return the unit of a parameter of Table 3."""
    rows = printed.table(3)
    return str(rows.loc[rows["parameter"] == parameter, "unit"].iloc[0])


def height_table(found: Study, heights_m: Iterable[float] = HEIGHTS_M) -> pd.DataFrame:
    """Return what the synthetic camera leaves at several flying heights.

    Parameters
    ----------
    found : Study
    heights_m : iterable of float
        Above the ground.
    """
    rows = []
    for height_m in heights_m:
        own = heights.at_height(found.pattern, height_m)
        step = heights.largest_step_px(own)
        ground_cm = 100 * height_m * printed.pixel_mm("SYN") / print_of("f_mm")[0]
        numbers = height_m, heights.rms_px(own), heights.largest_px(own), step, step * ground_cm
        rows.append(dict(zip(HEIGHT_FORMATS, numbers, strict=True)))
    return pd.DataFrame(rows)


def square_table(found: Study) -> pd.DataFrame:
    """Return what exact data give for squares of lens centres of different size, and Table 3."""
    sides = {side: f"Square of {100 * side:.0f} cm" for side in np.unique(found.squares["side_m"])}
    cells = {
        (row["parameter"], row["side_m"]): value_and_sigma(row["value"], row["sigma"])
        for row in found.squares.to_dict("records")
    }
    rows = [
        {"Parameter": with_unit(LABELS[name], unit(name))}
        | {title: cells[name, side] for side, title in sides.items()}
        | {PAPER: printed.shown(3, name, "single_step")}
        for name in SQUARE_ROWS
    ]
    factor = found.squares[found.squares["parameter"] == "sigma0_squared"].set_index("side_m")
    factors = {title: f"{factor['value'][side]:.4f}" for side, title in sides.items()}
    return pd.DataFrame([*rows, {"Parameter": LABELS["sigma0_squared"], **factors}])


SHIFTED = {"f_mm": "f", "xp_mm": "x_p", "yp_mm": "y_p"}
"""What the two-step method shifts where it holds a lever arm at zero, and its symbol."""


def shifts(found: Study) -> pd.DataFrame:
    """Return how far the two-step method with GNSS moves f, x_p, y_p, by place of lens centres.

    Returns
    -------
    DataFrame
        A row for each place: side_m, lowered_m, lever_z_m of the single step, and for each name of
        `SHIFTED` the shift against the single step and, as expected_NAME, the one that its lever
        arm must cause; all mm.
    """
    rows = []
    for (side, lowered), own in found.centres.groupby(["side_m", "lowered_m"]):
        by = own.pivot_table(index="parameter", columns="method", values="value")
        shift = by["two_step_gnss"] - by["single_step"]
        row = {"side_m": side, "lowered_m": lowered, "lever_z_m": by["single_step"]["lever_z_m"]}
        row |= {name: shift[name] for name in SHIFTED}
        rows.append(row | {f"expected_{name}": by["expected"][name] for name in SHIFTED})
    return pd.DataFrame(rows)


def shift_table(found: Study) -> pd.DataFrame:
    """Return `shifts` for readers, with the paper's in the last row."""
    titles = {name: Markup(f"${symbol}$ (mm)") for name, symbol in SHIFTED.items()}
    places = [
        {
            PLACES: _place(row["side_m"], row["lowered_m"]),
            LEVER_Z: _signed(row["lever_z_m"], 3),
            **{
                title: f"{_signed(row[name], 4)} ({_signed(row[f'expected_{name}'], 4)})"
                for name, title in titles.items()
            },
        }
        for row in shifts(found).to_dict("records")
    ]
    own: dict[str, str] = {t: _signed(print_shift(n), 4) for n, t in titles.items()}
    of_paper: dict[str, str] = {
        PLACES: "paper",
        LEVER_Z: _signed(print_of("lever_z_m")[0], 3),
        **own,
    }
    return pd.DataFrame([*places, of_paper])


PLACES, LEVER_Z = "Lens centres", Markup("Lever arm $z$ (m)")


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}f}".replace("-", "\N{MINUS SIGN}")


def print_shift(name: str) -> float:
    """Return the printed two-step value of a parameter less the single-step one."""
    two, single = (printed.value(3, name, method) for method in ("two_step", "single_step"))
    return two - single


def _place(side_m: float, lowered_m: float) -> str:
    if not side_m:
        return "in one point"
    lower = f", {100 * lowered_m:.0f} cm lower" if lowered_m else ""
    return f"square of {100 * side_m:.0f} cm{lower}"
