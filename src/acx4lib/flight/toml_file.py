"""flight.toml as a document with the line numbers of its keys."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from acx4lib.flight.problems import QUOTED, Problem
from acx4lib.flight.table_files import read_text

MOST_BYTES = 1_000_000
"""Largest size of a flight.toml; one with a thousand cameras has half of it."""


@dataclass(frozen=True, kw_only=True)
class Toml:
    """A TOML document with the line numbers of its keys.

    Attributes
    ----------
    folder : Path
        Folder of the flight.
    file : str
        Path of the file for the user.
    values : dict
    lines : dict
        Line numbers of dotted keys, which are tuples.
    sha256 : str
        Checksum of the file.
    problems : tuple of Problem
        Reasons why it could not be read.
    in_memory : bool
        Whether the values are from no file.
    """

    folder: Path
    file: str
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[tuple[str, ...], int] = field(default_factory=dict)
    sha256: str = ""
    problems: tuple[Problem, ...] = ()
    in_memory: bool = False

    def problem(self, keys: tuple[str, ...], found: str, expected: str) -> Problem:
        """Return a problem of a key, with the line of the key or of its table."""
        known = (self.lines[keys[:n]] for n in range(len(keys), 0, -1) if keys[:n] in self.lines)
        name = ".".join(_shown(key) for key in keys)
        return Problem(
            file=self.file,
            line=-1 if self.in_memory else next(known, 1),
            column=name,
            found=found,
            expected=expected,
            in_memory=self.in_memory,
        )

    def get(self, *keys: str) -> Any:
        """Return a value, None for a missing key."""
        value: Any = self.values
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return value

    def table(self, *keys: str) -> dict[str, Any]:
        """Return a table, empty where there is none."""
        value = self.get(*keys)
        return value if isinstance(value, dict) else {}


def _shown(key: str) -> str:
    """Return a key as it is written in flight.toml; of a long one the beginning."""
    if len(key) > QUOTED:
        key = f"{key[:QUOTED]}…"
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key, ensure_ascii=False)


def read_toml(path: Path, *, needed_by: str = "a flight") -> Toml:
    """Return a TOML file, such as a flight.toml; what is wrong is in its `problems`."""
    text, sha256, problems = read_text(path, str(path), needed_by=needed_by, most=MOST_BYTES)
    toml = Toml(folder=path.parent, file=str(path), sha256=sha256, problems=problems)
    if problems:
        return toml
    text = text.replace("\r\n", "\n")
    problem = _too_much(text, str(path))
    if problem:
        return replace(toml, problems=(problem,))
    try:
        values = tomllib.loads(text)
    except ValueError as error:
        at = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        line = int(at[1]) if at else text.count("\n") + 1
        problem = Problem(
            file=str(path),
            line=line,
            column=f"character {at[2]}" if at else "end",
            found=re.sub(r" \(at .*\)$", "", str(error)).replace("\n", " "),
            expected="must be valid TOML",
        )
        return replace(toml, problems=(problem,))
    return replace(toml, values=values, lines=_key_lines(text))


# --- Line numbers of the keys of a TOML document, and what in it would take too long to read
#
# A document is split into words, strings and brackets once. Time and memory are proportional to
# its length, whatever it contains. A TOML reader checks whether it is valid.


LONGEST_WORD = 200
"""Largest number of characters of a number, a date or a key without quotes."""

DEEPEST = 8
"""Largest number of keys joined by dots, and of nested brackets; a flight needs three and one."""

# No part can match in two ways (++, *+), so every character is examined once.
_TOKEN = re.compile(
    r"""
    \#[^\n]*+
    | (?P<text> \"\"\" (?: [^"\\] | \\. | "(?!"") )*+ (?: \"{3,5} )?
              | ''' (?: [^'] | '(?!'') )*+ (?: '{3,5} )?
              | " (?: [^"\\\n] | \\[^\n] )*+ "?
              | ' [^'\n]*+ '? )
    | (?P<word> [^\s"'\#\[\]{}=,.]++ )
    | (?P<mark> [\[\]{}=.\n] )
    """,
    re.VERBOSE | re.DOTALL,
)


@dataclass
class _Place:
    """Position of a token in a document."""

    line: int = 1
    brackets: int = 0
    dots: int = 0
    """Number of dots that join the words before this one."""


def _too_much(text: str, file: str) -> Problem | None:
    r"""Return the problem of a document that is too long or too deeply nested, else None."""
    for token, kind, place in _tokens(text):
        if kind == "word" and len(token) > LONGEST_WORD:
            what = "a number" if token[0] in "+-0123456789" else "a word"
            found = f"{what} of {len(token)} characters"
            expected = f"must have at most {LONGEST_WORD}"
        elif place.dots >= DEEPEST:
            found, expected = f"{DEEPEST + 1} keys joined by dots", f"must be at most {DEEPEST}"
        elif place.brackets > DEEPEST:
            found = f"{DEEPEST + 1} brackets inside each other"
            expected = f"must be at most {DEEPEST}"
        else:
            continue
        return Problem(file=file, line=place.line, column="file", found=found, expected=expected)
    return None


def _tokens(text: str) -> Iterator[tuple[str, str | None, _Place]]:
    """Yield words, strings and marks; the place is always the same object, which changes."""
    place, after_dot = _Place(), False
    for match in _TOKEN.finditer(text):
        token, kind = match[0], match.lastgroup
        if token in ("[", "{"):
            place.brackets += 1
        elif kind in ("word", "text"):
            place.dots = place.dots + 1 if after_dot else 0
        after_dot = token == "."
        yield token, kind, place
        if token in ("]", "}"):
            place.brackets = max(place.brackets - 1, 0)
        elif token == "\n":
            place.line += 1
        elif kind == "text":
            place.line += token.count("\n")


@dataclass
class _Statement:
    """The keys before an equals sign, or in the brackets of a table's name."""

    line: int
    is_table: bool = False
    keys: list[str] = field(default_factory=list)


def _key_lines(text: str) -> dict[tuple[str, ...], int]:
    r"""Return the line of every table and of every key."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    for statement in _statements(text):
        keys = tuple(statement.keys)
        if statement.is_table:
            table, keys = keys, ()
        whole = (*table, *keys)
        for n in range(1, len(whole) + 1):  # a table without its own line has that of its first key
            lines.setdefault(whole[:n], statement.line)
    return lines


def _statements(text: str) -> Iterator[_Statement]:
    now: _Statement | None = _Statement(line=1)  # None after the equals sign
    for token, kind, place in _tokens(text):
        if token == "\n":
            if place.brackets == 0:
                now = _Statement(line=place.line + 1)
        elif now is None:
            continue
        elif kind in ("word", "text"):
            now.keys.append(_unquoted(token))
        elif token == "[":
            now.is_table = True
        elif token in ("=", "]"):
            yield now
            now = None


def _unquoted(token: str) -> str:
    """Return a key without its quotes."""
    if token[0] == '"':
        try:
            return str(json.loads(token))
        except ValueError:  # an escape of TOML only; then the table's line is used
            return token.strip('"')
    return token.strip("'") if token[0] == "'" else token
