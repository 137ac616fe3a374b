"""What can go wrong with a user's data, a user's folders, or an adjustment."""

from __future__ import annotations

from collections.abc import Sequence

from acx4lib.plain_text import visible


class Acx4Error(Exception):
    """Anything this library reports to its user as a plain sentence."""


class FlightError(Acx4Error):
    """A flight's files are wrong; every problem is one line.

    Attributes
    ----------
    problems : tuple of str
        ``file:line: column: what is wrong and what was expected``; a name may hold anything, so
        what is no text is made visible.
    """

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(visible(problem) for problem in problems)
        super().__init__("\n".join(self.problems))


class OutputError(Acx4Error):
    """A command was told to write where it must not; the message is one line."""


class AdjustmentError(Acx4Error):
    """An adjustment does not converge or is not determined by its data."""
