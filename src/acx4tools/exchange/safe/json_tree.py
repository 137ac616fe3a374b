"""JSON as a tree whose nodes know their place: the keys that lead to them, and the line."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import Range, did_you_mean, quoted
from acx4tools.exchange.safe.opened import Opened, refusal

DEEPEST = 60
"""Largest number of objects and lists inside each other."""

Key = str | int

# A string without an end goes to that of the file, so that every character is looked at once.
_STRING = r'"(?:[^"\\]|\\.)*+"?'
_TOKEN = re.compile(rf'{_STRING}|[\[\]{{}}:,]|[^\s\[\]{{}}:,"]++', re.DOTALL)
_BRACKET = re.compile(rf"{_STRING}|[\[\]{{}}]", re.DOTALL)


@dataclass(frozen=True, kw_only=True)
class Node:
    """A value in a JSON file.

    Attributes
    ----------
    source : Opened
    keys : tuple
        Names and numbers that lead to it.
    value : object
        As `json` gives it.
    """

    source: Opened
    keys: tuple[Key, ...] = ()
    value: Any = None

    @property
    def place(self) -> str:
        """Its keys as messages name them."""
        return ".".join(map(str, self.keys)) or "file"

    def wrong(self, found: str, expected: str) -> FlightError:
        """Return the error that says what is wrong with this value."""
        line = _line(self.source.text(), self.keys)
        return refusal(self.source.file, line, self.place, found, expected)

    def maybe(self, *keys: Key) -> Node | None:
        """Return the node below keys; None where it is absent or null."""
        node = self
        for key in keys:
            value = node.value
            if isinstance(value, dict):
                value = value.get(key)
            elif isinstance(value, list) and isinstance(key, int) and key < len(value):
                value = value[key]
            else:
                value = None
            if value is None:
                return None
            node = Node(source=self.source, keys=(*node.keys, key), value=value)
        return node

    def one(self, *keys: Key) -> Node:
        """Return the node below keys; FlightError where it is absent or null."""
        node = self
        for key in keys:
            below = node.maybe(key)
            if below is None:
                known = node.value if isinstance(node.value, dict) else {}
                hint = did_you_mean(str(key), known.keys())
                raise node.wrong(f"{quoted(key)} is missing{hint}", "required")
            node = below
        return node

    def items(self) -> Iterator[tuple[str, Node]]:
        """Yield names and values of an object."""
        if not isinstance(self.value, dict):
            raise self.wrong(quoted(self.value), "must be an object")
        for key, value in self.value.items():
            yield key, Node(source=self.source, keys=(*self.keys, key), value=value)

    def each(self) -> Iterator[Node]:
        """Yield the values of a list."""
        if not isinstance(self.value, list):
            raise self.wrong(quoted(self.value), "must be a list")
        for k, value in enumerate(self.value):
            yield Node(source=self.source, keys=(*self.keys, k), value=value)

    def text(self) -> str:
        """Return a value that must be text; a number counts as its text."""
        if isinstance(self.value, bool) or not isinstance(self.value, str | int):
            raise self.wrong(quoted(self.value), "must be text")
        return str(self.value)

    def number(self, allowed: Range | None = None) -> float:
        """Return a value that must be a finite number, inside a range if one is given."""
        value = self.value
        if isinstance(value, bool) or not isinstance(value, int | float) or not _finite(value):
            raise self.wrong(quoted(value), "must be a finite number")
        if allowed is not None and value not in allowed:
            raise self.wrong(quoted(value), str(allowed))
        return float(value)

    def whole(self) -> int:
        """Return a value that must be a whole number."""
        value = self.number(Range(-(2.0**53), 2.0**53, "must be a whole number", whole=True))
        return int(value)

    def numbers(self, *shape: int, allowed: Range | None = None) -> Array:
        """Return nested lists of numbers, as in `number`, as an array; a length of -1 is any."""
        values: list[Node] = [self]
        sizes = []
        for n in shape:
            values = [below for node in values for below in node._list(n)]
            sizes.append(n)
        flat = np.array([node.number(allowed) for node in values], dtype=float)
        return flat.reshape(sizes) if flat.size else flat.reshape([max(n, 0) for n in sizes])

    def _list(self, n: int) -> Iterator[Node]:
        if not isinstance(self.value, list) or (n >= 0 and len(self.value) != n):
            kind = "numbers" if n < 0 else f"{n} values"
            raise self.wrong(quoted(self.value), f"must be a list of {kind}")
        return self.each()


def tree(source: Opened) -> Node:
    """Return the root of a JSON file.

    Raises
    ------
    FlightError
        Where it is no JSON, nested deeper than `DEEPEST`, or a name stands twice in one object.
    """
    text = source.text()
    deep = _too_deep(text)
    if deep:
        fault = f"has more than {DEEPEST} lists and objects inside each other"
        raise source.wrong("file", fault, "must be less deep", line=deep)
    try:
        value = json.loads(text, object_pairs_hook=_object, parse_constant=_no_number)
    except json.JSONDecodeError as error:
        raise source.wrong("file", error.msg, "must be valid JSON", line=error.lineno) from None
    except ValueError as error:  # of `_object`, `_no_number`, and of a number of too many digits
        raise source.wrong("file", str(error).split(";")[0], "must be valid JSON") from None
    return Node(source=source, value=value)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) != len(pairs):
        seen: set[str] = set()
        again = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]  # add returns None, which is false
        raise ValueError(f"{quoted(again)} stands twice in one object")
    return values


def _no_number(constant: str) -> float:
    raise ValueError(f"{constant} is no number")


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of any length
        return False


def _too_deep(text: str) -> int:
    """Return the line on which brackets are nested too deep, 0 if nowhere."""
    if text.count("[") + text.count("{") <= DEEPEST:
        return 0
    depth = 0
    for match in _BRACKET.finditer(text):
        mark = match[0]
        if mark in "[{":
            depth += 1
            if depth > DEEPEST:
                return text.count("\n", 0, match.start()) + 1
        elif mark in "]}":
            depth -= 1
    return 0


def _line(text: str, keys: tuple[Key, ...]) -> int:
    """Return the line of a value of valid JSON, by the keys that lead to it."""
    path: list[Key] = []
    tokens = list(_TOKEN.finditer(text))
    for k, token in enumerate(tokens):
        mark, after = token[0], tokens[k + 1][0] if k + 1 < len(tokens) else ""
        if path and isinstance(path[-1], str) and after == ":":
            path[-1] = json.loads(mark)
            if tuple(path) == keys:
                return text.count("\n", 0, token.start()) + 1
        elif tuple(path) == keys and mark not in ",:":
            return text.count("\n", 0, token.start()) + 1
        if mark in "[{":
            path.append(0 if mark == "[" else "")
        elif mark in "]}" and path:
            path.pop()
        elif mark == "," and path and isinstance(path[-1], int):
            path[-1] += 1
    return 1
