"""flight.toml as a document with the line numbers of its keys."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from acx4lib.flight.problems import QUOTED, Problem
from acx4lib.flight.text.files import read_text
from acx4lib.flight.text.toml_lines import key_lines, too_much

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
    problem = too_much(text, str(path))
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
    return replace(toml, values=values, lines=key_lines(text))
