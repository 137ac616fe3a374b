"""Names and short texts of the report."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from acx4book.typesetting.labels import LABELS, TITLES, inside
from acx4book.typesetting.myst import myst_table

STAGES = {"heads": "head", "mounting": "", "validation": "validation,", "synthetic": "synthetic"}

_DRIFT = re.compile(r"gnss_drift_(.+)_(east|north|height)_m_per_(?:min|exposure)", re.DOTALL)


def adjustment_title(name: str) -> str:
    """Return the title for readers of ``stage/method`` or ``heads/bundle/CAM1``."""
    stage, method, *camera = name.split("/", 2)
    if stage == "heads":
        return f"head {camera[0]}" if camera else method.replace("_", " ")
    title = TITLES.get(method, method.replace("_", " "))
    return " ".join([STAGES[stage], inside(title)]).strip()


def heading(name: str) -> str:
    """Return the title of an adjustment for the beginning of a line."""
    return begun(adjustment_title(name))


def begun(text: str) -> str:
    """Return a text with a capital at its beginning; the rest does not change."""
    return text[:1].upper() + text[1:]


def parameter_title(name: str) -> str:
    """Return the title for readers of ``camera/parameter``, or of a parameter alone."""
    if drift := _DRIFT.fullmatch(name):
        return f"GNSS drift of strip {drift[1]}, {drift[2]}"
    return LABELS.get(name.rpartition("/")[2], name)


def listed(names: Sequence[str]) -> str:
    """Return names as part of a sentence: a, b and c."""
    return " and ".join([part for part in (", ".join(names[:-1]), *names[-1:]) if part])


def plural(n: int, noun: str) -> str:
    """Return a number with its noun; zero as a word."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}" if n else f"no {noun}s"


# --- What the parts of the report show beside figures: texts with tables


FORMATS = {
    "σ₀²": ".3f",
    "p": ".3g",
    "Redundancy": ",.0f",
    "Observations": ",",
    "Unknowns": ",",
    "Expected by chance": ".1f",
    "Found and rejected": ",",
    "Number": ",",
    "A priori σ": ",.9g",
    "A posteriori σ": ",.9g",
    "Detectable, median": ",.9g",
    "Detectable, largest": ",.9g",
    "Ratio": ".2f",
    "Mean redundancy": ".2f",
    "Below 0.1": ",",
    "t": ".1f",
    "Largest single t": ".1f",
    "F": ".1f",
    "Mean (m)": "+.3f",
    "Std (m)": ".3f",
    "RMS (m)": ".3f",
    "Predicted (m)": ".3f",
    "Mean / σ": ".1f",
    "σ in plan (m)": ".3f",
    "σ in height (m)": ".3f",
    "in plan (%)": "z.1f",
    "in height (%)": "z.1f",
    "p of the drift": ".2g",
    "p of the strips": ".2g",
}
"""Formats of the numbers, by the name of the column."""

OBTAINED = "How obtained"
"""First words of the line on the source of a table's numbers."""


@dataclass(frozen=True, repr=False)
class Text:
    """Markdown of a part of the report."""

    markdown: str


def table(frame: pd.DataFrame, caption: str, *, name: str, obtained: str = "") -> str:
    """Return a table with its caption and how its numbers were obtained.

    A table without rows is a sentence.
    """
    if frame.empty:
        return f"{caption}: this run has none."
    formats = {column: FORMATS[column] for column in frame.columns if column in FORMATS}
    numbers = frame.columns[frame.columns.str.startswith("w (")]
    drawn = myst_table(
        frame, caption, name=name, formats={**formats, **dict.fromkeys(numbers, ".1f")}
    )
    return f"{drawn}\n\n*{OBTAINED}: {obtained}*" if obtained else drawn


def show(*parts: str) -> Text:
    """Return sentences and tables as the output of a cell."""
    return Text("\n\n".join(part for part in parts if part))
