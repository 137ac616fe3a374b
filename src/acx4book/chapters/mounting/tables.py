"""Tables of the mounting stage, beside the paper's where they are comparable."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
import pandas as pd

from acx4book.paper import printed
from acx4book.typesetting.labels import LABELS, TITLES, value_and_sigma, with_unit
from acx4book.typesetting.myst import scientific
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import Mounting
from acx4lib.calibration.trust.determination import (
    Pair,
    Part,
    strong_correlations,
    weakest_combination,
)
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight

PRINTED = {"two_step_gnss": "two_step", "single_step": "single_step"}
"""The paper's column that a method is set beside: its two-step sigmas are those of this reading."""

NAMES = LABELS | {f"boresight_{axis}": Markup(f"boresight about ${axis}$") for axis in "xyz"}


def table_3(flight: Flight, methods: Mapping[str, Mounting]) -> pd.DataFrame:
    """Return Table 3: every parameter of every method, beside the printed ones.

    Parameters
    ----------
    flight : Flight
        The paper's columns are shown where it has the paper's cameras.
    methods : mapping of str to Mounting

    Returns
    -------
    DataFrame
        Camera (where there are several), Parameter with its unit, a column per method and per
        print; ``held`` where a method does not estimate what another does.
    """
    cells: dict[tuple[str, str, str], dict[str, str]] = {}
    for method, mounting in methods.items():
        for p in parameters(mounting.calibration):
            row = cells.setdefault((p.camera, p.name, p.unit), {})
            row[TITLES[method]] = value_and_sigma(p.value, p.sigma)
    rows: list[dict[str, str]] = [{"Camera": "", "Parameter": "a posteriori variance"}]
    rows += [
        {"Camera": camera, "Parameter": with_unit(LABELS[name], unit)}
        for camera, name, unit in cells
    ]
    for method, mounting in methods.items():
        found = [f"{mounting.calibration.sigma0_sq:.3f}"]
        found += [row.get(TITLES[method], "held") for row in cells.values()]
        columns = {TITLES[method]: found}
        if method in PRINTED and printed.applies(flight):
            names = ["sigma0_squared", *(name for _, name, _ in cells)]
            columns[printed_title(method)] = [_printed_cell(method, name) for name in names]
        for title, texts in columns.items():
            for row, text in zip(rows, texts, strict=True):
                row[title] = text
    table = pd.DataFrame(rows)
    return table.drop(columns="Camera") if table["Camera"].nunique() <= 2 else table


def printed_title(method: str) -> str:
    """Return the heading of the paper's column beside a method."""
    return f"Printed: {TITLES[PRINTED[method]].lower()}"


def _printed_cell(method: str, name: str) -> str:
    column = PRINTED[method]
    if name not in set(printed.table(3)["parameter"]):
        return ""
    return printed.shown(3, name, column)


def variants(table: pd.DataFrame) -> pd.DataFrame:
    """Return the variants of a calibration with each value and sigma in one cell."""
    names = {"variant": "Variant", "images": "Images", "sigma0_squared": "Variance of unit weight"}
    out = table[list(names)].rename(columns=names)
    variance = out["Variance of unit weight"]
    out["Variance of unit weight"] = [f"{v:.3f}" if np.isfinite(v) else "" for v in variance]
    for name in ("f_mm", "xp_mm", "yp_mm", "lever_x_m", "lever_y_m", "lever_z_m"):
        if name in table:
            out[Markup(f"{LABELS[name]} ({name.rpartition('_')[2]})")] = [
                value_and_sigma(v, s)
                for v, s in zip(table[name], table[f"sigma_{name}"], strict=True)
            ]
    return out


def adjustments(methods: Mapping[str, Mounting]) -> pd.DataFrame:
    """Return size, redundancy and global test of the adjustment behind every method."""
    rows = []
    for method, mounting in methods.items():
        solution, bundle = mounting.bundle.solution, mounting.bundle
        rows.append(
            {
                "Method": TITLES[method],
                "Observations": solution.n_observations,
                "Unknowns": solution.n_unknowns,
                "Redundancy": solution.redundancy,
                "Variance of unit weight": solution.sigma0_sq,
                "p of χ²": solution.chi_square_p,
                "Rejected": len(bundle.rejected),
                "Left out": sum(bundle.network.left_out.values()),
            }
        )
    return pd.DataFrame(rows)


def determination(methods: Mapping[str, Mounting]) -> pd.DataFrame:
    """Return condition, weakest combination and strong correlations of every method."""
    rows = []
    for method, mounting in methods.items():
        several = len(mounting.calibration.cameras) > 1
        label = partial(_label, with_camera=several)
        parts = weakest_combination(mounting.bundle)
        pairs = strong_correlations(mounting.calibration)
        rows.append(
            {
                "Method": TITLES[method],
                "Condition": scientific(mounting.bundle.solution.condition),
                "Weakest combination": Markup("; ".join(_part(part, label) for part in parts)),
                "Correlations above 0.9": Markup("; ".join(_pair(pair, label) for pair in pairs)),
            }
        )
    return pd.DataFrame(rows)


def _part(part: Part, label: Callable[[str], str]) -> str:
    return f"{label(part.unknown)} {100 * part.share:.0f} %"


def _pair(pair: Pair, label: Callable[[str], str]) -> str:
    size = f"{pair.correlation:+.2f}".replace("-", "\N{MINUS SIGN}")
    return f"{label(pair.row)}, {label(pair.column)} {size}"


def _label(name: str, *, with_camera: bool) -> str:
    """Return what a reader sees for ``camera/parameter`` or for an unknown of the poses."""
    camera, _, parameter = name.rpartition("/")
    label = shown(NAMES.get(parameter, parameter))
    return f"{shown(camera)} {label}" if camera and with_camera else label


def attitude_sigma_deg(block: Block) -> Array:
    """Return the median standard deviation of roll, pitch and heading, degrees, shape (3,)."""
    return np.degrees(np.median(block.trajectory.sigma_attitude, axis=0))
