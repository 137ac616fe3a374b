"""The questions of the verdict: their answers, the tests behind them, and one level for all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.least_squares.statistical.many_tests import holm

HOLDS, FAILS, NOTE = "holds", "fails", "note"

LEVEL = 0.05
"""Probability that anything fails in the report of a right flight: that of all tests together."""


MATTERS = 1.1
"""Factor of errors over their σ from which a difference matters: the run reports the same."""


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
    relevant : bool
        Whether what is found is large enough to matter. Of many observations, a σ that is wrong by
        a hundredth is significant.
    p_joint : float
        Of the same among all tests of the report, by Holm; comparable with `LEVEL`. NaN before
        all tests are known.
    """

    name: str
    p: float
    said: str
    relevant: bool = True
    p_joint: float = np.nan

    @property
    def significant(self) -> bool:
        """Whether it is more than chance among all tests of the report."""
        return self.p_joint < LEVEL

    @property
    def fails(self) -> bool:
        """Whether it is more than chance, and matters."""
        return self.significant and self.relevant


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One statement of the verdict.

    Attributes
    ----------
    question : str
        The question.
    state : str
        `HOLDS`, `FAILS`, or `NOTE` for information. A finding with tests holds or fails by these.
    answer : str
        One or two sentences, text or `Markup`.
    passed : str
        What is added where no test is significant.
    tests : tuple of ChanceTest
        Empty where nothing depends on chance.
    """

    question: str
    state: str
    answer: str
    passed: str = ""
    tests: tuple[ChanceTest, ...] = ()

    @property
    def p(self) -> float:
        """Smallest probability of its tests; NaN without any."""
        return min((test.p for test in self.tests), default=np.nan)

    @property
    def p_joint(self) -> float:
        """Smallest probability of its tests among all tests of the report; NaN without any."""
        return min((test.p_joint for test in self.tests), default=np.nan)


def judged(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings as all their tests together decide, at one level, by Holm.

    Parameters
    ----------
    findings : iterable of Finding
        Their tests are not judged; those without a probability are left out.
    """
    drafts = [replace(f, tests=tuple(t for t in f.tests if np.isfinite(t.p))) for f in findings]
    joint = iter(holm(np.array([test.p for f in drafts for test in f.tests], dtype=float)).tolist())
    return [
        _answered(replace(f, tests=tuple(replace(t, p_joint=next(joint)) for t in f.tests)))
        for f in drafts
    ]


def _answered(finding: Finding) -> Finding:
    """Return the finding with what its tests say."""
    if not finding.tests:
        return finding
    said = [test.said for test in finding.tests if test.fails]
    little = [test.said for test in finding.tests if test.significant and not test.relevant]
    parts = (
        finding.answer,
        f"Significant: {'; '.join(said)}." if said else finding.passed,
        f"Significant, but too little to matter: {'; '.join(little)}." if little else "",
    )
    answer = type(finding.answer)(" ".join(filter(None, parts)))
    return replace(finding, state=FAILS if said else finding.state, answer=answer)


def matters(ratio: float) -> bool:
    """Tell whether errors over their σ are so far from one that it matters: by a tenth."""
    return not 1 / MATTERS < ratio < MATTERS


def all_tests(findings: Sequence[Finding]) -> list[ChanceTest]:
    """Return all tests of a report."""
    return [test for finding in findings for test in finding.tests]
