"""The questions of the verdict in their order; the verdict in one sentence, and as a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4book.report.material import Material
from acx4book.report.shown import Text, show, table
from acx4book.report.verdict import adjusted, compared
from acx4book.report.verdict.consequences import CONSEQUENCES, UNKNOWN, by_gravity
from acx4book.report.verdict.finding import FAILS, LEVEL, Finding, all_tests, judged
from acx4book.report.verdict.weak import weak
from acx4book.report.words import plural
from acx4book.typesetting.labels import p_value

QUESTIONS = (
    *(adjusted.one_flight, adjusted.converged, adjusted.contradictions, adjusted.determined),
    weak,
    *(adjusted.global_test, adjusted.weights, adjusted.estimated_weights, adjusted.apart),
    *(adjusted.gross_errors, adjusted.controlled, adjusted.stable),
    *(compared.earlier, compared.mountings, compared.heights, compared.check_points),
    *(adjusted.other_methods, compared.said),
)

STATES = {"holds": "✓ holds", "fails": "✗ fails", "note": "• note"}


def findings(material: Material) -> list[Finding]:
    """Return the answers to all questions that the results can answer, all tests at one level."""
    return judged(finding for question in QUESTIONS for finding in question(material))


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
        obtained=OBTAINED,
    )  # fmt: skip
    rest = "; ".join(NOT_EXAMINED)
    return show(
        statement(found),
        answers,
        "**What was not examined.** A flight over control points shows the geometry of the images "
        f"alone. This calibration says nothing of: {rest}.",
    )


OBTAINED = (
    "tests of the results, each as its explanation says; p is the smallest probability of a test "
    "by itself, p joint the same among all tests of this report, by Holm"
)


def statement(found: Sequence[Finding]) -> str:
    """Return the verdict, as Markdown: what fails, what that means, and what to do."""
    failed = [f.question for f in found if f.state == FAILS]
    if not failed and not all_tests(found):
        return (
            "**Nothing was tested.** These results hold nothing that could be compared with what "
            "is expected of it, so this report neither confirms nor refutes them."
        )
    if not failed:
        return f"**The results hold.** {level(found)}"
    gravest, *rest = by_gravity(failed)
    means, cure = CONSEQUENCES.get(gravest, UNKNOWN)
    whole = f"**Not everything holds. “{gravest}” fails: {means}; {cure}.**"
    others = "\n".join(f"- “{q}” fails, too: {CONSEQUENCES.get(q, UNKNOWN).cure}." for q in rest)
    return "\n\n".join(part for part in (whole, others, level(found)) if part)


def level(found: Sequence[Finding]) -> str:
    """Say how many tests were made, and with which probability right results fail any."""
    tests = all_tests(found)
    n = sum(test.fails for test in tests)
    if not tests:
        return "No statistical test was made."
    return (
        f"{n or 'None'} of {plural(len(tests), 'test')} {'fails' if n < 2 else 'fail'}. "
        f"The tests share an error probability of {100 * LEVEL:g} % (Holm): of right results with "
        f"right standard deviations, at most {100 * LEVEL:g} % fail any of them."
    )


def verdict_table(found: Sequence[Finding]) -> pd.DataFrame:
    """Return the table of findings; those that fail come first."""
    order = sorted(found, key=lambda f: f.state != FAILS)
    rows = [(f.question, STATES[f.state], _p(f.p), _p(f.p_joint), f.answer) for f in order]
    return pd.DataFrame(rows, columns=["Question", "Result", "p", "p joint", "Explanation"])


def _p(p: float) -> str:
    return "" if np.isnan(p) else p_value(p)
