"""What the solution of an exercise finds, in two ways."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Solution:
    """An answer with its number, and the same number found in another way.

    Attributes
    ----------
    text : str
    value, again : float
    """

    text: str
    value: float
    again: float
