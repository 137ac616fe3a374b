"""Sentences about the flight: how it was flown, what was noticed, and what it allows."""

from __future__ import annotations

from acx4book.typesetting.plain_text import shown
from acx4lib.flight.block import Block
from acx4lib.flight.design import levels
from acx4lib.flight.reader import Flight

OPPOSITE, ONE_WAY = "in opposite directions", "in one direction only"


def directions(flight: Flight) -> str:
    """Say from which heights and in which directions every block was flown.

    Parameters
    ----------
    flight : Flight
    """
    each = (
        f"*{name}*: {_heights(block)}, flown {_ways(block)}"
        for name, block in flight.blocks.items()
    )
    return "; ".join(each) + "."


def _heights(block: Block) -> str:
    found = [level.height_m for level in levels(block)]
    known = all(height == height for height in found)  # noqa: PLR0124 (NaN is no height)
    heights = " and ".join(f"{height:.0f}" for height in found)
    return f"{heights} m above ground" if known else "height above ground not known"


def _ways(block: Block) -> str:
    return OPPOSITE if max(level.n_directions for level in levels(block)) > 1 else ONE_WAY


def notes(flight: Flight) -> str:
    """Return what is odd but allowed in a flight, as a list."""
    if not flight.notes:
        return "Nothing odd was found in its tables."
    return "\n".join(f"- {shown(note)}" for note in flight.notes)


# --- the answer ------------------------------------------------------------------------------


def answer(flight: Flight) -> str:
    """Say which blocks the flight has, and what each of them allows.

    Parameters
    ----------
    flight : Flight
    """
    parts = [
        say(block)
        for name, say in (("heads", _heads), ("calibration", _calibration), ("validation", _check))
        if (block := flight.blocks.get(name)) is not None
    ]
    measured = sum(len(block.image_points) for block in flight.blocks.values())
    number = {1: "One block", 2: "Two blocks", 3: "Three blocks"}[len(flight.blocks)]
    held = "holds" if len(flight.blocks) == 1 else "hold"
    return f"{number}, which {held} {measured} measured image points. {' '.join(parts)}"


def _heads(block: Block) -> str:
    each = len(block.images) / len(block.cameras)
    return (
        f"Block *heads* has {each:.0f} images of each head over {len(block.control)} control "
        f"points, from {_heights(block)}: they give every head its interior orientation."
    )


def _calibration(block: Block) -> str:
    n = len(block.trajectory)
    several = len(levels(block)) > 1
    both = "two heights" if several else "one height only"
    tells = {
        (True, OPPOSITE): "so focal length, principal point and lever arm can be told apart",
        (
            True,
            ONE_WAY,
        ): "so the principal point and the lever arm in plan can hardly be told apart",
        (False, OPPOSITE): "so the focal length and the lever arm's height cannot be told apart",
        (False, ONE_WAY): "so neither the focal length nor the principal point can be told from "
        "the lever arm",
    }[several, _ways(block)]
    return (
        f"Block *calibration* has {n} exposures at {both}, flown {_ways(block)} over "
        f"{len(block.control)} control points, {tells}."
    )


def _check(block: Block) -> str:
    return (
        f"Block *validation* has {len(block.trajectory)} exposures and {len(block.check)} check "
        "points, which take part in no adjustment: only they can prove a calibration."
    )
