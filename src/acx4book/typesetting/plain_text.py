"""Text of a flight, shown to readers character for character, never interpreted.

Names, notes and paths are data. All output for readers passes through `shown` for its medium;
only `Markup` is interpreted in the language of the medium.
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
"""Bidirectional classes of letters that change the direction of the text beside a name."""

INERT, BETWEEN = frozenset(",;'"), frozenset(".-_/")
"""Signs without meaning in Markdown: anywhere, and only between two letters or digits."""

PATH = re.compile(r"[\w./-]+")
"""Text that is allowed between two backticks, also in a table."""


class Markup(str):
    """Text in the language of its medium; text of a flight in it has passed through `shown`."""

    __slots__ = ()


def shown(text: object, medium: Medium = "myst") -> str:
    """Return text so that the medium shows exactly its characters.

    A character that is no text, such as a control character, is escaped as in Python.

    Parameters
    ----------
    text : object
        It is converted by `str`; `Markup` is returned unchanged.
    medium : str
        One of `Medium`.

    Returns
    -------
    str
        For MyST it is `Markup`, safe anywhere in a line: in a sentence, a cell or a caption.
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
    """Return a path or a checksum as code in MyST, or as `shown` where code is not possible."""
    return Markup(f"`{text}`") if PATH.fullmatch(text) else shown(text)


def _isolated(text: str) -> str:
    """Isolate right-to-left text, so that it does not change its neighbours."""
    if not any(unicodedata.bidirectional(c) in RIGHT_TO_LEFT for c in text):
        return text
    return ISOLATE + text + POP


def _myst(text: str) -> Markup:
    """Return text with character references for all signs that may have a meaning in Markdown."""
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
    """Escape dollars in a label, and a leading underscore, which legends would hide."""
    quiet = text.replace("$", r"\$")
    return rf"$\_${quiet[1:]}" if quiet.startswith("_") else quiet
