"""The scorecard as a page of the book."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4lib import paper, results
from acx4lib.flight import Flight
from acx4lib.report import myst_table, scientific
from acx4lib.scorecard import INPUT, RULE, counts, scorecard
from acx4lib.tables import LABELS, TITLES, value_and_sigma


def page(found: results.Results, flight: Flight) -> str:
    """Return the scorecard as MyST text: the rule, the counts, and every number by table.

    Parameters
    ----------
    found : Results
    flight : Flight
        Where it is not of the paper's design, its own parameters are listed instead.
    """
    if not paper.applies(flight):
        return _own_parameters(found, flight)
    card = scorecard(found, flight)
    parts = [
        _summed_up(card),
        RULE,
        myst_table(_titled(counts(card)), "The verdicts, by table and role", name="tab-verdicts"),
    ]
    for number, lines in card.groupby("table"):
        name = f"tab-card-{number}"
        caption = f"The paper's Table {number}, number by number"
        notes = list(dict.fromkeys(reason for reason in lines["reason"] if reason))
        table = myst_table(_shown(lines, notes), caption, name=name, formats={"off by": ".1f"})
        why = "\n".join(f"- **{_letter(i)}** {note}." for i, note in enumerate(notes))
        parts.append(
            f"::::{{dropdown}} Table {number}: {len(lines)} numbers\n\n{table}\n\n{why}\n::::"
        )
    return "\n\n".join(parts) + "\n"


def _summed_up(card: pd.DataFrame) -> str:
    """Say how many numbers agree, and what stands out."""
    agrees = card["verdict"] == "agrees"
    given = card["role"] == INPUT
    return (
        f"The simulation was given {int(given.sum())} of the {len(card)} printed numbers as "
        f"*input*; {int((agrees & given).sum())} of these are recovered, which proves the "
        f"software, not the paper. The other {int((~given).sum())} are *independent*, and "
        f"{int((agrees & ~given).sum())} of them agree. Three things stand out:\n\n"
        f"- {_sigma_of_table_3(card)}\n- {_shift_of_methods(card)}\n- {_rms_of_table_4(card)}"
    )


def _pick(card: pd.DataFrame, table: int, quantity: str, column: str) -> tuple[float, float]:
    """Return the printed number and ours."""
    row = card[
        (card["table"] == table) & (card["quantity"] == quantity) & (card["column"] == column)
    ]
    return float(row["printed"].iloc[0]), float(row["ours"].iloc[0])


def _sigma_of_table_3(card: pd.DataFrame) -> str:
    is_sigma = (card["table"] == 3) & card["quantity"].str.startswith("sigma of")
    of_interest = card[is_sigma & (card["column"] == "single_step")]
    ratio = of_interest["ours"] / of_interest["printed"]
    return (
        f"All {len(ratio)} standard deviations of the single-step method come out between "
        f"{ratio.min():.2f} and {ratio.max():.2f} times the printed ones. The number of tie points "
        "and a GNSS noise of about 2 cm were chosen for that, since the paper gives neither; that "
        "one choice serves all of them is the evidence."
    )


def _shift_of_methods(card: pd.DataFrame) -> str:
    shifts = []
    for name in ("f_mm", "xp_mm", "yp_mm"):
        two, single = _pick(card, 3, name, "two_step"), _pick(card, 3, name, "single_step")
        shifts.append(f"{two[1] - single[1]:+.4f} ({two[0] - single[0]:+.4f}) mm in {LABELS[name]}")
    return (
        f"The two-step interior orientation differs from the single-step one by "
        f"{', '.join(shifts)} (printed in brackets): it has absorbed the lever arm that it could "
        "not see, which happens only in a bundle with GNSS positions."
    )


def _rms_of_table_4(card: pd.DataFrame) -> str:
    plan = [_pick(card, 4, f"rms_{axis}_m", "single_step") for axis in ("east", "north")]
    height = _pick(card, 4, "rms_height_m", "single_step")
    printed, ours = (float(np.hypot(plan[0][k], plan[1][k])) for k in (0, 1))
    return (
        f"The RMS of the check points in plan is {printed:.2f} m in print and {ours:.2f} m here, "
        f"in height {height[0]:.2f} m and {height[1]:.2f} m. The accuracy that the paper states "
        "for its sensors predicts ours in plan; its own numbers contradict each other."
    )


def _own_parameters(found: results.Results, flight: Flight) -> str:
    """Return the parameters that a foreign flight's run found."""
    listed = found.parameters
    table = pd.DataFrame(
        {
            "method": listed["stage"] + "/" + listed["method"],
            "camera": listed["camera"],
            "parameter": listed["parameter"],
            "estimate": [
                value_and_sigma(v, s) for v, s in zip(listed["value"], listed["sigma"], strict=True)
            ],
            "unit": listed["unit"],
        }
    )
    said = (
        f"This copy of the book was made from the flight *{flight.name}*, which is not of the "
        "paper's design, so the paper's numbers do not stand beside its own."
    )
    return f"{said}\n\n{myst_table(table, 'What was estimated', name='tab-estimated')}\n"


def _titled(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(table=[f"Table {n}" for n in table["table"]])


def _letter(i: int) -> str:
    return chr(ord("a") + i)


def _shown(lines: pd.DataFrame, notes: Sequence[str]) -> pd.DataFrame:
    """Return the columns of the card that a reader sees; reasons are letters of the notes."""
    ours = [
        value_and_sigma(v, s) if s > 0 else f"{v:g}"
        for v, s in zip(lines["ours"], lines["sigma"], strict=True)
    ]
    return pd.DataFrame(
        {
            "quantity": [_label(q) for q in lines["quantity"]],
            "column": [_column_title(c) for c in lines["column"]],
            "unit": lines["unit"],
            "printed": [_plain(v) for v in lines["printed"]],
            "ours": ours,
            "off by": lines["deviation"],
            "role": lines["role"],
            "verdict": lines["verdict"],
            "why": [_letter(notes.index(r)) if r else "" for r in lines["reason"]],
        }
    )


def _label(quantity: str) -> str:
    name = quantity.removeprefix("sigma of ")
    label = LABELS.get(name, name)
    if name == quantity:
        return label
    return label.replace("mean", "scatter") if "mean" in label else f"σ of {label}"


def _column_title(column: str) -> str:
    return TITLES.get(column, column)


def _plain(value: float) -> str:
    """Return a printed number as one reads it."""
    return scientific(value, digits=2) if 0 < abs(value) < 1e-3 else f"{value:.9g}"
