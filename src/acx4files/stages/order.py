"""The data that each stage needs, and the order of the stages."""

from __future__ import annotations

from collections.abc import Sequence

from acx4files.flight.reader import Flight
from acx4lib.block import unobserved
from acx4lib.calibration.heads import can_be_calibrated

DECISIVE = ("heads/bundle", "mounting/single_step")
"""Methods that must be determined; the others are left out where they are not."""

CONSISTENT = (*DECISIVE, "mounting/rig", "validation/single_step", "validation/given")
"""Methods in which data snooping must not reject a large part of a group."""

NO_RIG = "there are no heads"
"""Reason for no rig in a flight without heads; stage heads reports it already."""


def is_end(flight: Flight, stage: str) -> bool:
    """Tell whether a run can go on after an undetermined stage: no later stage needs it.

    Points measured in heads are transferred by stage synthetic for all later stages.
    """
    return stage == "synthetic" and not flight.transferred


def ordered(flight: Flight, parts: Sequence[str]) -> tuple[str, ...]:
    """Return the stages in running order: the rig first if its heads transfer the points.

    Parameters
    ----------
    flight : Flight
    parts : sequence of str
        Of `folder.NOTEBOOKS`, in the order of these.
    """
    if "rig" not in parts or "synthetic" not in parts or not rig_leads(flight):
        return tuple(parts)
    rest = [part for part in parts if part != "rig"]
    place = rest.index("synthetic")
    return (*rest[:place], "rig", *rest[place:])


def rig_leads(flight: Flight) -> bool:
    """Tell whether the rig orients the heads, since none can be calibrated separately."""
    block = flight.blocks.get("heads")
    return (
        block is not None
        and bool(flight.transferred)
        and not can_be_calibrated(block)
        and not missing(flight, "rig")
    )


def missing(flight: Flight, stage: str) -> str:
    """Return the reason why a stage cannot run on a flight; empty if it can."""
    block = {"mounting": "calibration", "validation": "validation"}.get(stage, "heads")
    if block not in flight.blocks:
        return NO_RIG if stage == "rig" else f"the flight has no block {block}"
    if block in flight.transferred and "heads" not in flight.blocks:
        return (
            f"block {block} is measured in heads, which the flight has no block heads to calibrate"
        )
    if stage == "synthetic":
        return "" if flight.synthetic else "flight.toml has no table [synthetic]"
    return _unmeasured(flight, stage, block)


def _unmeasured(flight: Flight, stage: str, block: str) -> str:
    """Return a message on measurements that a stage lacks in its block; empty without any."""
    measured, n = len(flight.blocks[block].image_points), len(flight.blocks[block].control)
    few = stage == "heads" and not can_be_calibrated(flight.blocks[block])
    if few or not measured:
        reason = f"nothing is measured in block {block}"
        if measured:
            shown = f"{n or 'no'} control point{' is' if n == 1 else 's are'}"
            reason = f"{shown} measured in block {block}, and three are needed"
        in_rig = stage == "heads" and rig_leads(flight)
        how = "calibrated together, as a rig" if in_rig else "as flight.toml has them"
        return f"{reason}; its heads are {how}"
    if stage == "rig" and len(flight.blocks[block].cameras) < 2:
        return f"block {block} has one camera only"
    if stage == "validation" and unobserved(flight.blocks[block]):
        return "the trajectory of block validation has no sigma of positions and attitudes"
    rays, checked = flight.blocks[block].rays, flight.blocks[block].check.point_idx
    if stage == "validation" and not ((rays[checked] if len(checked) else rays) >= 2).any():
        return (
            f"no {'check ' * bool(len(checked))}point of block validation is measured in two images"
        )
    return ""
