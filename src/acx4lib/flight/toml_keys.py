"""What the tables of a TOML document may hold: declared once, checked, and shown on the pages.

A `Table` says which keys there are and what each may be. `Table.problems` checks a document by it,
and `rows` lists the same for a page of the book. Begin with `settings.FLIGHT`.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields

from acx4lib.flight.problems import SHOWN, Problem, Range, did_you_mean, quoted
from acx4lib.flight.tables import name_fault
from acx4lib.flight.toml_file import Toml

Keys = tuple[str, ...]
Rule = Callable[[Toml, Keys], Iterable[Problem]]
"""Yields what is wrong at a place of a document."""


def no_problems(_toml: Toml, _keys: Keys) -> Iterable[Problem]:
    """Find nothing wrong."""
    return ()


NAME = "NAME"
"""In the dotted keys of `rows` the name of a camera, or of a strip."""

MOST_NAMES = 1000
"""Number of names of a list that are looked at."""


@dataclass(frozen=True)
class Value:
    """What may stand at a key.

    Attributes
    ----------
    says : str
        What it must be, as Markdown.
    problems : Rule
        Of the value that stands there.
    choices : tuple of str
        The only texts that it may be or have, if there are such.
    """

    says: str
    problems: Rule
    choices: tuple[str, ...] = ()


def number(allowed: Range) -> Value:
    """Return a number in a range."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if not is_number(value):
            yield toml.problem(keys, quoted(value), "must be a number")
        elif value not in allowed:
            yield toml.problem(keys, f"{quoted(value)}{_unit_hint(keys[-1], value)}", str(allowed))

    says = re.sub(r"^must (be|lie) (a )?", "", str(allowed))
    return Value(re.sub(r"e\+0*", "e", says.replace(" -", " −")), problems)


def numbers(n: int, allowed: Range, expected: str = "", *, alone: bool = False) -> Value:
    """Return a list of so many numbers in a range; one stands for all if `alone`."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        each = value if isinstance(value, list) else [value] * n if alone else []
        if len(each) != n or not all(map(is_number, each)):
            yield toml.problem(keys, quoted(value), expected or f"must be a list of {n} numbers")
        elif not all(one in allowed for one in each):
            yield toml.problem(keys, quoted(value), str(allowed))

    listed = f"list of {n} numbers, each {number(allowed).says}"
    return Value(f"number, or {listed}" if alone else listed, problems)


def text(expected: str = "must be text") -> Value:
    """Return text of the characters that names may have."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if not is_text(value):
            yield toml.problem(keys, quoted(value), expected)
        elif fault := name_fault(value):
            yield toml.problem(keys, *fault)

    return Value("text", problems)


def choice(values: tuple[str, ...], expected: str = "") -> Value:
    """Return one of a few texts."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if value not in values:
            cure = expected or f"must be {' or '.join(map(repr, values))}"
            yield toml.problem(keys, f"{quoted(value)}{_hint(value, values)}", cure)

    return Value(", ".join(map(_written, values)), problems, values)


def choices(values: tuple[str, ...]) -> Value:
    """Return a list of texts, each once and of a few."""

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        names, of = toml.get(*keys), ", ".join(values)
        if not isinstance(names, list):
            yield toml.problem(keys, quoted(names), f"must be a list of {of}")
            return
        seen = set()
        for name in names[:MOST_NAMES]:
            if not isinstance(name, str) or name not in values:
                yield toml.problem(keys, f"{quoted(name)}{_hint(name, values)}", f"must be of {of}")
            elif name in seen:
                yield toml.problem(keys, f"{name!r} again", "every name once")
            else:
                seen.add(name)

    return Value(f"list of {choice(values).says}", problems, values)


def date(*, timed: bool = False) -> Value:
    """Return a date; one with a time of day only if `timed`."""
    says = "date without quotes, as 2026-05-02"

    def problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
        value = toml.get(*keys)
        if not isinstance(value, dt.date) or (isinstance(value, dt.datetime) and not timed):
            yield toml.problem(keys, quoted(value), f"must be a {says}")

    return Value(says, problems)


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table with known keys.

    Attributes
    ----------
    keys : mapping of str to Value, Table or Tables
    required : collection of str
        Keys that must be there.
    default : mapping of str to object
        What stands for a key that is not there.
    rules : sequence of Rule
        Of several keys together.
    sound : sequence of Rule
        Likewise, but asked only where nothing else of the table is wrong.
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
        """Yield unknown and missing keys, and everything that is wrong with values."""
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
        What is wrong with all of them together; where anything is, they are not looked at.
    named : Rule
        What is wrong with the name of one.
    """

    of: Table
    whole: Rule = no_problems
    named: Rule = no_problems

    def problems(self, toml: Toml, keys: Keys) -> Iterator[Problem]:
        """Yield what is wrong with the tables, their names and their values."""
        wrong = [*self.whole(toml, keys)]
        if not wrong and not isinstance(toml.get(*keys), dict):
            wrong = [toml.problem(keys, quoted(toml.get(*keys)), "must be a table")]
        yield from wrong
        for name in () if wrong else toml.table(*keys):
            yield from self.named(toml, (*keys, name))
            yield from self.of.problems(toml, (*keys, name))


