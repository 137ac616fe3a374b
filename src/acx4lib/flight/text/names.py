"""Which names a flight may use: any text in one line that is no formula.

Names are compared exactly and written to tables unchanged. If a name looked like a formula, a
spreadsheet that opens such a table would compute it.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection

from acx4lib.errors import UNSEEN
from acx4lib.flight.problems import quoted

LONGEST = 200
"""Largest number of characters of a name."""

NUMBER = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)

_BLANK = r"[\s\u00ad\u200b-\u200d\u2060\ufeff]*"
# Many names are searched at once; a null character separates them.
_MAY_BE_FORMULA = re.compile(rf"(?:\A|[\0;]){_BLANK}[=@+-]")
_FORMULA = re.compile(rf"{_BLANK}(?:[=@]|[+-]\s*\S)")


def name_fault(name: str) -> tuple[str, str] | None:
    """Return what is wrong with a name and what was expected; None for a good one.

    Parameters
    ----------
    name : str
        It must not be empty.
    """
    if len(name) > LONGEST:
        expected = f"must be a name of at most {LONGEST} characters"
        return f"{quoted(name)} has {len(name)} characters", expected
    unseen = UNSEEN.search(name)
    if unseen:
        found = f"{quoted(name)} holds the character U+{ord(unseen[0]):04X}"
        return found, "must be text of one line, no control characters"
    if _is_formula(name):
        found = f"{quoted(name)} would be computed as a formula by a spreadsheet"
        return found, "must not begin with =, @, or with + or - unless it is a number"
    return None


def _is_formula(name: str) -> bool:
    # Where the comma is the decimal sign, a semicolon separates cells.
    parts = _plain(name).split(";")
    return any(_FORMULA.match(part) and not NUMBER.fullmatch(part) for part in parts)


def _plain(text: str) -> str:
    """Return text with full-width and half-width characters replaced by normal ones."""
    return text if text.isascii() else unicodedata.normalize("NFKC", text)


def faulty(names: Collection[str]) -> dict[str, tuple[str, str]]:
    """Return the names that cannot be used, with the results of `name_fault`.

    Parameters
    ----------
    names : collection of str
        Names to check; empty ones are skipped.
    """
    joined = "\0".join(names)
    clean = (
        max(map(len, names), default=0) <= LONGEST
        and not UNSEEN.search(joined.replace("\0", ""))
        and not _MAY_BE_FORMULA.search(_plain(joined))
    )
    if clean:
        return {}
    found = ((name, name_fault(name)) for name in names if name)
    return {name: fault for name, fault in found if fault}
