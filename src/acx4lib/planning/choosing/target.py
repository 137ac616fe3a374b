"""What a flight is to reach: standard deviations, check points, time, and strips to choose from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib import expected
from acx4lib.calibration import trajectory_errors
from acx4lib.errors import FlightError
from acx4lib.flight.checks.values import key_problems, number_problems
from acx4lib.flight.problems import POSITIVE, Problem, Range, lines_of, quoted
from acx4lib.flight.text.document import Toml, read_toml
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.planning import text
from acx4lib.planning.plan import Plan

BLOCK = "calibration"
"""The block whose strips are chosen."""

KEYS = ("minutes", "sigma", "check_points", "candidates")

SIGMAS = (
    *(name for name, _ in REPORTED.values()),
    *(f"gnss_shift_{axis}_m" for axis in AXES),
    *(trajectory_errors.DELAY, trajectory_errors.ATTITUDE_DELAY),
)
"""What can be wanted of a calibration, named as in parameters.csv."""

CHECK_POINTS = tuple(f"{axis}_m" for axis in AXES)
"""What can be wanted of check points: RMS along the grid's axes, m."""

ANY_SIZE = Range(1e-30, 1e6, "must be positive, at most 1e6")
"""Of wanted sigma: those of k1, k2, k3 are small numbers, since r is in mm."""

MOST_CANDIDATES = 200

EXAMPLE = "{flying_height_m = [600, 900], course_deg = [0, 180], length_m = 600, overlap = 0.8}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """What is wanted of a flight, and the strips that it may have.

    Attributes
    ----------
    plan : Plan
        With every candidate as a strip of its block `BLOCK`.
    sigma : mapping of str to float
        Largest standard deviation, of every camera, by the name in results.
    check_m : mapping of str to float
        Largest RMS of the check points of block ``validation``, by `CHECK_POINTS`.
    minutes : float
        Longest flying time of the block.
    """

    plan: Plan
    sigma: Mapping[str, float]
    check_m: Mapping[str, float]
    minutes: float = np.inf


def read(path: str | Path, plan: Plan) -> Target:
    """Return the target in a TOML file, for a plan whose strips are candidates as well.

    Raises
    ------
    FlightError
        With all problems, one line each.
    """
    return _checked(read_toml(expected.path("path", path), needed_by="planning"), plan)


def from_values(values: Mapping[str, Any], plan: Plan) -> Target:
    """Return the target of a nested dict with the keys of the file; FlightError as `read`."""
    return _checked(Toml(folder=Path(), file="target", values=dict(values), in_memory=True), plan)


def _checked(toml: Toml, plan: Plan) -> Target:
    if found := [*_problems(toml, plan)]:
        raise FlightError(lines_of(found))
    sigma, check_m = toml.table("sigma"), toml.table("check_points")
    return Target(
        plan=text.checked(_with_candidates(toml, plan)),
        sigma={name: float(value) for name, value in sigma.items()},
        check_m={name: float(value) for name, value in check_m.items()},
        minutes=float(toml.get("minutes") or np.inf),
    )


def _problems(toml: Toml, plan: Plan) -> Iterator[Problem]:
    if toml.problems:
        yield from toml.problems
        return
    yield from key_problems(toml, (), KEYS)
    yield from number_problems(toml, (), {"minutes": POSITIVE})
    for table, known, allowed in (
        ("sigma", SIGMAS, ANY_SIZE),
        ("check_points", CHECK_POINTS, POSITIVE),
    ):
        yield from key_problems(toml, (table,), known)
        yield from number_problems(toml, (table,), dict.fromkeys(known, allowed))
    if not (toml.table("sigma") or toml.table("check_points")):
        example = "needs [sigma] with f_mm = 0.002, or [check_points] with height_m = 0.1"
        yield toml.problem(("sigma",), "nothing is wanted", example)
    if BLOCK not in plan.blocks:
        yield toml.problem((), f"a plan without block {BLOCK}", "strips of that block are chosen")
    if toml.table("check_points") and "validation" not in plan.blocks:
        cure = "the plan needs a block validation: what is mapped, and its check points"
        yield toml.problem(("check_points",), "a plan without block validation", cure)
    yield from _candidate_problems(toml)


def _candidate_problems(toml: Toml) -> Iterator[Problem]:
    tables = toml.get("candidates")
    if tables is not None and not isinstance(tables, dict):
        yield toml.problem(("candidates",), quoted(tables), "must be a table of strips by name")
    for name, table in toml.table("candidates").items():
        keys = ("candidates", name)
        if not isinstance(table, dict):
            yield toml.problem(keys, quoted(table), f"must be a table, as {EXAMPLE}")
            continue
        for key, value in table.items():
            if isinstance(value, list) and not 0 < len(value) <= MOST_CANDIDATES:
                cure = f"must be a value, or a list of 1 to {MOST_CANDIDATES}"
                yield toml.problem((*keys, key), quoted(value), cure)
    n = sum(_count(table) for table in toml.table("candidates").values())
    if n > MOST_CANDIDATES:
        yield toml.problem(("candidates",), f"{n} strips", f"must be at most {MOST_CANDIDATES}")


def _count(table: Any) -> int:
    lists = (
        [one for one in table.values() if isinstance(one, list)] if isinstance(table, dict) else []
    )
    return int(np.prod([len(one) for one in lists], dtype=float).clip(max=1e9))


def _with_candidates(toml: Toml, plan: Plan) -> Toml:
    """Return the plan with all candidates as strips; lines are those of the target's file."""
    strips = dict(plan.values[BLOCK]["strips"])
    lines: dict[tuple[str, ...], int] = {}
    for name, table in toml.table("candidates").items():
        for own, strip in _combined(name, table):
            strips[own] = strip
            lines[BLOCK, "strips", own] = toml.lines.get(("candidates", name), 1)
    values = {**plan.values, BLOCK: {**plan.values[BLOCK], "strips": strips}}
    return replace(toml, values=values, lines=lines)


def _combined(name: str, table: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield a strip for every combination of listed values, which go into its name."""
    lists = {key: value for key, value in table.items() if isinstance(value, list)}
    for values in product(*lists.values()):
        own = "-".join([name, *map(_short, values)])
        yield own, {**table, **dict(zip(lists, values, strict=True))}


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else str(value)
