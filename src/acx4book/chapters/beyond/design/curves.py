"""Standard deviations of planned flights along one change at a time."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from acx4book.chapters.beyond.design.plans import (
    COURSE_DEG,
    HIGH_M,
    LOW_M,
    Strips,
    flown,
    pair,
    several,
    strip,
)
from acx4lib.calibration.estimates import parameters
from acx4lib.planning import design
from acx4lib.planning.plan import Plan

RATIOS = (1.0, 1.05, 1.1, 1.2, 1.35, 1.5, 1.75, 2.0)
TURNS_DEG = (0.0, 15.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0)
NUMBERS = (1, 2, 3)
CONTROL = (0, 1, 2, 3, 4, 5, 6, 8)


def sigmas(plan: Plan) -> pd.Series:
    """Return the standard deviations of the camera's parameters, by their names in results."""
    (mounting,) = design.of(plan).mountings.values()
    return pd.Series({p.name: p.sigma for p in parameters(mounting.calibration)})


def over_ratio(plan: Plan) -> pd.DataFrame:
    """Return σ by the ratio of two flying heights, for two opposite strips at each."""
    flights = {r: several([pair(plan, LOW_M), pair(plan, LOW_M * r)]) for r in RATIOS}
    return _of_strips(plan, flights)


def over_turn(plan: Plan) -> pd.DataFrame:
    """Return σ by the angle between two strips, which are flown at each of two heights."""
    flights = {turn: several([_turned(plan, 0.0), _turned(plan, turn)]) for turn in TURNS_DEG}
    return _of_strips(plan, flights)


def over_pairs(plan: Plan) -> pd.DataFrame:
    """Return σ by the number of pairs of opposite strips at each of two heights."""
    both = [pair(plan, LOW_M), pair(plan, HIGH_M)]
    return _of_strips(plan, {n: several(both * n) for n in NUMBERS})


def over_same_way(plan: Plan) -> pd.DataFrame:
    """Return σ as `over_pairs`, with as many strips of which all have one direction."""
    return _of_strips(plan, {n: several([_turned(plan, 0.0)] * 2 * n) for n in NUMBERS})


def over_control(plan: Plan) -> pd.DataFrame:
    """Return σ by the number of control points, for two opposite strips at each of two heights."""
    strips = several([pair(plan, LOW_M), pair(plan, HIGH_M)])
    return _table({n: flown(plan, strips, control=n) for n in CONTROL})


def _turned(plan: Plan, turn_deg: float) -> Strips:
    """Return a strip at each of the two heights, on a course that is turned."""
    return {f"{h:.0f} m": strip(plan, h, COURSE_DEG + turn_deg) for h in (LOW_M, HIGH_M)}


def _of_strips(plan: Plan, flights: Mapping[float, Strips]) -> pd.DataFrame:
    return _table({x: flown(plan, strips) for x, strips in flights.items()})


def _table(flights: Mapping[float, Plan]) -> pd.DataFrame:
    """Return a row for every parameter, a column for every flight."""
    return pd.DataFrame({x: sigmas(plan) for x, plan in flights.items()})
