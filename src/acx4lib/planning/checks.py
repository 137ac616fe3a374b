"""What is wrong with the tables of a plan that flight.toml does not have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from acx4lib.flight.block_from_tables import BLOCKS
from acx4lib.flight.checks.settings import TOP, toml_problems
from acx4lib.flight.checks.values import key_problems, number_problems
from acx4lib.flight.problems import (
    METRES,
    NOT_NEGATIVE,
    POSITIVE,
    RANGES,
    Problem,
    Range,
    did_you_mean,
    quoted,
)
from acx4lib.flight.text.document import Toml
from acx4lib.flight.text.names import name_fault
from acx4lib.planning.ground import LAYOUTS

AREA = {
    "east_m": METRES,
    "north_m": METRES,
    "course_deg": Range(-360.0, 360.0),
}
FIELD = {
    **AREA,
    "height_m": RANGES["height_m"],
    "relief_m": Range(0.0, 3000.0),
}
FROM_MIDDLE = Range(-1e6, 1e6)
"""Distances from the middle of a field, m; farther away grid coordinates have no place."""

STRIP = {
    "flying_height_m": Range(1.0, 30_000.0),
    "course_deg": Range(-360.0, 360.0),
    "length_m": Range(0.0, 1e6),
    "base_m": Range(0.1, 1e5),
    "overlap": Range(0.0, 0.99, "must be a share from 0 to 0.99"),
    "forward_m": FROM_MIDDLE,
    "left_m": FROM_MIDDLE,
    "speed_m_s": Range(1.0, 1000.0),
    "parallel": Range(1, 200, "must be a whole number from 1 to 200", whole=True),
    "spacing_m": Range(1.0, 1e5),
    "side_overlap": Range(0.0, 0.99, "must be a share from 0 to 0.99"),
}
TIE_POINTS = Range(0, 20_000, "must be a whole number up to 20000", whole=True)
POINTS = ("layout", "number", "area_m", "play_m", "at_m", "sigma_m", "sigma_px")
COUNT = Range(0, 500, "must be a whole number up to 500", whole=True)
PLAN = ("field", "control", *BLOCKS, "truth")
"""Tables of a plan that flight.toml does not have."""

MOST_STRIPS = 500
"""Largest number of strips of a block."""


def settings(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a plan that flight.toml has, too."""
    return {key: value for key, value in values.items() if key not in PLAN}


def problems(toml: Toml, flight: Toml) -> Iterator[Problem]:
    """Yield everything that is wrong with a plan but what its strips and points amount to.

    Parameters
    ----------
    toml, flight : Toml
        The plan, and its part that flight.toml has, too.
    """
    if toml.problems:
        yield from toml.problems
        return
    yield from key_problems(toml, (), (*TOP, *PLAN), ("field",))
    known = {key: value for key, value in flight.values.items() if key in TOP}
    yield from toml_problems(replace(flight, values=known))
    if "field" in toml.values:
        yield from key_problems(toml, ("field",), FIELD, ("east_m", "north_m", "height_m"))
        yield from number_problems(toml, ("field",), FIELD)
    if "control" in toml.values:
        yield from _points_problems(toml, ("control",))
    present = [name for name in BLOCKS if name in toml.values]
    if not present:
        yield toml.problem(("calibration",), "no block at all", f"needs one of {', '.join(BLOCKS)}")
    for name in present:
        yield from _block_problems(toml, name)
    yield from _truth_problems(toml, flight)


def _block_problems(toml: Toml, name: str) -> Iterator[Problem]:
    own = ("tie_points", "tie_area_m", "strips")
    elsewhere, check = (tuple(AREA), ("check",)) if name == "validation" else ((), ())
    yield from key_problems(toml, (name,), (*elsewhere, *own, *check), ("strips", *check))
    yield from number_problems(
        toml,
        (name,),
        {key: (AREA | {"tie_points": TIE_POINTS})[key] for key in (*elsewhere, "tie_points")},
    )
    yield from _list_problems(toml, (name, "tie_area_m"), 2, POSITIVE)
    if check and "check" in toml.table(name):
        yield from _points_problems(toml, (name, "check"))
    strips = toml.get(name, "strips")
    if strips is not None and not (isinstance(strips, dict) and 0 < len(strips) <= MOST_STRIPS):
        expected = f"must be a table of 1 to {MOST_STRIPS} strips by name"
        yield toml.problem((name, "strips"), quoted(strips), expected)
        return
    for strip in toml.table(name, "strips"):
        yield from _strip_problems(toml, (name, "strips", strip))


