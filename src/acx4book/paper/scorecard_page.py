"""The scorecard as a page of the book."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4book.paper import printed as paper
from acx4book.paper.scorecard import INPUT, RULE, counts, scorecard
from acx4book.typesetting.labels import LABELS, TITLES, value_and_sigma, with_unit
from acx4book.typesetting.myst import myst_table, scientific
from acx4book.typesetting.plain_text import Markup, shown
from acx4lib.flight.reader import Flight
from acx4lib.results import folder

GIVEN = (
    "The flight of the study is not public. This copy of the book was made from a simulated one, "
    "over the study's own block design, computed from exact geometry by code that shares nothing "
    "with the estimator. {doc}`reproducibility` says what the simulation was given. A number that "
    "was given and comes back tests the software, and says nothing about the study. What was not "
    "given says something about both: the standard deviations, but for the two choices that were "
    "made to meet those of Table 3, the shifts between the methods, and the accuracy on "
    "independent points."
)


def page(found: folder.Results, flight: Flight, *, simulated: bool) -> str:
    """Return the scorecard as MyST text: the rule, the counts, and every number by table.

    Parameters
    ----------
    found : Results
    flight : Flight
        If it is not the simulated flight of the paper's design, its own parameters are listed
        instead.
    simulated : bool
        Whether the truth of the flight is known.
    """
    if not (simulated and paper.applies(flight)):
        return _own_parameters(found, flight)
    card = scorecard(found, flight)
    parts = [
        GIVEN,
        _summed_up(card, flight),
        RULE,
        myst_table(_titled(counts(card)), "The verdicts, by table and role", name="tab-verdicts"),
    ]
    for number, lines in card.groupby("table"):
        name = f"tab-card-{number}"
        caption = f"The paper's Table {number}, number by number"
        notes = list(dict.fromkeys(reason for reason in lines["reason"] if reason))
        table = myst_table(_shown(lines, notes), caption, name=name, formats={"off by": ".1f"})
        why = "\n".join(f"- **({_letter(i)})** {note}." for i, note in enumerate(notes))
        title = f"The paper's Table {number}: {len(lines)} numbers"
        parts.append(f"::::{{dropdown}} {title}\n\n{table}\n\n{why}\n::::")
    return "\n\n".join(parts) + "\n"


def _summed_up(card: pd.DataFrame, flight: Flight) -> str:
    """Return sentences on the numbers that agree, and on the largest differences."""
    agrees = card["verdict"] == "agrees"
    given = card["role"] == INPUT
    return (
        f"The simulation was given {int(given.sum())} of the {len(card)} printed numbers as "
        f"*input*, and {int((agrees & given).sum())} of these agree. The other "
        f"{int((~given).sum())} are *independent*, and {int((agrees & ~given).sum())} of them "
        "agree. Three things stand out:\n\n"
        f"- {_sigma_of_table_3(card, flight)}\n- {_shift_of_methods(card)}\n"
        f"- {_rms_of_table_4(card)}\n\n"
        "Where a number differs, the tables below say why, as far as it is understood."
    )


def _pick(card: pd.DataFrame, table: int, quantity: str, column: str) -> tuple[float, float]:
    """Return a printed number and ours."""
    row = card[
        (card["table"] == table) & (card["quantity"] == quantity) & (card["column"] == column)
    ]
    return float(row["printed"].iloc[0]), float(row["ours"].iloc[0])


def _sigma_of_table_3(card: pd.DataFrame, flight: Flight) -> str:
    is_sigma = (card["table"] == 3) & card["quantity"].str.startswith("sigma of")
    of_interest = card[is_sigma & (card["column"] == "single_step")]
    ratio = of_interest["ours"] / of_interest["printed"]
    block = flight.calibration
    gnss = np.nan if block is None else np.median(block.trajectory.sigma_position)
    return (
        f"The {len(ratio)} standard deviations of the single-step method come out between "
        f"{ratio.min():.2f} and {ratio.max():.2f} times the printed ones. The number of tie points "
        f"and a GNSS noise of about {100 * gnss:.2g} cm were chosen for that: the paper gives no "
        "number, and a larger noise. That one choice serves all of them shows that Table 3 is "
        "consistent with the paper's block."
    )


def _shift_of_methods(card: pd.DataFrame) -> str:
    shifts = []
    for name in ("f_mm", "xp_mm", "yp_mm"):
        two, single = _pick(card, 3, name, "two_step"), _pick(card, 3, name, "single_step")
        shifts.append(f"{two[1] - single[1]:+.4f} ({two[0] - single[0]:+.4f}) mm in {LABELS[name]}")
    return (
        f"The two-step interior orientation differs from the single-step one by "
        f"{', '.join(shifts)} (printed in brackets): it has absorbed the lever arm that it could "
        "not see. Of the two readings of the two-step method computed here, only the bundle with "
        "GNSS positions does so."
    )


def _rms_of_table_4(card: pd.DataFrame) -> str:
    plan = [_pick(card, 4, f"rms_{axis}_m", "single_step") for axis in ("east", "north")]
    height = _pick(card, 4, "rms_height_m", "single_step")
    printed, ours = (float(np.hypot(plan[0][k], plan[1][k])) for k in (0, 1))
    return (
        f"The RMS of the check points in plan is {printed:.2f} m in print and {ours:.2f} m here, "
        f"in height {height[0]:.2f} m and {height[1]:.2f} m. Ours is what the simulated noise "
        "predicts. The paper's RMS, scatter and count of small errors contradict each other "
        "({doc}`_executed/06-errata`)."
    )


def _own_parameters(found: folder.Results, flight: Flight) -> str:
    """Return the parameters from the run of another flight."""
    listed = found.parameters
    table = pd.DataFrame(
        {
            "method": listed["stage"] + "/" + listed["method"],
            "camera": listed["camera"],
            "parameter": [
                with_unit(_label(name), unit)
                for name, unit in zip(listed["parameter"], listed["unit"], strict=True)
            ],
            "estimate": [
                value_and_sigma(v, s) for v, s in zip(listed["value"], listed["sigma"], strict=True)
            ],
        }
    )
    said = (
        f"This copy of the book was made from the flight *{shown(flight.name)}*, which is not the "
        "study's: the paper's numbers do not stand beside its own. Where the pages speak of the "
        "paper, they explain the method."
    )
    return f"{said}\n\n{myst_table(table, 'What was estimated', name='tab-estimated')}\n"


def _titled(table: pd.DataFrame) -> pd.DataFrame:
    return table.rename(columns={"table": "the paper's table"})


def _letter(i: int) -> str:
    return chr(ord("a") + i)


def _shown(lines: pd.DataFrame, notes: Sequence[str]) -> pd.DataFrame:
    """Return the columns of the card for readers; reasons are letters that refer to notes."""
    ours = [
        value_and_sigma(v, s) if s > 0 else f"{v:.4g}" if v % 1 else f"{v:.0f}"
        for v, s in zip(lines["ours"], lines["sigma"], strict=True)
    ]
    return pd.DataFrame(
        {
            "quantity": [
                with_unit(_label(q), u)
                for q, u in zip(lines["quantity"], lines["unit"], strict=True)
            ],
            "column": [_column_title(c) for c in lines["column"]],
            "printed": [_plain(v) for v in lines["printed"]],
            "ours": ours,
            "off by": lines["deviation"],
            "role": lines["role"],
            "verdict": [
                f"{said}\N{NO-BREAK SPACE}({_letter(notes.index(reason))})" if reason else said
                for said, reason in zip(lines["verdict"], lines["reason"], strict=True)
            ],
        }
    )


def _label(quantity: str) -> str:
    name = quantity.removeprefix("sigma of ")
    label = LABELS.get(name, name)
    if name == quantity:
        return label
    return Markup(label.replace("mean", "scatter") if "mean" in label else f"σ of {shown(label)}")


def _column_title(column: str) -> str:
    return TITLES.get(column, column)


def _plain(value: float) -> str:
    """Return a number as text, with a power of ten if it is very small."""
    return scientific(value, digits=2) if 0 < abs(value) < 1e-3 else f"{value:.9g}"
