"""Problems of the table [certificate] in flight.toml: text, dates and numbers that nothing uses."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Iterator

from acx4lib.flight.checks.values import key_problems
from acx4lib.flight.problems import RANGES, SHOWN, Problem, did_you_mean, quoted
from acx4lib.flight.setup import LEVER
from acx4lib.flight.text.document import Toml
from acx4lib.flight.text.names import name_fault

TABLE = "certificate"
OTHERS = ("antenna_lever_m", "valid_until", "cameras")
"""Keys that are not text; those of a device all are."""


def certificate_problems(
    toml: Toml, known: Iterable[str], device: Iterable[str]
) -> Iterator[Problem]:
    """Yield what is wrong with the table [certificate].

    Parameters
    ----------
    toml : Toml
    known, device : iterable of str
        Its keys, and those of a camera's table in it.
    """
    yield from key_problems(toml, (TABLE,), known)
    yield from key_problems(toml, (TABLE, "cameras"), toml.table(TABLE, "cameras"))
    yield from _text_problems(toml, (TABLE,), [key for key in known if key not in OTHERS])
    yield from _lever_problems(toml)
    until = toml.get(TABLE, "valid_until")
    if until is not None and type(until) is not dt.date:
        expected = "must be a date without quotes, such as 2027-05-31"
        yield toml.problem((TABLE, "valid_until"), quoted(until), expected)
    cameras = toml.table("cameras")
    for n, name in enumerate(toml.table(TABLE, "cameras")):
        keys = (TABLE, "cameras", name)
        if name not in cameras:
            hint = did_you_mean(name, cameras) if n < SHOWN else ""
            found = f"no camera of this name{hint}"
            yield toml.problem(keys, found, "must be one of [cameras.…]")
        yield from key_problems(toml, keys, device)
        yield from _text_problems(toml, keys, device)


def _text_problems(toml: Toml, keys: tuple[str, ...], known: Iterable[str]) -> Iterator[Problem]:
    for key in known:
        value = toml.table(*keys).get(key)
        if value is None:
            continue
        if not isinstance(value, str) or not value.strip():
            yield toml.problem((*keys, key), quoted(value), "must be text in quotes")
        elif fault := name_fault(value):
            yield toml.problem((*keys, key), *fault)


def _lever_problems(toml: Toml) -> Iterator[Problem]:
    value = toml.get(TABLE, "antenna_lever_m")
    if value is None:
        return
    keys = (TABLE, "antenna_lever_m")
    each = value if isinstance(value, list) else [value]
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool) for one in each)
    if not numbers or len(each) != 3:
        yield toml.problem(keys, quoted(value), "must be a list of three numbers: x, y, z, in m")
    elif not all(one in RANGES[key] for one, key in zip(each, LEVER, strict=True)):
        yield toml.problem(keys, quoted(value), str(RANGES[LEVER[0]]))
