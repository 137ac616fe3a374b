"""Tables of the calibrated parameters."""

from __future__ import annotations

import pandas as pd

from acx4book.report.material import Material
from acx4book.report.parameters.estimates import (
    STRONG,
    Estimate,
    correlations,
    estimates,
    joint_tests,
    strong_pairs,
)
from acx4book.report.shown import Text, show, table
from acx4book.report.words import heading, pair_texts, parameter_title
from acx4book.typesetting.labels import group_label, p_value, value_and_sigma, with_unit
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.calibration.estimates import METHODS
from acx4lib.results import folder


def section(material: Material) -> Text:
    """Return the section on the estimates: tests, methods, correlations."""
    matrices = correlation_tables(material)
    return show(
        table(parameter_table(material), SINGLE, name="tab-report-parameters", obtained=ROWS),
        heads_sentence(material),
        table(joint_table(material), JOINT, name="tab-report-joint", obtained=FROM_COVARIANCE),
        table(method_table(material), METHOD, name="tab-report-methods", obtained=ROWS),
        *(
            table(
                matrix, MATRIX + (f", {name}" if len(matrices) > 1 else ""),
                name=f"tab-report-correlations-{number}", obtained=FROM_COVARIANCE,
            )
            for number, (name, matrix) in enumerate(matrices.items(), 1)
        ),
        correlation_sentence(material),
    )  # fmt: skip


SINGLE = "The calibration: parameters, standard deviations and significance"
JOINT = "The same, several parameters tested together"
METHOD = "The same by all methods"
MATRIX = "Correlation matrix of the interior orientation parameters and the mounting"
ROWS = "parameters.csv: estimates and standard deviations, those times σ₀ of their adjustment"
FROM_COVARIANCE = "covariance.csv: the covariance matrix of the calibration"


SIGNIFICANT = {True: "yes", False: "no", None: "–"}
"""Of a parameter beside a declared value nothing is said here: the verdict does."""


def correlation_tables(material: Material) -> dict[str, pd.DataFrame]:
    """Return the full correlation matrix of every camera's parameters, by the camera's name."""
    if not material.calibration:
        return {}
    related = correlations(material, material.calibration)
    rows = folder.rows(material.found, "parameters", material.calibration)
    of_cameras = rows[rows["camera"] != ""].groupby("camera", sort=False)["parameter"]
    return {
        str(camera): _matrix(related, [f"{camera}/{name}" for name in names])
        for camera, names in of_cameras
    }


def _matrix(related: pd.DataFrame, labels: list[str]) -> pd.DataFrame:
    titles = [parameter_title(label) for label in labels]
    values = related.loc[labels, labels].to_numpy()
    rows = [
        [title, *(_correlation(rho, i == j) for j, rho in enumerate(row))]
        for i, (title, row) in enumerate(zip(titles, values, strict=True))
    ]
    return pd.DataFrame(rows, columns=["", *titles])


def _correlation(rho: float, own: bool) -> str:
    if own:
        return "1"
    if abs(rho) < 0.005:
        return "0.00"
    return Markup(f"**{rho:+.2f}**") if abs(rho) > STRONG else f"{rho:+.2f}"


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
            "Significant": SIGNIFICANT[p.significant],
            "Strongest correlation": _strongest(p),
        }
        for p in found
    ]
    return pd.DataFrame(rows)


def _strongest(p: Estimate) -> Markup:
    if not p.strongest:
        return Markup("–")
    return Markup(f"{p.rho:+.2f} with {shown(parameter_title(p.strongest))}")


def heads_sentence(material: Material) -> str:
    """Return a sentence on what errors of the heads add to sigma; empty where none are carried."""
    told = material.found.summary.get(material.calibration, {}).get("sigma_of_heads")
    if not isinstance(told, dict) or not told:
        return ""
    own = {f"{p.camera}/{p.parameter}": p.sigma for p in estimates(material, material.calibration)}
    each = {name: float(s) / own[name] for name, s in told.items() if own.get(name, 0.0) > 0}
    if not each:
        return ""
    most = max(each, key=lambda name: each[name])
    return (
        "The points were carried into the synthetic image by calibrated heads. Errors of this "
        "calibration move all points of a head together, which is not in the σ above. They add "
        f"{min(each.values()):.2g} to {each[most]:.2g} times these σ, most to "
        f"{parameter_title(most.rpartition('/')[2])}; flights that are carried by the same "
        "heads share this error."
    )


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
    return f"Correlations above {STRONG:g}: " + ", ".join(pair_texts(pairs)) + "."


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
    several = len({name for rows in tables.values() for name in rows["camera"] if name}) > 1
    cells: dict[str, dict[str, str]] = {}
    for column, rows in tables.items():
        for _, row in rows.iterrows():
            label = with_unit(parameter_title(str(row["parameter"])), str(row["unit"]))
            if several and row["camera"]:
                label = Markup(f"{shown(row['camera'])} {label}")
            text = value_and_sigma(float(row["value"]), float(row["sigma"]))
            cells.setdefault(label, {})[column] = text
    lines = [
        [label, *(texts.get(column, "held") for column in tables)] for label, texts in cells.items()
    ]
    return pd.DataFrame(lines, columns=["Parameter", *tables])  # a camera may have this name too
