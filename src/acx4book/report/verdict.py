"""Findings and verdict of a report: questions with their tests, judged at one joint level."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from acx4book.report.words import listed, plural
from acx4book.typesetting.myst import numbers, p_value, sections
from acx4lib.least_squares.verdict import (
    FAILS,
    HOLDS,
    LEVEL,
    MINOR,
    UNTESTED,
    gravest,
    verdicts,
)

NOTE = "note"
"""State of what is information; the others are those of a `verdict`."""

# --- a question with its tests, and one level for all of them --------------------------------


@dataclass(frozen=True, kw_only=True)
class ChanceTest:
    """One statistical test behind a finding.

    Attributes
    ----------
    name : str
        What is tested.
    p : float
        Probability of such a value, or a more extreme one, where everything is right.
    said : str
        What is said where it is significant.
    size, limit, unit : float, float, str
        Size of what is found, and that from which it matters. Of many observations, a σ that is
        wrong by a hundredth is significant. By default every size matters.
    p_joint : float
        Of the same among all tests of the report, by Holm; comparable with `LEVEL`. NaN before
        all tests are known.
    state : str
        Of its verdict among all tests.
    """

    name: str
    p: float
    said: str
    size: float = np.inf
    limit: float = 0.0
    unit: str = "%"
    p_joint: float = np.nan
    state: str = UNTESTED

    @property
    def measured(self) -> str:
        """The probability, the size and its limit, in words."""
        p, size = p_value(self.p), measure(self.size, self.unit) if self.size else "less"
        limit = measure(self.limit, self.unit)
        return f"p {p if p.startswith('<') else f'= {p}'}; {size}, limit {limit}"


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One statement of the verdict, in plain text.

    Attributes
    ----------
    question : str
    state : str
        `HOLDS`, `MINOR`, `FAILS`, `UNTESTED`, where the answer has the reason, or `NOTE` for
        information. A finding with tests has the gravest state of these.
    answer : str
        One or two sentences.
    passed : str
        What is added where no test is significant.
    tests : tuple of ChanceTest
        Empty where nothing depends on chance.
    restriction : str
        What the results can be used for where the state is `MINOR`; by default for all.
    is_cause : bool
        Whether other questions fail by what this one found, so that it is named first.
    """

    question: str
    state: str = HOLDS
    answer: str = ""
    passed: str = ""
    tests: tuple[ChanceTest, ...] = ()
    restriction: str = ""
    is_cause: bool = False

    @property
    def p(self) -> float:
        """Smallest probability of its tests; NaN without any."""
        return min((test.p for test in self.tests), default=np.nan)

    @property
    def p_joint(self) -> float:
        """Smallest probability of its tests among all tests of the report; NaN without any."""
        return min((test.p_joint for test in self.tests), default=np.nan)


def judged(findings: Iterable[Finding]) -> list[Finding]:
    """Judge the findings by all their tests jointly, at one level, by Holm.

    Parameters
    ----------
    findings : iterable of Finding
        Their tests are not judged; those without a probability are left out.
    """
    drafts = [replace(f, tests=tuple(t for t in f.tests if np.isfinite(t.p))) for f in findings]
    columns = np.array([(t.p, t.size, t.limit) for f in drafts for t in f.tests]).reshape(-1, 3)
    found = iter(verdicts(*columns.T))
    known = (
        tuple(
            replace(test, p_joint=verdict.p_joint, state=verdict.state)
            for test, verdict in zip(f.tests, found, strict=False)  # the next of all verdicts
        )
        for f in drafts
    )
    return [_answered(replace(f, tests=tests)) for f, tests in zip(drafts, known, strict=True)]


def _answered(finding: Finding) -> Finding:
    """Return a finding with state and answer from its tests."""
    if not finding.tests:
        return finding
    said = {
        state: "; ".join(
            t.said if state == FAILS and t.unit == "%" else f"{t.said} ({t.measured})"
            for t in finding.tests
            if t.state == state
        )
        for state in (FAILS, MINOR)
    }
    parts = (
        finding.answer,
        f"Significant: {said[FAILS]}." if said[FAILS] else "",
        f"Rejected, but below the size that matters: {said[MINOR]}." if said[MINOR] else "",
        "" if said[FAILS] or said[MINOR] else finding.passed,
    )
    state = gravest([finding.state, *(test.state for test in finding.tests)])
    return replace(finding, state=state, answer=" ".join(filter(None, parts)))


def measure(value: float, unit: str) -> str:
    """Return a size with its unit; a share in percent."""
    return f"{100 * value:.2g} %" if unit == "%" else f"{value:.2g} {unit}"


