"""A TOML document with the lines of its keys, and the allowed content of its tables."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from acx4files.flight.problems import QUOTED, SHOWN, Problem, Range, did_you_mean, quoted
from acx4files.flight.table_files import read_text
from acx4files.flight.tables import name_fault


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
        line, name = -1 if self.in_memory else next(known, 1), ".".join(map(_shown, keys))
        return Problem(self.file, line, name, found, expected, in_memory=self.in_memory)

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
    """Return a key as written in flight.toml, shortened if it is long."""
    if len(key) > QUOTED:
        key = f"{key[:QUOTED]}…"
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key, ensure_ascii=False)


def read_toml(path: Path, *, needed_by: str = "a flight") -> Toml:
    """Read a TOML file, such as flight.toml; its `problems` list the errors."""
    text, sha256, problems = read_text(path, str(path), needed_by=needed_by)
    toml = Toml(folder=path.parent, file=str(path), sha256=sha256, problems=problems)
    if problems:
        return toml
    text = text.replace("\r\n", "\n")
    try:
        return replace(toml, values=tomllib.loads(text), lines=_key_lines(text))
    except RecursionError:
        line, column, found = 1, "file", "too many brackets inside each other"
    except ValueError as error:
        place = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        line = int(place[1]) if place else text.count("\n") + 1
        column = f"character {place[2]}" if place else "end"
        found = re.sub(r" \(at .*\)$", "", str(error)).replace("\n", " ")
    problem = toml.problem((), found, "must be valid TOML")
    return replace(toml, problems=(replace(problem, line=line, column=column),))


_KEY = r"""(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
_STATEMENT = re.compile(rf"\s*(\[{{0,2}})\s*({_KEY}(?:\s*\.\s*{_KEY})*)\s*[\]=]", re.ASCII)


def _key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Return the line of every table and of every key."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    for number, line in enumerate(text.split("\n"), start=1):
        statement = _STATEMENT.match(line)
        if statement is None:
            continue
        keys = tuple(map(_unquoted, re.findall(_KEY, statement[2], re.ASCII)))
        if statement[1]:
            table, keys = keys, ()
        whole = (*table, *keys)
        for n in range(1, len(whole) + 1):  # a table without its own line has that of its first key
            lines.setdefault(whole[:n], number)
    return lines


def _unquoted(key: str) -> str:
    """Return a key without its quotes."""
    try:
        return str(json.loads(key)) if key[0] == '"' else key.strip("'")
    except ValueError:  # an escape of TOML only; then the table's line is used
        return key


# --- Allowed content of the tables of a TOML document: declared once, checked, and listed
#
# A `Table` declares its keys and their allowed values. `Table.problems` checks a document by it,
# and `rows` lists the same for a page of the book. Begin with `settings.FLIGHT`.


Keys = tuple[str, ...]
Rule = Callable[[Toml, Keys], Iterable[Problem]]
"""Yields the problems at a place of a document."""


def no_problems(_toml: Toml, _keys: Keys) -> Iterable[Problem]:
    """Find nothing wrong."""
    return ()


NAME = "NAME"
"""In the dotted keys of `rows` the name of a camera, or of a strip."""


@dataclass(frozen=True)
class Value:
    """Allowed values of a key.

    Attributes
    ----------
    says : str
        The requirement, as Markdown.
    problems : Rule
        Yields the problems of the value in a document.
    choices : tuple of str
        The only texts allowed; empty if there is no such list.
    """

    says: str
    problems: Rule
    choices: tuple[str, ...] = ()


def number(allowed: Range) -> Value:
    """Describe a number in a range."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if not is_number(value):
            yield toml.problem(keys, quoted(value), "must be a number")
        elif value not in allowed:
            yield toml.problem(keys, f"{quoted(value)}{_unit_hint(keys[-1], value)}", str(allowed))

    requirement = re.sub(r"^must (be|lie) (a )?", "", str(allowed))
    return Value(re.sub(r"e\+0*", "e", requirement.replace(" -", " −")), problems)


def numbers(n: int, allowed: Range, expected: str = "", *, alone: bool = False) -> Value:
    """Describe a list of n numbers in a range; with `alone` also one number for all."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        entries = value if isinstance(value, list) else [value] * n if alone else []
        if len(entries) != n or not all(map(is_number, entries)):
            yield toml.problem(keys, quoted(value), expected or f"must be a list of {n} numbers")
        elif not all(entry in allowed for entry in entries):
            yield toml.problem(keys, quoted(value), str(allowed))

    listed = f"list of {n} numbers, each {number(allowed).says}"
    return Value(f"number, or {listed}" if alone else listed, problems)


def text(expected: str = "must be text") -> Value:
    """Describe text of the characters allowed in names."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if not is_text(value):
            yield toml.problem(keys, quoted(value), expected)
        elif fault := name_fault(value):
            yield toml.problem(keys, *fault)

    return Value("text", problems)


def choice(values: tuple[str, ...], expected: str = "") -> Value:
    """Describe one of a few texts."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if value not in values:
            cure = expected or f"must be {' or '.join(map(repr, values))}"
            yield toml.problem(keys, f"{quoted(value)}{did_you_mean(value, values)}", cure)

    return Value(", ".join(map(_written, values)), problems, values)


def choices(values: tuple[str, ...]) -> Value:
    """Describe a list of a few allowed texts, each at most once."""
    listed = ", ".join(values)

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        names = toml.get(*keys)
        if isinstance(names, list):
            yield from known_names(toml, keys, names, values, f"must be of {listed}")
        else:
            yield toml.problem(keys, quoted(names), f"must be a list of {listed}")

    return Value(f"list of {choice(values).says}", problems, values)


def known_names(
    toml: Toml,
    keys: Keys,
    names: Iterable[object],
    known: Collection[str],
    expected: str,
    before: Iterable[object] = (),
) -> Iterator[Problem]:
    """Yield names that are not known, and those that are repeated or in `before`."""
    seen = [*before]
    for name in names:
        if not isinstance(name, str) or name not in known:
            yield toml.problem(keys, f"{quoted(name)}{did_you_mean(name, known)}", expected)
        elif name in seen:
            yield toml.problem(keys, f"{name!r} again", "every name once")
        seen.append(name)


def fits(says: str, expected: str, right: Callable[[Any], bool]) -> Value:
    """Describe a value that is right or wrong as a whole."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        if not right(value := toml.get(*keys)):
            yield toml.problem(keys, quoted(value), expected)

    return Value(says, problems)


def date(*, timed: bool = False) -> Value:
    """Describe a date; with a time of day only if `timed`."""
    says = "date without quotes, as 2026-05-02"
    kinds = (dt.date, dt.datetime) if timed else (dt.date,)
    return fits(says, f"must be a {says}", lambda value: type(value) in kinds)


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table with known keys.

    Attributes
    ----------
    keys : mapping of str to Value, Table or Tables
    required : collection of str
        Keys that must be there.
    default : mapping of str to object
        Values of missing keys.
    rules : sequence of Rule
        Checks of several keys together.
    sound : sequence of Rule
        Likewise, but only for a table without other problems.
    example : str
        A table in one line.
    """

    keys: Mapping[str, Value | Table | Tables]
    required: Collection[str] = ()
    default: Mapping[str, object] = field(default_factory=dict)
    rules: Sequence[Rule] = ()
    sound: Sequence[Rule] = ()
    example: str = ""

    def problems(self, toml: Toml, keys: Keys = ()) -> Iterator[Problem]:
        """Yield unknown and missing keys, and the problems of all values."""
        table = toml.get(*keys)
        if not isinstance(table, dict):
            example = f", as {self.example}" if self.example else ""
            yield toml.problem(keys, quoted(table), f"must be a table{example}")
            return
        wrong = [*_key_problems(toml, keys, self.keys, self.required)]
        for key in (known for known in self.keys if known in table):
            wrong += self.keys[key].problems(toml, (*keys, key))
        wrong += (problem for rule in self.rules for problem in rule(toml, keys))
        yield from wrong or (problem for rule in self.sound for problem in rule(toml, keys))


@dataclass(frozen=True, kw_only=True)
class Tables:
    """Tables by names that the user gives.

    Attributes
    ----------
    of : Table
    whole : Rule
        Yields the problems of all together; if there are any, single tables are not checked.
    """

    of: Table
    whole: Rule = no_problems

    def problems(self, toml: Toml, keys: Keys) -> Iterator[Problem]:
        """Yield the problems of the tables, their names and their values."""
        wrong = [*self.whole(toml, keys)]
        if not wrong and not isinstance(toml.get(*keys), dict):
            wrong = [toml.problem(keys, quoted(toml.get(*keys)), "must be a table")]
        yield from wrong
        for name in () if wrong else toml.table(*keys):
            if fault := name_fault(name) if name.strip() else ("is empty", "must be a name"):
                yield toml.problem((*keys, name), *fault)
            yield from self.of.problems(toml, (*keys, name))


Entries = dict[str, Value | Table | Tables]
"""The keys of a table, and their allowed values."""


def rows(table: Table, keys: Keys = ()) -> Iterator[tuple[Keys, Value, str]]:
    """Yield every key of a table and its subtables, its value, and its requirement.

    The requirement is Markdown: the range or the choices, then "required" or the default. Keys are
    dotted; `NAME` stands for a name that the user gives.
    """
    for key, value in table.keys.items():
        key_path = (*keys, key)
        if isinstance(value, Tables):
            yield from rows(value.of, (*key_path, NAME))
        elif isinstance(value, Table):
            yield from rows(value, key_path)
        else:
            required = ["required"] if key in table.required else []
            given = [table.default[key]] if table.default.get(key) not in (None, ()) else []
            default = [f"default {_written(one)}" for one in given]
            yield key_path, value, "; ".join([value.says, *required, *default])


def _written(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_written, value))}]"
    return f"{value:g}" if isinstance(value, int | float) else f'`"{value}"`'


