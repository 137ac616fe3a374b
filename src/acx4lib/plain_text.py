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

RIGHT_TO_LEFT = {"R", "AL"}
"""Bidirectional classes of letters that turn the text beside a name around."""

UNSEEN = re.compile(
    "[\x00-\x1f\x7f-\x9f"  # control characters, the end of a line among them
    "\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"  # these turn the direction of what follows
    "\u2028\u2029\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]"  # ends of lines, halves, none at all
)
"""Characters that are no text: they move the cursor, end a line or reorder what is read."""

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


def visible(text: str) -> str:
    r"""Return text as one line, what is no text in it written as Python writes it: ``\x1b``."""
    return UNSEEN.sub(lambda found: _escape(found[0]), text)


def _escape(c: str) -> str:
    """Return the escape of a character; a byte that is no text is a surrogate in Python."""
    return f"\\x{ord(c) - 0xDC00:02x}" if "\udc80" <= c <= "\udcff" else ascii(c)[1:-1]


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
