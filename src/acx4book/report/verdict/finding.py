"""One question of the verdict with its answer."""

from __future__ import annotations

from dataclasses import dataclass

HOLDS, FAILS, NOTE = "holds", "fails", "note"

LIMIT_P = 0.001
"""Probability of a right result, two-sided, below which a test of the verdict fails."""


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One statement of the verdict.

    Attributes
    ----------
    question : str
        The question.
    state : str
        `HOLDS`, `FAILS`, or `NOTE` for information without a test.
    answer : str
        One or two sentences, text or `Markup`.
    """

    question: str
    state: str
    answer: str
