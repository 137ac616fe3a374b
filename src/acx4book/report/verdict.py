"""The statement at the top of a report: `verdict` asks, the other modules answer.

`adjusted` judges the adjustments by themselves, `compared` what they are held against: declared
mountings, heights, check points. An answer is a `finding`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from acx4book.report import findings as report_findings
from acx4book.report.findings import (
    CONSEQUENCES,
    FAILS,
    LEVEL,
    NOTE,
    UNKNOWN,
    Finding,
    all_tests,
    by_gravity,
    judged,
)
from acx4book.report.material import Material, sentences, validated
from acx4book.report.words import Text, plural, show, table
from acx4book.typesetting.labels import p_value

# --- Parameters that are determined, but weakly


def weak(material: Material) -> Iterator[Finding]:
    """Name the weak parameters of the calibration: why, and what would determine them."""
    names = (*material.decisive, validated(material))
    found = [
        line.partition(": ")[2]
        for line in sentences(material, "weak")
        if line.startswith(tuple(f"{name}: " for name in names))
    ]
    if found:
        answer = "; ".join(dict.fromkeys(found)) + "."
        yield Finding(question="Weak parameters", state=NOTE, answer=answer)


# --- The questions of the verdict in their order; the verdict in one sentence, and as a table


QUESTIONS = (
    *(
        report_findings.one_flight,
        report_findings.converged,
        report_findings.contradictions,
        report_findings.determined,
    ),
    weak,
    *(
        report_findings.global_test,
        report_findings.weights,
        report_findings.estimated_weights,
        report_findings.apart,
    ),
    *(report_findings.gross_errors, report_findings.controlled, report_findings.stable),
    *(
        report_findings.earlier,
        report_findings.mountings,
        report_findings.heights,
        report_findings.check_points,
    ),
    *(report_findings.other_methods, report_findings.said),
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
