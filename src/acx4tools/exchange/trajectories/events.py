"""A list of events: names of images, and when they were exposed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories.columns import position_of
from acx4tools.exchange.trajectories.listed import Listed, read_list
from acx4tools.exchange.trajectories.times import WEEK_SOW, Stamps, stamp


@dataclass(frozen=True, kw_only=True, eq=False)
class Events:
    """Exposures with their times.

    Attributes
    ----------
    listed : Listed
    names : list of str
        Of the exposures.
    stamps : Stamps
    """

    listed: Listed
    names: list[str]
    stamps: Stamps


def read_events(source: Opened, *, columns: str, separator: str, base: str) -> Events:
    """Return the events of a text.

    Parameters
    ----------
    source : Opened
    columns, separator : str
        As `read_list` takes them.
    base : str
        Of the times, one of `times.BASES`.

    Raises
    ------
    FlightError
        With the line of what is wrong.
    """
    listed = read_list(source, columns, separator=separator, numbers=("time", "week"))
    name = next((one for one in ("exposure", "image") if listed.has(one)), "")
    needed = ("time", "week") if base == WEEK_SOW else ("time",)
    missing = [one for one in needed if not listed.has(one)] + ["image"] * (not name)
    if missing:
        raise source.wrong("columns", f"{missing[0]!r} is missing", f"--time {base} needs it")
    if listed.has("week") and base != WEEK_SOW:
        raise source.wrong(
            "columns", "'week' is there", f"needs --time {WEEK_SOW}; or declare skip"
        )
    week = position_of(listed.columns, "week")
    pairs = [stamp(row, base, time=listed.at("time"), week=week) for row in listed.rows]
    weeks, seconds = np.array(pairs, dtype=float).T
    stamps = Stamps(seconds=seconds, weeks=weeks)
    return Events(listed=listed, names=listed.unique(name), stamps=stamps)