# --- the verdict: what fails, what it means for a user of the calibration, and what to do ----


class Failure(NamedTuple):
    """A question that fails, what that means, and the cure; both continue a sentence."""

    question: str
    means: str
    cure: str


TEXT = Path(__file__).with_name("consequences.md")

CONSEQUENCES = {
    question: Failure(question, *text.split("\n\n")) for question, text in sections(TEXT).items()
}
"""By question, the gravest first; the first meaning covers the later ones, too."""

UNKNOWN = ("the results must not be used before the cause is known", "see below")

NOT_EXAMINED = (
    "sharpness and resolving power (MTF)",
    "radiometry: linearity, noise, vignetting, colour",
    "defective pixels, smear, and the readout of a rolling shutter",
    "the camera at temperatures, pressures and focus settings other than those of the flight",
    "the stability of the camera after the flight",
)
"""Properties in certificates of mapping cameras that a flight over control cannot show."""


def statement(found: Sequence[Finding]) -> dict[str, Any]:
    """Return the verdict of findings.

    Returns
    -------
    dict
        ``holds``; ``state``: `FAILS`, `MINOR` with a restriction, `UNTESTED` where nothing was
        tested, or `HOLDS`; ``title``, the verdict in a few words; ``failures``, the gravest or the
        cause first, whose meaning covers the others; ``restrictions``, for what the results can be
        used, if not for all; ``sentences``, all of this in words, with the level of the tests.
    """
    failed = [f for f in found if f.state == FAILS]
    tests = [test for finding in found for test in finding.tests]
    limits = [f.restriction for f in found if f.state == MINOR and f.restriction and not failed]
    failures = [
        CONSEQUENCES.get(f.question, Failure(f.question, *UNKNOWN))
        for f in sorted(failed, key=_gravity)
    ]
    state, title = HOLDS, "The results hold"
    if failed:
        state, title = FAILS, "Not everything holds"
    elif not tests:
        state, title = UNTESTED, "Nothing was tested"
    elif limits:
        state, title = MINOR, "The results hold, with a restriction"
    return {
        "holds": not failed,
        "state": state,
        "title": title,
        "failures": [failure._asdict() for failure in failures],
        "restrictions": limits,
        "sentences": [
            *(f"“{f.question}” fails: {f.means}; {f.cure}." for f in failures[:1]),
            *(f"“{f.question}” fails, too: {f.cure}." for f in failures[1:]),
            *limits,
            _level(tests),
        ],
    }


def _gravity(finding: Finding) -> tuple[int, bool, int]:
    """Return the place of a finding: by its state, what explains others first, by its meaning."""
    meanings = [*CONSEQUENCES]
    known = finding.question in meanings
    place = meanings.index(finding.question) if known and finding.state == FAILS else -1
    return [*STATES].index(finding.state), not finding.is_cause, place


def _level(tests: Sequence[ChanceTest]) -> str:
    """State the number of tests, and the probability that right results fail any."""
    if not tests:
        return "No statistical test was made: this report neither confirms nor refutes the results."
    n, minor = (sum(test.state == state for test in tests) for state in (FAILS, MINOR))
    rejected = f"; {minor} rejected, but below the size that matters" if minor else ""
    return (
        f"{n or 'None'} of {plural(len(tests), 'test')} {'fails' if n < 2 else 'fail'}{rejected}. "
        f"The tests share an error probability of {100 * LEVEL:g} % (Holm): of right results with "
        f"right standard deviations, at most {100 * LEVEL:g} % fail any of them."
    )


STATES = {
    FAILS: "✗ fails",
    MINOR: "≈ rejected, below {}",
    HOLDS: "✓ holds",
    UNTESTED: "– not tested",
    NOTE: "• note",
}
"""The states in words, in the order of the table."""


def rows(found: Iterable[Finding]) -> Iterator[dict[str, str]]:
    """Yield the texts of the findings, the gravest first.

    Yields
    ------
    dict of str to str
        ``question``, ``state``; ``result``, the state in words, of `MINOR` with the sizes from
        which it matters; ``p``, joint; ``answer``.
    """
    for f in sorted(found, key=_gravity):
        minor = [measure(test.limit, test.unit) for test in f.tests if test.state == MINOR]
        result = STATES[f.state].format(listed([*dict.fromkeys(minor)]))
        p = "" if np.isnan(f.p_joint) else p_value(f.p_joint)
        texts = {"question": f.question, "state": f.state, "result": result}
        yield texts | {"p": p, "answer": numbers(f.answer)}
