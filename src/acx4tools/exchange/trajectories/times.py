"""Time bases of events, and their place on the clock of a trajectory."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Mask
from acx4lib.flight.problems import Range, quoted
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import Line
from acx4tools.exchange.trajectories.listed import Listed, position_of, read_list

GPS_SOW, UTC_SOW = "gps-sow", "utc-sow"
WEEK_SOW = "gps-week-sow"
ISO, ISO_UTC, ISO_GPS = "iso-8601", "iso-8601-utc", "iso-8601-gps"
BASES = (GPS_SOW, UTC_SOW, WEEK_SOW, ISO, ISO_UTC, ISO_GPS)
"""Seconds of the GPS week in GPS time or UTC, the former with the week; dates with their zone, or
without one in UTC or GPS time."""

WEEK_S = 604_800.0
SECONDS = Range(0.0, WEEK_S + 86_400.0, "must be seconds of the week, 0 to 604800")
WEEKS = Range(0, 100_000, "must be the GPS week, a whole number", whole=True)
FIRST_DAY = dt.datetime(1980, 1, 6, tzinfo=dt.UTC)
"""When GPS weeks began."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Stamps:
    """Times of events.

    Attributes
    ----------
    seconds : ndarray, shape (n,)
        Of the week.
    weeks : ndarray, shape (n,)
        GPS weeks; NaN where not stated.
    """

    seconds: Array
    weeks: Array


def stamp(line: Line, base: str, *, time: int, week: int | None) -> tuple[float, float]:
    """Return the GPS week, NaN if not stated, and the seconds of the week of one event.

    Parameters
    ----------
    line : Line
    base : str
        One of `BASES`.
    time, week : int
        Positions of the cells.

    Raises
    ------
    FlightError
    """
    if base.startswith(ISO):
        return _of_date(line, base, line.cell(time, "time"))
    seconds = line.number_at(time, "time", SECONDS)
    if base == WEEK_SOW and week is not None:
        return line.number_at(week, "week", WEEKS), seconds
    return np.nan, seconds


def _of_date(line: Line, base: str, cell: str) -> tuple[float, float]:
    try:
        date = dt.datetime.fromisoformat(cell)
    except ValueError:
        expected = "must be a date with its time, as 2026-05-02T10:15:30.25Z"
        raise line.wrong("time", quoted(cell), expected) from None
    if (date.tzinfo is None) == (base == ISO):
        expected = (
            f"needs a zone, such as Z; or declare --time {ISO_UTC} or {ISO_GPS}"
            if base == ISO
            else f"must have no zone; or declare --time {ISO}"
        )
        raise line.wrong("time", quoted(cell), expected)
    since = (date if date.tzinfo else date.replace(tzinfo=dt.UTC)) - FIRST_DAY
    week, day = divmod(since.days, 7)
    return float(week), 86_400.0 * day + since.seconds + 1e-6 * since.microseconds


def is_utc(base: str) -> bool:
    """Tell whether a base is UTC, and not GPS time."""
    return base in (UTC_SOW, ISO, ISO_UTC)


def continued(times: Array) -> Array:
    """Return seconds of the week that count on through the end of a week."""
    falls = np.diff(times, prepend=times[:1]) < -WEEK_S / 2
    return times + WEEK_S * np.cumsum(falls)


def on_clock(stamps: Stamps, times: Array, *, ahead: float, week: int | None) -> Array:
    """Return the times of events on the clock of a trajectory.

    Parameters
    ----------
    stamps : Stamps
    times : ndarray, shape (m,)
        Of the trajectory, counting on through the end of a week.
    ahead : float
        Seconds by which the trajectory's clock is ahead of that of the events: the leap seconds
        where it counts GPS time and they UTC, the negative ones in the reverse case.
    week : int, optional
        GPS week of the trajectory's first record. Without it the events are placed in the week
        that is nearest; from the first on by their own weeks, where they have them.

    Returns
    -------
    ndarray, shape (n,)
    """
    seconds = stamps.seconds + ahead
    nearest = np.round((times[[0, -1]].mean() - seconds) / WEEK_S)
    dated: Mask = np.isfinite(stamps.weeks)
    if dated.all() and len(seconds):
        first = float(week) if week is not None else stamps.weeks[0] - nearest[0]
        nearest = stamps.weeks - first
    return np.asarray(seconds + WEEK_S * nearest, dtype=float)


# --- A list of events: names of images, and when they were exposed


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
