"""How well the observations of a block control each other, for readers."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.typesetting.labels import LABELS, UNITS, inside
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors.rejections import noncentrality
from acx4lib.bundle.reliability import WEAK, parameter_effects, reliability
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Index
from acx4lib.results.rows import COMPONENTS

GROUPS = {
    "image_point": "Image points",
    "control_point": "Control points",
    "gnss": "GNSS positions",
    "attitude": "Attitudes",
    "distance": "Distances",
}
"""Names of the kinds of observations."""

FORMATS = {
    "Observation": "",
    "Number": "",
    "Redundancy, least": ".2f",
    "Median": ".2f",
    f"Below {WEAK:g} (%)": ".1f",
    "Detectable, median": ".3g",
    "Largest": ".3g",
    "Effect (σ)": ".2f",
    "On": "",
}
"""The columns of the table, and the formats of their numbers."""

PARAMETERS = {
    **{name: LABELS[name] for name in ("k1", "k2", "k3", "p1", "p2", "b1")},
    **{name: LABELS[f"{name}_mm"] for name in ("f", "xp", "yp")},
    **{f"lever_{axis}": LABELS[f"lever_{axis}_m"] for axis in "xyz"},
    **{f"boresight_{axis}": Markup(f"boresight about ${axis}$") for axis in "xyz"},
}
"""Names of the unknowns that every image shares."""


def reliability_table(mounting: Mounting | None) -> pd.DataFrame:
    """Return the reliability of every component of every group of observations.

    Parameters
    ----------
    mounting : Mounting or None
        None where a method gave no result; the table then has no rows.

    Returns
    -------
    DataFrame
        Redundancy numbers; the minimal detectable bias in the unit of the observation; the
        largest effect of such a bias on any parameter of the cameras, in that parameter's sigma,
        and which parameter it is.
    """
    if mounting is None:
        return pd.DataFrame(columns=list(FORMATS))
    bundle = mounting.bundle
    columns = _camera_columns(bundle)
    rows = []
    for group, effect in zip(
        bundle.solution.groups, parameter_effects(bundle, columns), strict=True
    ):
        found = reliability(group)
        for d, component in enumerate(COMPONENTS[group.kind]):
            used = np.isfinite(found.redundancy[:, d])
            if used.any():
                unit = np.degrees(1.0) if group.kind == "attitude" else 1.0
                bias = unit * found.detectable[used, d]
                rows.append(
                    _row(group.kind, component, found.redundancy[used, d], bias)
                    | _largest(bundle, columns, np.abs(effect[used, d]))
                )
    return pd.DataFrame(rows, columns=list(FORMATS))


def _camera_columns(bundle: Bundle) -> Index:
    """Return the columns of the unknowns that images share."""
    layout = bundle.network.layout
    columns = np.concatenate([layout.interior.ravel(), layout.mount.ravel()])
    return columns[columns >= 0]


def _row(kind: str, component: str, r: Array, bias: Array) -> dict[str, object]:
    name, _, unit = component.rpartition("_")
    return {
        "Observation": f"{GROUPS[kind]}, {name} ({UNITS.get(unit, unit)})",
        "Number": len(r),
        "Redundancy, least": float(r.min()),
        "Median": float(np.median(r)),
        f"Below {WEAK:g} (%)": 100 * float(np.mean(r < WEAK)),
        "Detectable, median": float(np.median(bias)),
        "Largest": float(bias.max()),
    }


def _largest(bundle: Bundle, columns: Index, effect: Array) -> dict[str, object]:
    """Return the largest effect on a parameter, in sigmas, and on which."""
    if len(columns) == 0:
        return {"Effect (σ)": np.nan, "On": ""}
    which = int(np.argmax(effect.max(axis=0)))
    camera, name = bundle.network.column_names()[columns[which]].rsplit("/", 1)
    several = len(bundle.network.block.cameras) > 1
    label = PARAMETERS[name]
    return {
        "Effect (σ)": float(effect.max()),
        "On": Markup(f"{shown(camera)} {label}") if several else label,
    }


def largest_effect(table: pd.DataFrame) -> str:
    """Say what the worst of the errors that no test finds would do.

    Parameters
    ----------
    table : DataFrame
        As `reliability_table` returns it.
    """
    known = table.dropna(subset=["Effect (σ)"])
    if known.empty:
        return "No parameter of a camera is estimated, so no error moves one."
    worst = known.iloc[int(np.argmax(known["Effect (σ)"]))]
    if np.isinf(worst["Effect (σ)"]):
        return (
            f"Nothing controls an observation in {_within(worst['Observation'])}: an error there "
            f"is not found, and moves {shown(worst['On'])} by as much as it pleases."
        )
    return (
        f"An error is found with a probability of 80 % where it is {noncentrality():.2f} standard "
        "deviations over the root of the redundancy number. Of all the errors that just escape "
        f"the tests, none moves a parameter by more than {worst['Effect (σ)']:.2f} of its standard "
        f"deviations: that one is in {_within(worst['Observation'])} and moves "
        f"{shown(worst['On'])}."
    )


def _within(observation: str) -> str:
    """Return a group's name and component inside a sentence, without the unit."""
    name = observation.rpartition(" (")[0]
    return name if name.startswith("GNSS") else inside(name)
