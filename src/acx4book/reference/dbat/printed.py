"""DBAT's report: every printed number with its place.

The report is a tree with indentation. The place of a line is the path of headings above it and its
own label. Its statement is the rest, without the numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

NUMBER = re.compile(r"(?<![\w.%])(?<!\^\()(?<!\^\(-)-?\d+(?:\.\d+)?(?:e[-+]\d+)?(?!\w|\.\w)")
"""A separate number: not the 3 of K3, the 4.13 of the label B4.13 or the power of a unit."""

_COUNTED = re.compile(r"^(\d+) (points with \d+ rays)\.$")
_RAYS = re.compile(r"^(\d+): (\d+\.\d+ \([\d ]*\))$")
_ROW = re.compile(r"^(\d+),")
_TABLES = ("Prior", "Posterior", "Diff", "Smallest angles")


@dataclass(frozen=True, kw_only=True)
class Line:
    """One line of a report.

    Attributes
    ----------
    path : tuple of str
        Headings, the outermost first, then the line's own label.
    statement : str
        Text after the label, with ``{}`` in the place of every number.
    numbers : tuple of str
        The numbers as printed.
    """

    path: tuple[str, ...]
    statement: str
    numbers: tuple[str, ...]


def read(path: Path) -> dict[tuple[str, ...], Line]:
    """Read a report.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict
        Its lines by their path, in their order, without headings that have no statement.

    Raises
    ------
    ValueError
        Where two lines have the same place.
    """
    lines: dict[tuple[str, ...], Line] = {}
    for line in _lines(path.read_text(encoding="utf-8")):
        if line.path in lines:
            msg = f"{path}: {' > '.join(line.path)} stands there twice"
            raise ValueError(msg)
        lines[line.path] = line
    headings = {place[:depth] for place in lines for depth in range(1, len(place))}
    return {place: line for place, line in lines.items() if line.statement or place not in headings}


def _lines(text: str) -> Iterator[Line]:
    headings: list[tuple[int, str]] = []
    for raw in text.splitlines()[1:-1]:
        content = raw.strip()
        depth = len(raw) - len(raw.lstrip())
        if content.startswith("id,"):
            continue
        if _ROW.match(content) or _RAYS.match(content):
            depth = _table_depth(headings)  # the indentation of right-aligned numbers varies
        while headings and headings[-1][0] >= depth:
            headings.pop()
        label, statement = _split(content)
        path = (*(heading for _, heading in headings), label)
        headings.append((depth, label))
        numbers = tuple(NUMBER.findall(statement))
        yield Line(path=path, statement=_plain(NUMBER.sub("{}", statement)), numbers=numbers)


def _table_depth(headings: list[tuple[int, str]]) -> int:
    """Return a depth just below the table's heading."""
    return next(depth for depth, name in reversed(headings) if name.startswith(_TABLES)) + 1


def _split(content: str) -> tuple[str, str]:
    """Return a line's label and its statement."""
    for pattern in (_COUNTED, _RAYS):
        if found := pattern.match(content):
            first, second = found.groups()
            return (second, first) if pattern is _COUNTED else (first, second)
    if _ROW.match(content):
        label, _, statement = content.partition(",")
        return label, statement
    if content.startswith("Redundancy "):  # this is the only label without a colon
        return "Redundancy", content.removeprefix("Redundancy")
    label, _, statement = content.partition(":")
    return label.strip(), statement.strip()


def _plain(statement: str) -> str:
    """Return a statement with single spaces, and none after an opening parenthesis."""
    return " ".join(statement.split()).replace("( ", "(")
