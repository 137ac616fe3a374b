"""The flights that the chapter compares: strips over one field, by the paper's camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from acx4book.notebooks.simulated import of_design
from acx4lib.planning import text
from acx4lib.planning.choosing.target import BLOCK
from acx4lib.planning.plan import Plan, Strip, image_length_m
from acx4sim.designs import acx4_ideal_plan

LOW_M, HIGH_M = 1000.0, 1500.0
"""The paper's flying heights over ground."""

OVERLAP = 0.8
N_IMAGES = 7
"""Images of every strip but the paper's own."""

COURSE_DEG = 28.0
"""Course of the first strip, the paper's."""

AREA_M = (1300.0, 1000.0)
"""Length and width of the rectangle with control points, where they are not the paper's."""

Strips = Mapping[str, Strip]


def papers() -> Plan:
    """Return the plan of the paper's calibration block; a shift of GNSS is unknown as well."""
    values = of_design.values(acx4_ideal_plan())
    values["stages"]["mounting"]["gnss"] = ["shift"]
    plan = text.from_values({k: v for k, v in values.items() if k not in ("heads", "validation")})
    block = plan.blocks[BLOCK]
    return replace(
        plan, blocks={BLOCK: replace(block, points=replace(block.points, area_m=AREA_M))}
    )


def flown(plan: Plan, strips: Strips, *, control: int | None = None) -> Plan:
    """Return a plan with other strips, and with so many control points, corners first.

    Parameters
    ----------
    plan : Plan
    strips : mapping of str to Strip
    control : int, optional
        Up to nine; those of the plan by default.
    """
    block = replace(plan.blocks[BLOCK], strips=dict(strips))
    if control is not None:
        block = replace(block, points=replace(block.points, layout="corners", number=(control,)))
    return replace(plan, blocks={BLOCK: block})


def strip(plan: Plan, height_m: float, course_deg: float, n: int = N_IMAGES) -> Strip:
    """Return a strip of so many images over the middle of the field."""
    camera = plan.cameras(BLOCK)[0]
    base_m = (1 - OVERLAP) * image_length_m(camera, height_m)
    return Strip(
        flying_height_m=height_m,
        course_deg=course_deg % 360.0,
        length_m=(n - 1) * base_m,
        base_m=base_m,
    )


def pair(plan: Plan, height_m: float, turned_deg: float = 0.0) -> dict[str, Strip]:
    """Return two opposite strips at one height, turned against the first course."""
    return {
        f"{height_m:.0f} m, {course % 360:.0f}°": strip(plan, height_m, course)
        for course in (COURSE_DEG + turned_deg, COURSE_DEG + turned_deg + 180.0)
    }


def holding_lever_arm(plan: Plan) -> Plan:
    """Return a plan in which the lever arm is held at its surveyed value."""
    return replace(plan, setup=replace(plan.setup, fix=("lever_arm",)))


def several(strips: Sequence[Strips]) -> dict[str, Strip]:
    """Return strips of several groups, with names of their own."""
    return {f"{k}: {name}": one for k, group in enumerate(strips) for name, one in group.items()}
