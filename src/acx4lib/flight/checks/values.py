"""Problems of the values of any table of a TOML document: keys, numbers, choices."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from acx4lib.flight.problems import SHOWN, Problem, Range, did_you_mean, quoted
from acx4lib.flight.text.document import Toml

MOST_CHOICES = 1000
"""Number of names of a list that are looked at."""


def key_problems(
    toml: Toml, keys: tuple[str, ...], known: Iterable[str], required: Iterable[str] = ()
) -> Iterator[Problem]:
    """Yield unknown keys of a table, and required keys that are missing."""
    value = toml.get(*keys)
    if value is not None and not isinstance(value, dict):
        yield toml.problem(keys, quoted(value), "must be a table")
        return
    table, known = toml.table(*keys), tuple(known)
    unknown = [key for key in table if key not in known]
    for n, key in enumerate(unknown[: SHOWN + 1]):
        expected = f"must be one of {', '.join(known)}"
        found = f"unknown key{did_you_mean(key, known)}"
        if n == SHOWN:
            found = f"unknown key, as {len(unknown) - n - 1} more"
        yield toml.problem((*keys, key), found, expected)
    for key in required:
        if key not in table:
            yield toml.problem((*keys, key), "missing", "required")


def number_problems(
    toml: Toml, keys: tuple[str, ...], ranges: Mapping[str, Range]
) -> Iterator[Problem]:
    """Yield the values of a table that are no numbers, or outside their ranges."""
    for key, allowed in ranges.items():
        value = toml.table(*keys).get(key)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float):
            yield toml.problem((*keys, key), quoted(value), "must be a number")
        elif value not in allowed:
            yield toml.problem(
                (*keys, key), f"{quoted(value)}{_unit_hint(key, value)}", str(allowed)
            )


def _unit_hint(key: str, value: float) -> str:
    if key == "pixel_um" and 0 < value < 0.1:
        return " (millimetres or metres?)"
    if key == "focal_mm" and 0 < value < 1:
        return " (metres?)"
    return " (pixels?)" if key == "focal_mm" and value > 10_000 else ""


def one_of_problems(
    toml: Toml, keys: tuple[str, ...], allowed: tuple[str, str]
) -> Iterator[Problem]:
    """Yield a problem where a value is given and is none of the two that are allowed."""
    value = toml.get(*keys)
    if value is not None and value not in allowed:
        hint = did_you_mean(value, allowed) if isinstance(value, str) else ""
        expected = " or ".join(map(repr, allowed))
        yield toml.problem(keys, f"{quoted(value)}{hint}", f"must be {expected}")


def choice_problems(
    toml: Toml, keys: tuple[str, ...], allowed: tuple[str, ...]
) -> Iterator[Problem]:
    """Yield what is wrong with a list of names, each once and of those allowed."""
    names = toml.get(*keys)
    if names is None:
        return
    if not isinstance(names, list):
        yield toml.problem(keys, quoted(names), f"must be a list of {', '.join(allowed)}")
        return
    seen = set()
    for name in names[:MOST_CHOICES]:
        if not isinstance(name, str) or name not in allowed:
            hint = did_you_mean(name, allowed) if isinstance(name, str) else ""
            yield toml.problem(keys, f"{quoted(name)}{hint}", f"must be of {', '.join(allowed)}")
        elif name in seen:
            yield toml.problem(keys, f"{name!r} again", "every name once")
        else:
            seen.add(name)
