"""How well the observations of a block control each other, for readers."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.typesetting.labels import LABELS, UNITS, inside
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors.rejections import noncentrality
from acx4lib.bundle.reliability import WEAK
from acx4lib.calibration.mounting import Mounting
from acx4lib.calibration.trust.detectable import Detectable, detectable
from acx4lib.results.files.schemas import COMPONENTS
from acx4lib.results.rows import unit_of

GROUPS = {
    "image_point": "Image points",
    "control_point": "Control points",
    "gnss": "GNSS positions",
    "attitude": "Attitudes",
    "distance": "Distances",
    "lever_arm": "Declared lever arm",
    "boresight": "Declared boresight",
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
    rows = [_row(mounting.bundle, found) for found in detectable(mounting.bundle)]
    return pd.DataFrame(rows, columns=list(FORMATS))


def _row(bundle: Bundle, found: Detectable) -> dict[str, object]:
    name, _, unit = COMPONENTS[found.kind][found.component].rpartition("_")
    if found.kind in ("lever_arm", "boresight"):
        name = f"{'about' if found.kind == 'boresight' else 'along'} {'xyz'[found.component]}"
    bias = unit_of(found.kind, found.component) * found.bias
    return {
        "Observation": f"{GROUPS[found.kind]}, {name} ({UNITS.get(unit, unit)})",
        "Number": len(bias),
        "Redundancy, least": float(found.redundancy.min()),
        "Median": float(np.median(found.redundancy)),
        f"Below {WEAK:g} (%)": 100 * float(np.mean(found.redundancy < WEAK)),
        "Detectable, median": float(np.median(bias)),
        "Largest": float(bias.max()),
        "Effect (σ)": found.effect,
        "On": _parameter(bundle, found.on),
    }


def _parameter(bundle: Bundle, name: str) -> str:
    """Return the parameter of a camera for readers; the camera's name only where it matters."""
    if not name:
        return ""
    camera, key = name.rsplit("/", 1)
    several = len(bundle.network.block.cameras) > 1
    return Markup(f"{shown(camera)} {PARAMETERS[key]}") if several else PARAMETERS[key]


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