def defaults(of: type) -> dict[str, object]:
    """Return the defaults of a dataclass whose fields are the keys of a table."""
    return {entry.name: entry.default for entry in fields(of) if entry.default is not MISSING}


def is_number(value: object) -> bool:
    """Tell whether a value of a document is a number; true and false are not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_text(value: object) -> bool:
    """Tell whether a value of a document is text that is not blank."""
    return isinstance(value, str) and bool(value.strip())


def _key_problems(
    toml: Toml, keys: Keys, known: Iterable[str], required: Iterable[str]
) -> Iterator[Problem]:
    """Yield unknown keys of a table, and required keys that are missing."""
    table, known = toml.table(*keys), tuple(known)
    unknown = [key for key in table if key not in known]
    for n, key in enumerate(unknown[: SHOWN + 1]):
        fault = f"unknown key{did_you_mean(key, known)}"
        if n == SHOWN:
            fault = f"unknown key, as {len(unknown) - n - 1} more"
        yield toml.problem((*keys, key), fault, f"must be one of {', '.join(known)}")
    for key in required:
        if key not in table:
            yield toml.problem((*keys, key), "missing", "required")


def _unit_hint(key: str, value: float) -> str:
    if key == "pixel_um" and 0 < value < 0.1:
        return " (millimetres or metres?)"
    if key == "focal_mm" and 0 < value < 1:
        return " (metres?)"
    return " (pixels?)" if key == "focal_mm" and value > 10_000 else ""
