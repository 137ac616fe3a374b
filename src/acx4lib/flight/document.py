"""flight.toml as a document that knows its lines."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from acx4lib.flight.problems import Problem
from acx4lib.flight.tables import read_text


@dataclass(frozen=True, kw_only=True)
class Toml:
    """A TOML document that knows on which line its keys stand.

    Attributes
    ----------
    folder : Path
        Of the flight.
    file : str
        As the user reaches it.
    values : dict
    lines : dict
        Of dotted keys, as tuples.
    problems : tuple of Problem
        Why it could not be read.
    """

    folder: Path
    file: str
    values: dict[str, Any] = field(default_factory=dict)
    lines: dict[tuple[str, ...], int] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()

    def problem(self, keys: tuple[str, ...], found: str, expected: str) -> Problem:
        """Return a problem of a key, on its line or its table's."""
        known = (self.lines[keys[:n]] for n in range(len(keys), 0, -1) if keys[:n] in self.lines)
        name = ".".join(k if re.fullmatch(r"[\w-]+", k, re.ASCII) else json.dumps(k) for k in keys)
        line = next(known, 1)
        return Problem(file=self.file, line=line, column=name, found=found, expected=expected)

    def get(self, *keys: str) -> Any:
        """Return a value, None where it is not there."""
        value: Any = self.values
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        return value

    def table(self, *keys: str) -> dict[str, Any]:
        """Return a table, empty where there is none."""
        value = self.get(*keys)
        return value if isinstance(value, dict) else {}


def read_toml(folder: Path) -> Toml:
    """Return a flight's flight.toml, whatever is wrong with it."""
    path = folder / "flight.toml"
    text, problems = read_text(path, str(path))
    toml = Toml(folder=folder, file=str(path), problems=problems)
    if problems:
        return toml
    try:
        values = tomllib.loads(text.replace("\r\n", "\n"))
    except (ValueError, RecursionError) as error:
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


KEY = r"""(?:"[^"]*"|'[^']*'|[\w-]+)"""
DOTTED = re.compile(rf"\s*(\[*)\s*({KEY}(?:\s*\.\s*{KEY})*)\s*(?:\]|=)")


def _key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Return the line of every table and key that begins one."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    for number, line in enumerate(text.splitlines(), start=1):
        match = DOTTED.match(line)
        if match is None:
            continue
        keys = tuple(key.strip("\"'") for key in re.findall(KEY, match[2]))
        if match[1]:
            table, keys = keys, ()
        whole = (*table, *keys)
        for n in range(1, len(whole) + 1):  # a table that has no line of its own, by its first key
            lines.setdefault(whole[:n], number)
    return lines
