"""Clean flights of three sizes in both forms of trajectory."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import acx4sim
from acx4sim.designs import acx4_ideal_plan, single_head_plan
from acx4sim.files import SimulatedFlight, simulate_plan
from acx4sim.plan import Plan, layout

FORMS = ("grid", "geodetic")
DESIGNS = ("acx4-ideal", "single-head")
SIZES = {"small": 12, "medium": 40, "large": 160}
"""Number of images, about."""


@lru_cache(maxsize=8)
def clean(design: str, form: str, size: str, *, seed: int = 1) -> SimulatedFlight:
    """Simulate the calibration block of a design in another size and form of trajectory."""
    plan = {"acx4-ideal": acx4_ideal_plan, "single-head": single_head_plan}[design]()
    sized = {"small": _small, "medium": lambda plan: plan, "large": _large}[size](plan)
    options = acx4sim.Options(blocks=("calibration",))
    return simulate_plan(replace(sized, angles=form), seed, options)


def _small(plan: Plan) -> Plan:
    """Plan twelve images: two low strips there and back, and one at the other height."""
    block = plan.blocks["calibration"]
    strips = tuple(replace(block.strips[i], n=4, left_m=0.0, forward_m=0.0) for i in (0, 1, -1))
    return _with_block(plan, strips=strips, tie_points=60)


def _large(plan: Plan) -> Plan:
    """Plan some 160 images: strips there and back, and two at the other height."""
    block = plan.blocks["calibration"]
    low, high = block.strips[0], block.strips[-1]
    aside = abs(low.left_m)
    strips = [
        replace(low, n=16, turn_deg=180.0 * (i % 2), left_m=(i - 3.5) * aside) for i in range(8)
    ]
    strips += [replace(high, n=16, turn_deg=turn, forward_m=0.0) for turn in (0.0, 180.0)]
    half = (7.5 * low.base_m, 3.5 * aside)
    big = _with_block(plan, strips=tuple(strips), tie_points=400, tie_area_m=half)
    return replace(big, control=layout(9, 9, half, 40.0))


def _with_block(plan: Plan, **changes) -> Plan:
    block = replace(plan.blocks["calibration"], **changes)
    return replace(plan, blocks={**plan.blocks, "calibration": block})
