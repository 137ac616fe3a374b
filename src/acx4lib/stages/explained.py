"""Where observations contradict each other: the reading of the flight that would explain it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from acx4lib.conventions import search
from acx4lib.errors import AdjustmentError, unsolvable
from acx4lib.flight import checks
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
    said = reading(flight, block_name)
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
        said = reading(flight, block_name)
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
        odd = checks.sentence(flight.block(block_name))
        where = f"the equations of block {block_name!r}{odd}"
        raise unsolvable(str(error), where) from error
