"""The questions of the verdict in their order; the verdict in one sentence, and as a table."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from acx4book.report.material import Material
from acx4book.report.shown import Text, show, table
from acx4book.report.verdict import adjusted, compared
from acx4book.report.verdict.finding import FAILS, NOTE, Finding
from acx4book.report.words import listed

QUESTIONS = (
    *(adjusted.one_flight, adjusted.converged, adjusted.contradictions, adjusted.determined),
    *(adjusted.global_test, adjusted.weights, adjusted.apart, adjusted.gross_errors),
    *(adjusted.controlled, adjusted.stable),
    *(compared.earlier, compared.mountings, compared.heights, compared.check_points, compared.said),
)

STATES = {"holds": "✓ holds", "fails": "✗ fails", "note": "• note"}


def findings(material: Material) -> list[Finding]:
    """Return the answers to all questions that the results can answer."""
    return [finding for question in QUESTIONS for finding in question(material)]


NOT_EXAMINED = (
    "sharpness and resolving power (MTF)",
    "radiometry: linearity, noise, vignetting, colour",
    "defective pixels, smear, and the readout of a rolling shutter",
    "the camera at temperatures, pressures and focus settings other than those of the flight",
    "the stability of the camera after the flight",
)
"""What certificates of mapping cameras may contain, and no flight over control points shows."""


def section(found: Sequence[Finding]) -> Text:
    """Return the section with the verdict and all answers."""
    answers = table(
        verdict_table(found), "What holds and what does not", name="tab-report-verdict",
        obtained="tests of the results, each as its explanation says",
    )  # fmt: skip
    rest = "; ".join(NOT_EXAMINED)
    return show(
        statement(found),
        answers,
        "**What was not examined.** A flight over control points shows the geometry of the images "
        f"alone. This calibration says nothing of: {rest}.",
    )


def statement(found: Sequence[Finding]) -> str:
    """Return the verdict in one sentence, as Markdown."""
    failed = [f.question for f in found if f.state == FAILS]
    tested = sum(f.state != NOTE for f in found)
    if not failed:
        return f"**The results hold.** All {tested} tests of this report are passed."
    which = listed([name[:1].lower() + name[1:] for name in failed])
    return (
        f"**Not everything holds.** {len(failed)} of {tested} tests "
        f"{'fails' if len(failed) == 1 else 'fail'}: {which}."
    )


def verdict_table(found: Sequence[Finding]) -> pd.DataFrame:
    """Return the table of findings; those that fail come first."""
    order = sorted(found, key=lambda f: f.state != "fails")
    rows = [(f.question, STATES[f.state], f.answer) for f in order]
    return pd.DataFrame(rows, columns=["Question", "Result", "Explanation"])
