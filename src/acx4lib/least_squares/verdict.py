"""Verdicts of tests: what is significant among all, and whether it is large enough to matter."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array
from acx4lib.least_squares.statistics import holm

HOLDS, MINOR, FAILS, UNTESTED = "holds", "minor", "fails", "untested"
"""States of a verdict. `MINOR` is rejected, but below the size that matters."""

LEVEL = 0.05
"""Joint error probability of all tests: of any rejection where everything is right."""

MATTERS = 0.1
"""Share by which errors may differ from their sigma without a consequence. A sigma is hardly known
better: from 50 residuals to a tenth."""

DISPLACED = float(np.sqrt((1 + MATTERS) ** 2 - 1))
"""The same limit for a displacement, over the sigma beside which it stands: a displacement e makes
errors of sigma s sqrt(s^2 + e^2) / s times as large."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Verdict of one test among others.

    Attributes
    ----------
    state : str
        `HOLDS`, `MINOR`, `FAILS` or `UNTESTED`.
    p, p_joint : float
        Probability of such a value, or a more extreme one, where everything is right: by itself,
        and among all tests, by Holm; NaN where there is no test.
    size, limit : float
        Size of what is found, and the size from which it matters, in one unit.
    """

    state: str
    p: float
    p_joint: float
    size: float
    limit: float


def verdicts(p: Array, size: Array, limit: Array, *, level: float = LEVEL) -> tuple[Verdict, ...]:
    """Judge tests jointly: at most `level` of right data reject any of them.

    Parameters
    ----------
    p : ndarray, shape (n,)
        Of the single tests; NaN where there is none.
    size, limit : ndarray, shape (n,)
        Sizes of what is found, and from which they matter. An infinite size always matters.
    level : float
    """
    return tuple(
        Verdict(state=_state(joint, large, level), p=p_, p_joint=joint, size=size_, limit=limit_)
        for p_, joint, size_, limit_, large in zip(
            *(column.tolist() for column in (p, holm(p), size, limit, size >= limit)), strict=True
        )
    )


def _state(p_joint: float, large: bool, level: float) -> str:
    if np.isnan(p_joint):
        return UNTESTED
    if p_joint >= level:
        return HOLDS
    return FAILS if large else MINOR


def gravest(states: Iterable[str]) -> str:
    """Return the gravest of several states; `UNTESTED` only where nothing was tested."""
    found = set(states)
    return next((state for state in (FAILS, MINOR, HOLDS) if state in found), UNTESTED)


def off_by(ratio: float) -> float:
    """Return the share by which a ratio of errors to their sigma differs from one.

    A ratio and its inverse differ by the same share. Compare it with `MATTERS`.
    """
    return max(ratio, 1 / ratio) - 1 if ratio > 0 else np.inf
