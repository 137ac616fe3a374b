"""What the stages of a run need of a flight, and which of their results a run needs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from acx4lib import conventions
from acx4lib.calibration.heads import not_calibrated
from acx4lib.errors import AdjustmentError, unsolvable
from acx4lib.flight import reader
from acx4lib.flight.block import unobserved
from acx4lib.flight.reader import Flight
from acx4lib.results.adjustments import Record
from acx4lib.results.folder import messages

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


def ordered(flight: Flight, parts: Sequence[str]) -> tuple[str, ...]:
    """Return what is run of a flight in its order: the rig first where its lenses carry the points.

    Parameters
    ----------
    flight : Flight
    parts : sequence of str
        Of `table_files.NOTEBOOKS`, in the order of these.
    """
    if "rig" not in parts or "synthetic" not in parts or not rig_leads(flight):
        return tuple(parts)
    rest = [part for part in parts if part != "rig"]
    at = rest.index("synthetic")
    return (*rest[:at], "rig", *rest[at:])


def rig_leads(flight: Flight) -> bool:
    """Tell whether the heads of a flight, which none calibrates by itself, are those of the rig."""
    block = flight.blocks.get("heads")
    return (
        block is not None
        and bool(flight.carried)
        and bool(not_calibrated(block))
        and not missing(flight, "rig")
    )


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
        together = stage == "heads" and rig_leads(flight)
        how = "calibrated together, as a rig" if together else "as flight.toml has them"
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


# --- Where observations contradict each other: the reading of the flight that would explain it


def _reading(flight: Flight, block_name: str) -> str:
    """Return a sentence on the reading of a block that fits much better; empty for none."""
    found = conventions.best_reading(flight, block_name)
    return found.sentence if found else ""


def explained(records: Sequence[Record], flight: Flight, block_name: str) -> list[Record]:
    """Return the records; the reading that fits explains what stopped data snooping or failed.

    Parameters
    ----------
    records : sequence of Record
    flight : Flight
    block_name : str
        The block that the records are of.
    """
    if not any(_unexplained(entry) for record in records for entry in record.summary.values()):
        return list(records)
    said = _reading(flight, block_name)
    return [_with(record, said) for record in records] if said else list(records)


def _unexplained(entry: Mapping[str, object]) -> dict[str, list[str]]:
    """Return the sentences of a summary's entry that a reading may explain, by their key."""
    keys = ["stopped", *([] if entry.get("converged") else ["not_determined"])]
    return {key: lines for key in keys if (lines := messages(entry, key))}


def _with(record: Record, said: str) -> Record:
    """Return a record whose unexplained sentences end with another."""
    entries = {
        name: entry
        | {key: [f"{line}; {said}" for line in lines] for key, lines in _unexplained(entry).items()}
        for name, entry in record.summary.items()
    }
    return replace(record, summary=entries)


@contextmanager
def explaining(flight: Flight, block_name: str) -> Iterator[None]:
    """Add the reading that fits to the message of an adjustment that fails altogether.

    Parameters
    ----------
    flight : Flight
    block_name : str
        The block that is adjusted.
    """
    try:
        yield
    except AdjustmentError as error:
        said = _reading(flight, block_name)
        if not said:
            raise
        raise AdjustmentError(f"{error}; {said}") from error


@contextmanager
def solving(flight: Flight, block_name: str) -> Iterator[None]:
    """Raise an AdjustmentError, with what to look at, in the place of a LinAlgError.

    Parameters
    ----------
    flight : Flight
    block_name : str
        The block whose numbers are computed with.
    """
    try:
        yield
    except np.linalg.LinAlgError as error:
        odd = reader.sentence(flight.block(block_name))
        where = f"the equations of block {block_name!r}{odd}"
        raise unsolvable(str(error), where) from error
