"""Text of a flight on its way to a reader: shown character for character, never interpreted.

Names, notes and paths are data. Whatever is made for a reader calls `shown` for the medium that
it writes; `Markup` is the only text that a medium may take as its own language.
"""

from __future__ import annotations

import hashlib
import html
import re
import unicodedata
from typing import Literal

Medium = Literal["myst", "html", "tex", "terminal"]
"""MyST Markdown, HTML, labels of figures (mathematics between dollars), a line of a terminal."""

ISOLATE, POP = "\N{FIRST STRONG ISOLATE}", "\N{POP DIRECTIONAL ISOLATE}"

RIGHT_TO_LEFT = {"R", "AL", "RLE", "RLO", "RLI", "LRE", "LRO", "LRI", "FSI", "PDF", "PDI"}
"""Bidirectional classes of characters that would turn the text beside a name around."""

INERT, BETWEEN = frozenset(",;'"), frozenset(".-_/")
"""Signs that mean nothing in Markdown: anywhere, and between two letters or digits."""

FORBIDDEN = re.compile(
    r"[^\w .+=@,()-]|^[. ]|[. ]$|^(?=(?:con|prn|aux|nul|com\d|lpt\d)$).", re.IGNORECASE
)
"""What some system does not take in a file's name: signs, and CON, PRN, AUX, NUL, COM1, LPT1."""

LONGEST_FILE = 200
"""Bytes of a file's name; what is made of it adds some, and systems take 255."""

PATH = re.compile(r"[\w./-]+")
"""Text that may stand between two backticks, in a table as well."""


class Markup(str):
    """Text in the language of its medium, on purpose; text of a flight in it is `shown`."""

    __slots__ = ()


def shown(text: object, medium: Medium = "myst") -> str:
    """Return text so that the medium shows exactly its characters.

    What nothing shows, controls and halves of surrogate pairs, becomes an escape as in Python.

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
    visible = "".join(map(_visible, str(text)))
    if medium == "tex":
        return _tex(visible)
    if medium == "terminal":
        return "".join(ascii(c)[1:-1] if _turns(c) else c for c in visible)
    isolated = _isolated(visible)
    return html.escape(isolated) if medium == "html" else _myst(isolated)


def code(text: str) -> str:
    """Return a path or a checksum in MyST as code, or as `shown` where code would not hold it."""
    return Markup(f"`{text}`") if PATH.fullmatch(text) else shown(text)


def file_stem(name: str) -> str:
    """Return a file name without its ending for a name; different names have different ones."""

    def quoted(found: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in found[0].encode())

    stem = FORBIDDEN.sub(quoted, name)
    if len(stem.encode()) <= LONGEST_FILE:
        return stem
    digest = hashlib.sha256(name.encode()).hexdigest()
    return f"{stem.encode()[: LONGEST_FILE - 17].decode(errors='ignore')}~{digest[:16]}"


def _visible(c: str) -> str:
    """Return a character, or an escape for one that has no shape of its own in any medium."""
    point = ord(c)
    nothing = unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")
    never = 0xFDD0 <= point <= 0xFDEF or point & 0xFFFE == 0xFFFE
    return ascii(c)[1:-1] if nothing or never else c


def _turns(c: str) -> bool:
    """Tell whether a character orders a line anew; nothing holds it back on a terminal."""
    return unicodedata.category(c) == "Cf" and unicodedata.bidirectional(c) in RIGHT_TO_LEFT


def _isolated(text: str) -> str:
    """Return text that runs from right to left so that its neighbours do not."""
    if not any(unicodedata.bidirectional(c) in RIGHT_TO_LEFT for c in text):
        return text
    n = 1 + text.count(POP)
    return n * ISOLATE + text + n * POP


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
