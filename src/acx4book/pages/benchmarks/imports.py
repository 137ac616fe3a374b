"""What ``acx4 import`` said of other programs' files, as a page of the book shows it.

``make reference-results`` leaves it in ``data/benchmarks``.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from pathlib import Path

from acx4book.pages.benchmarks import stored

WIDTH = 76
"""Longest line that is shown, characters; longer ones go on in the next."""


def texts(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the name of a text and the text for each kind: the command and what it printed.

    Parameters
    ----------
    folder : Path
        With ``imports.csv``.

    Raises
    ------
    FileNotFoundError
        If it is not there.
    """
    about, (table,) = stored.read(folder, "imports", make="reference-results")
    for kind, rows in table.groupby("kind", sort=False):
        lines = [f"$ {about['commands'][kind]}", *rows["line"]]
        yield f"imports-{kind}.txt", wrapped("\n".join(lines) + "\n")


def wrapped(text: str) -> str:
    """Return a text whose long lines go on in the next, farther to the right."""
    return "".join(f"{_wrapped(line)}\n" for line in text.splitlines())


def _wrapped(line: str) -> str:
    indent = " " * (len(line) - len(line.lstrip()))
    return textwrap.fill(
        line,
        WIDTH,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
        replace_whitespace=False,
    )
