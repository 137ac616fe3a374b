"""Text of a flight on its way to a reader: shown character for character, never interpreted.

Names, notes and paths are data. Whatever is made for a reader calls `shown` for the medium that
it writes; `Markup` is the only text that a medium may take as its own language.
"""

from __future__ import annotations

import html
import re
import unicodedata
from typing import Literal

from acx4lib.errors import visible

Medium = Literal["myst", "html", "tex", "terminal"]
"""MyST Markdown, HTML, labels of figures (mathematics between dollars), a line of a terminal."""

ISOLATE, POP = "\N{FIRST STRONG ISOLATE}", "\N{POP DIRECTIONAL ISOLATE}"

RIGHT_TO_LEFT = {"R", "AL"}
"""Bidirectional classes of letters that turn the text beside a name around."""

INERT, BETWEEN = frozenset(",;'"), frozenset(".-_/")
"""Signs that mean nothing in Markdown: anywhere, and between two letters or digits."""

PATH = re.compile(r"[\w./-]+")
"""Text that may stand between two backticks, in a table as well."""


class Markup(str):
    """Text in the language of its medium, on purpose; text of a flight in it is `shown`."""

    __slots__ = ()


def shown(text: object, medium: Medium = "myst") -> str:
    """Return text so that the medium shows exactly its characters.

    What is no text, as a control character, becomes an escape as in Python.

    Parameters
    ----------
    text : object
        Shown as `str` has it; `Markup` is returned as it is.
    medium : str
        One of `Medium`.

    Returns
    -------
    str
        For MyST it is `Markup`, safe anywhere in a line: a sentence, a table's cell, a caption.
    """
    if isinstance(text, Markup):
        return text
    plain = visible(str(text))
    if medium == "terminal":
        return plain
    if medium == "tex":
        return _tex(plain)
    isolated = _isolated(plain)
    return html.escape(isolated) if medium == "html" else _myst(isolated)


def code(text: str) -> str:
    """Return a path or a checksum in MyST as code, or as `shown` where code would not hold it."""
    return Markup(f"`{text}`") if PATH.fullmatch(text) else shown(text)


def _isolated(text: str) -> str:
    """Return text that runs from right to left so that its neighbours do not."""
    if not any(unicodedata.bidirectional(c) in RIGHT_TO_LEFT for c in text):
        return text
    return ISOLATE + text + POP


def _myst(text: str) -> Markup:
    """Return text with a character reference for all that may mean something in Markdown."""
    around = zip(f"\n{text}", text, f"{text}\n"[1:], strict=False)
    return Markup("".join(c if _inert(b, c, a) else f"&#{ord(c)};" for b, c, a in around))


def _inert(before: str, c: str, after: str) -> bool:
    if c == " ":
        return before not in "\n " and after not in "\n "
    if c in BETWEEN:
        return before.isalnum() and after.isalnum()
    foreign = not c.isascii() and unicodedata.category(c)[0] in "LMNPS"
    return c.isalnum() or c in INERT or foreign


def _tex(text: str) -> str:
    """Return a label in which no dollar opens mathematics, and which no legend leaves out."""
    quiet = text.replace("$", r"\$")
    return rf"$\_${quiet[1:]}" if quiet.startswith("_") else quiet
