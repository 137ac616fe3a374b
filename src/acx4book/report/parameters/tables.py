"""Tables of the calibrated parameters."""

from __future__ import annotations

import pandas as pd

from acx4book.report.material import Material
from acx4book.report.parameters.estimates import (
    STRONG,
    Estimate,
    estimates,
    joint_tests,
    strong_pairs,
)
from acx4book.report.words import heading, pair_text, parameter_title
from acx4book.typesetting.labels import group_label, p_value, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration.estimates import METHODS
from acx4lib.results import folder


def parameter_table(material: Material) -> pd.DataFrame:
    """Return the parameters of the calibration with sigma, test and strongest correlation."""
    if not material.calibration:
        return pd.DataFrame()
    found = estimates(material, material.calibration)
    several = len({p.camera for p in found}) > 1
    rows = [
        {
            **({"Camera": p.camera} if several else {}),
            "Parameter": with_unit(parameter_title(p.parameter), p.unit),
            "Value and σ": value_and_sigma(p.value, p.sigma),
            "Against": f"{p.reference:g}",
            "t": p.t,
            "Significant": "yes" if p.significant else "no",
            "Strongest correlation": _strongest(p),
        }
        for p in found
    ]
    return pd.DataFrame(rows)


def _strongest(p: Estimate) -> Markup:
    if not p.strongest:
        return Markup("–")
    return Markup(f"{p.rho:+.2f} with {shown(parameter_title(p.strongest))}")


def joint_table(material: Material) -> pd.DataFrame:
    """Return the tests of several parameters of the calibration at once."""
    found = joint_tests(material, material.calibration) if material.calibration else []
    several = len({test.camera for test in found}) > 1
    rows = [
        {
            **({"Camera": test.camera} if several else {}),
            "Parameters": group_label(test.keys),
            "Largest single t": test.largest,
            "F": test.f_ratio,
            "Degrees of freedom": f"{len(test.keys)}; {test.redundancy:,}",
            "p": p_value(test.p),
        }
        for test in found
    ]
    return pd.DataFrame(rows)


def correlation_sentence(material: Material) -> str:
    """Return a sentence on parameters that can hardly be separated."""
    if not material.calibration:
        return ""
    pairs = strong_pairs(material, material.calibration)
    if not pairs:
        return f"No correlation exceeds {STRONG:g}."
    return f"Correlations above {STRONG:g}: " + ", ".join(pair_text(pair) for pair in pairs) + "."


def method_table(material: Material) -> pd.DataFrame:
    """Return the parameters of all methods of the mounting stage side by side."""
    names = [f"mounting/{m}" for m in METHODS if f"mounting/{m}" in material.adjustments]
    names.sort(key=lambda name: name != material.calibration)
    if len(names) < 2:
        return pd.DataFrame()
    return _side_by_side(
        {heading(name): folder.rows(material.found, "parameters", name) for name in names}
    )


def head_table(material: Material, stage_method: str) -> pd.DataFrame:
    """Return the parameters of every head, a column per head; empty without heads."""
    if not folder.has(material.found, stage_method):
        return pd.DataFrame()
    rows = folder.rows(material.found, "parameters", stage_method)
    heads = rows.groupby("camera", sort=False)
    return _side_by_side({str(name): own.assign(camera="") for name, own in heads})


def _side_by_side(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Return parameters with sigma, a column per table; a parameter without a row is held."""
    several = len({name for table in tables.values() for name in table["camera"] if name}) > 1
    cells: dict[str, dict[str, str]] = {}
    for column, table in tables.items():
        for _, row in table.iterrows():
            label = with_unit(parameter_title(str(row["parameter"])), str(row["unit"]))
            if several and row["camera"]:
                label = Markup(f"{shown(row['camera'])} {label}")
            text = value_and_sigma(float(row["value"]), float(row["sigma"]))
            cells.setdefault(label, {})[column] = text
    rows = [
        [label, *(texts.get(column, "held") for column in tables)] for label, texts in cells.items()
    ]
    return pd.DataFrame(rows, columns=["Parameter", *tables])  # a camera may have this name too
