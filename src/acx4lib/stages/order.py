"""What the stages of a run need of a flight, and which of their results a run needs."""

from __future__ import annotations

from collections.abc import Mapping

from acx4lib.flight.reader import Flight

PART_OF: Mapping[str, str] = {"rig": "mounting"}
"""The stage of the results folder that a stage belongs to, where it is not one of its own."""

ENDS = ("synthetic",)
"""Stages whose results no later one needs: where one is not determined, the run goes on."""

DECISIVE = ("heads/bundle", "mounting/single_step")
"""Methods that must be determined; the others are left out where they are not."""

CONSISTENT = (*DECISIVE, "mounting/rig", "validation/single_step", "validation/given")
"""Methods of which data snooping must not want to reject a large part of a group."""

NO_RIG = "there are no heads"
"""Why a flight has no rig that nobody expects: the stage heads says so already."""


def missing(flight: Flight, stage: str) -> str:
    """Return why a stage cannot run on a flight; empty where it can."""
    block = {"mounting": "calibration", "validation": "validation"}.get(stage, "heads")
    if block not in flight.blocks:
        return NO_RIG if stage == "rig" else f"the flight has no block {block}"
    if stage == "rig" and len(flight.blocks[block].cameras) < 2:
        return f"block {block} has one camera only"
    if stage == "synthetic" and flight.synthetic is None:
        return "flight.toml has no table [synthetic]"
    checked = flight.blocks[block].check.point_idx
    if stage == "validation" and not (flight.blocks[block].rays[checked] >= 2).any():
        return "no check point of block validation is measured in two images"
    return ""