Entries = dict[str, Value | Table | Tables]
"""The keys of a table, and what may stand there."""


def rows(table: Table, keys: Keys = ()) -> Iterator[tuple[Keys, Value, str]]:
    """Yield every key of a table and of those in it, its value, and what that must be.

    The last is Markdown: the range or the choices, and whether it is required or what its default
    is. Keys are dotted; `NAME` stands for a name that the user gives.
    """
    for key, value in table.keys.items():
        own = (*keys, key)
        if isinstance(value, Tables):
            yield from rows(value.of, (*own, NAME))
        elif isinstance(value, Table):
            yield from rows(value, own)
        else:
            required = ["required"] if key in table.required else []
            default = table.default.get(key)
            default = (
                [f"default {_written(table.default[key])}"] if default not in (None, ()) else []
            )
            yield own, value, "; ".join([value.says, *required, *default])


def _written(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_written, value))}]"
    return f"{value:g}" if isinstance(value, int | float) else f'`"{value}"`'


def defaults(of: type) -> dict[str, object]:
    """Return the defaults of a dataclass whose fields are the keys of a table."""
    return {one.name: one.default for one in fields(of) if one.default is not MISSING}


def is_number(value: object) -> bool:
    """Tell whether a value of a document is a number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_text(value: object) -> bool:
    """Tell whether a value of a document is text that is not blank."""
    return isinstance(value, str) and bool(value.strip())


def name_problems(toml: Toml, keys: Keys) -> Iterator[Problem]:
    """Yield what is wrong with the name of a table."""
    if fault := name_fault(keys[-1]) if keys[-1].strip() else ("is empty", "must be a name"):
        yield toml.problem(keys, *fault)


def _key_problems(
    toml: Toml, keys: Keys, known: Iterable[str], required: Iterable[str]
) -> Iterator[Problem]:
    """Yield unknown keys of a table, and required keys that are missing."""
    table, known = toml.table(*keys), tuple(known)
    unknown = [key for key in table if key not in known]
    for n, key in enumerate(unknown[: SHOWN + 1]):
        found = f"unknown key{did_you_mean(key, known)}"
        if n == SHOWN:
            found = f"unknown key, as {len(unknown) - n - 1} more"
        yield toml.problem((*keys, key), found, f"must be one of {', '.join(known)}")
    for key in required:
        if key not in table:
            yield toml.problem((*keys, key), "missing", "required")


def _hint(value: object, known: Collection[str]) -> str:
    return did_you_mean(value, known) if isinstance(value, str) else ""


def _unit_hint(key: str, value: float) -> str:
    if key == "pixel_um" and 0 < value < 0.1:
        return " (millimetres or metres?)"
    if key == "focal_mm" and 0 < value < 1:
        return " (metres?)"
    return " (pixels?)" if key == "focal_mm" and value > 10_000 else ""
