"""What the stages of a run need of a flight, and which of their results a run needs."""

from __future__ import annotations

from acx4lib.calibration.heads import not_calibrated
from acx4lib.flight.block import unobserved
from acx4lib.flight.reader import Flight

DECISIVE = ("heads/bundle", "mounting/single_step")
"""Methods that must be determined; the others are left out where they are not."""

CONSISTENT = (*DECISIVE, "mounting/rig", "validation/single_step", "validation/given")
"""Methods of which data snooping must not want to reject a large part of a group."""

NO_RIG = "there are no heads"
"""Why a flight has no rig that nobody expects: the stage heads says so already."""


def is_end(flight: Flight, stage: str) -> bool:
    """Tell whether a run goes on where a stage is not determined: no later one needs its results.

    Points that were measured in heads are carried by stage synthetic for all later ones.
    """
    return stage == "synthetic" and not flight.carried


def missing(flight: Flight, stage: str) -> str:
    """Return why a stage cannot run on a flight; empty where it can."""
    block = {"mounting": "calibration", "validation": "validation"}.get(stage, "heads")
    if block not in flight.blocks:
        return NO_RIG if stage == "rig" else f"the flight has no block {block}"
    if block in flight.carried and "heads" not in flight.blocks:
        return (
            f"block {block} is measured in heads, which the flight has no block heads to calibrate"
        )
    if stage == "synthetic":
        return "" if flight.synthetic else "flight.toml has no table [synthetic]"
    return _unmeasured(flight, stage, block)


def _unmeasured(flight: Flight, stage: str, block: str) -> str:
    """Return which measurements a stage lacks in its block; empty where it lacks none."""
    of_heads = not_calibrated(flight.blocks[block]) if stage == "heads" else ""
    if of_heads or not len(flight.blocks[block].image_points):
        reason = of_heads or f"nothing is measured in block {block}"
        return f"{reason}; its heads are as flight.toml has them"
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
