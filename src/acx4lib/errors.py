"""Errors in a user's data, in a user's folders and in an adjustment, each a message of one line."""

from __future__ import annotations

import re
from collections.abc import Sequence

UNSEEN = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # control characters, the end of a line among them
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # these turn the direction of later text
    "\u2028\u2029\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]"  # line ends, surrogates, no characters
)
"""Characters that are no text: they move the cursor, end a line or reorder what is read."""


class Acx4Error(Exception):
    """An error that this library reports to its user as a plain sentence."""


class FlightError(Acx4Error):
    """A flight's files are wrong; every problem is one line.

    Attributes
    ----------
    problems : tuple of str
        ``file:line: column: what is wrong and what was expected``. A name may contain any
        character; those that are no text are made visible.
    """

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(visible(problem) for problem in problems)
        super().__init__("\n".join(self.problems))


class OutputError(Acx4Error):
    """The output folder of a command is refused; the message is one line."""


class AdjustmentError(Acx4Error):
    """An adjustment does not converge or is not determined by its data."""


class NotConverged(AdjustmentError):
    """An adjustment does not converge, and no outlying observation explains it."""


def not_installed(what: str, module: str, extra: str) -> ModuleNotFoundError:
    """Return the error for a missing package that an extra of this distribution installs.

    Parameters
    ----------
    what : str
        The function or feature that needs the package.
    module, extra : str
    """
    msg = f"{what} needs {module}, not installed here: pip install 'acx4lib[{extra}]'"
    return ModuleNotFoundError(msg, name=module)


def unsolvable(reason: str, where: str = "") -> AdjustmentError:
    """Return an AdjustmentError for a failure of linear algebra, with a hint to its cause.

    Parameters
    ----------
    reason : str
        Message of numpy or scipy.
    where : str
        The numbers concerned, if known, and the outlying ones.
    """
    one_line = " ".join(reason.split()).rstrip(".")
    return AdjustmentError(
        f"{where or 'the equations'} cannot be solved ({one_line}): one number is so far from the "
        "others that nothing can be computed with both; look at coordinates, angles and sigma"
    )


def visible(text: str) -> str:
    r"""Return text as one line, with control characters escaped as in Python: ``\x1b``."""
    return UNSEEN.sub(lambda match: _escape(match[0]), text)


def _escape(c: str) -> str:
    """Return the escape of a character; Python reads a byte that is no text as a surrogate."""
    return f"\\x{ord(c) - 0xDC00:02x}" if "\udc80" <= c <= "\udcff" else ascii(c)[1:-1]