def _strip_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    fault = name_fault(keys[-1]) if keys[-1] else ("is empty", "must be a name")
    if fault:
        yield toml.problem(keys, *fault)
    if not isinstance(toml.get(*keys), dict):
        example = "{flying_height_m = 600, course_deg = 0, length_m = 600, overlap = 0.8}"
        yield toml.problem(keys, quoted(toml.get(*keys)), f"must be a table, as {example}")
        return
    yield from key_problems(toml, keys, STRIP, ("flying_height_m", "course_deg", "length_m"))
    yield from number_problems(toml, keys, STRIP)
    given = toml.table(*keys)
    if ("base_m" in given) == ("overlap" in given):
        found = "both base_m and overlap" if "base_m" in given else "neither base_m nor overlap"
        yield toml.problem(keys, found, "needs one of the two")
    beside = [key for key in ("spacing_m", "side_overlap") if key in given]
    if "parallel" in given and len(beside) != 1:
        found = "both spacing_m and side_overlap" if beside else "parallel strips without a spacing"
        yield toml.problem(keys, found, "needs spacing_m or side_overlap")
    elif beside and "parallel" not in given:
        yield toml.problem((*keys, beside[0]), "a spacing of one strip", "needs parallel as well")


def _points_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    yield from key_problems(toml, keys, POINTS)
    if not isinstance(toml.get(*keys), dict):
        return
    yield from number_problems(toml, keys, {"play_m": NOT_NEGATIVE, "sigma_px": POSITIVE})
    yield from _list_problems(toml, (*keys, "sigma_m"), 3, NOT_NEGATIVE)
    layout = toml.table(*keys).get("layout", "grid")
    if layout not in LAYOUTS:
        hint = did_you_mean(layout, LAYOUTS) if isinstance(layout, str) else ""
        expected = f"must be one of {', '.join(LAYOUTS)}"
        yield toml.problem((*keys, "layout"), f"{quoted(layout)}{hint}", expected)
        return
    if layout == "at":
        yield from _places_problems(toml, (*keys, "at_m"))
        return
    yield from key_problems(toml, keys, POINTS, ("number", "area_m"))
    yield from _list_problems(toml, (*keys, "area_m"), 2, NOT_NEGATIVE)
    number = toml.table(*keys).get("number")
    if layout == "grid":
        yield from _list_problems(toml, (*keys, "number"), 2, COUNT)
    elif number is not None:
        most = Range(0, 9, "must be a whole number up to 9 for corners", whole=True)
        yield from number_problems(toml, keys, {"number": most if layout == "corners" else COUNT})


def _list_problems(toml: Toml, keys: tuple[str, ...], n: int, allowed: Range) -> Iterator[Problem]:
    """Yield a problem where a value is given and no list of so many numbers in a range."""
    value = toml.get(*keys)
    if value is None:
        return
    if not (isinstance(value, list) and len(value) == n and all(map(_is_number, value))):
        yield toml.problem(keys, quoted(value), f"must be a list of {n} numbers")
    elif not all(one in allowed for one in value):
        yield toml.problem(keys, quoted(value), str(allowed))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _places_problems(toml: Toml, keys: tuple[str, ...]) -> Iterator[Problem]:
    value = toml.get(*keys)
    pairs = isinstance(value, list) and len(value) <= int(COUNT.high)
    if not pairs or not all(
        isinstance(pair, list) and len(pair) == 2 and all(map(_is_number, pair)) for pair in value
    ):
        expected = "must be a list of points [forward, left] in metres, 500 at most"
        yield toml.problem(keys, "missing" if value is None else quoted(value), expected)
    elif not all(one in FROM_MIDDLE for pair in value for one in pair):
        yield toml.problem(keys, quoted(value), str(FROM_MIDDLE))


def _truth_problems(toml: Toml, flight: Toml) -> Iterator[Problem]:
    """Yield what is wrong with the true cameras, as with cameras of flight.toml."""
    cameras = flight.table("cameras")
    yield from key_problems(toml, ("truth",), cameras)
    for name in toml.table("truth"):
        if name not in cameras or not isinstance(cameras[name], dict):
            continue
        if not isinstance(toml.get("truth", name), dict):
            yield toml.problem(("truth", name), quoted(toml.get("truth", name)), "must be a table")
            continue
        changed = {**cameras, name: {**cameras[name], **toml.table("truth", name)}}
        own = replace(flight, values={**flight.values, "cameras": changed})
        before = {(p.column, p.found) for p in toml_problems(flight)}
        for problem in toml_problems(own):
            if (problem.column, problem.found) not in before:
                key = problem.column.rpartition(".")[2]
                yield toml.problem(("truth", name, key), problem.found, problem.expected)
