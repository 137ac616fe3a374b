"""Where observations contradict each other: the reading of the flight that would explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from acx4lib.conventions import search
from acx4lib.flight.reader import Flight
from acx4lib.results.adjustments import Record
from acx4lib.results.folder import messages


def reading(flight: Flight, block_name: str) -> str:
    """Return a sentence on the reading of a block that fits much better; empty for none.

    Parameters
    ----------
    flight : Flight
    block_name : str
        One of its blocks.
    """
    found = search.best_reading(flight, block_name)
    return found.sentence if found else ""


def explained(records: Sequence[Record], flight: Flight, block_name: str) -> list[Record]:
    """Return the records; what stopped data snooping is explained by the reading that fits.

    Parameters
    ----------
    records : sequence of Record
    flight : Flight
    block_name : str
        The block that the records are of.
    """
    if not any(messages(e, "stopped") for record in records for e in record.summary.values()):
        return list(records)
    said = reading(flight, block_name)
    return [_with(record, said) for record in records] if said else list(records)


def _with(record: Record, said: str) -> Record:
    """Return a record whose sentences on groups that were not rejected end with another."""
    entries = {
        key: {**entry, "stopped": [f"{line}; {said}" for line in messages(entry, "stopped")]}
        if messages(entry, "stopped")
        else entry
        for key, entry in record.summary.items()
    }
    return replace(record, summary=entries)
