"""The trajectory of POSPac, taken at the times of events."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from acx4files.exchange import safe
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.options import Block, Camera, Columns, Crs, HeightsOfFlight, Option
from acx4files.exchange.safe import Opened, records
from acx4files.exchange.trajectories import orientations
from acx4files.exchange.trajectories.listed import TEXTS, Listed, read_list
from acx4files.exchange.trajectories.orientations import Meaning
from acx4files.flight.problems import Problem, lines_of, quoted
from acx4files.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry import frames

SLACK_S = 2.0
"""Standard deviations, of one record a second, may begin later and end sooner by this."""

LARGEST_GAP_S = 0.1
"""Largest interval between two records that is interpolated, unless all are longer."""

NO_SMRMSG = "No SMRMSG was given: the standard deviations are those of [apriori]."
WEEK_SOW, ISO = "gps-week-sow", "iso-8601"
UTC = ("utc-sow", ISO)
"""Clocks of events that count UTC; the others count GPS time."""


def read(  # noqa: PLR0913 options of a command
    source: Annotated[Path, Option("SBET", "Trajectory of POSPac.")],
    *,
    events: Annotated[Path, Option("FILE", "Names and times of exposures.")],
    time: Annotated[
        Literal["gps-sow", "utc-sow", "gps-week-sow", "iso-8601"],
        Option("", "Clock of the events."),
    ],
    smrmsg: Annotated[Path | None, Option("FILE", "Standard deviations (SMRMSG).")] = None,
    leap_seconds: Annotated[float | None, Option("S", "GPS time minus UTC; 18 since 2017.")] = None,
    columns: Columns = "",
    block: Block = "calibration",
    camera: Camera = "",
    crs: Crs = "",
    heights: HeightsOfFlight = None,
) -> ImportedFlight:
    """Read an SBET trajectory of POSPac at the times of events.

    EVENTS is a text with a row for each exposure: a name and a time. Its columns are named by its
    heading, or by --columns. --time says on which clock the times are; the trajectory counts GPS
    time. Where the events count UTC, --leap-seconds is needed: 18 since 2017. Heights are those of
    the flight that is there, else ellipsoidal.

    Examples
    --------
    acx4 import sbet sbet.out --events events.csv --time gps-sow --smrmsg smrmsg.out --out flight
    acx4 import sbet sbet.out --events log.txt --columns "skip image time" --time iso-8601
        --leap-seconds 18 --out flight

    Raises
    ------
    FlightError
        With file and line: where a file is cut off or no such file, time bases differ and no leap
        seconds are given, or an event lies outside the trajectory or in a gap.
    """
    track = read_track(safe.read(source))
    if len(track.time) < 2:
        raise track.source.wrong("file", "has one record", "must have two at least")
    listed, weeks, seconds = _events(safe.of_windows(safe.read(events)), columns, time)
    is_utc = time in UTC
    if is_utc and leap_seconds is None:
        fault = "are UTC, those of the trajectory GPS time"
        expected = "needs --leap-seconds, 18 since 2017; or declare --time"
        raise listed.source.wrong("times", fault, expected)
    t = _on_clock(weeks, seconds + (leap_seconds or 0.0) * is_utc, track.time)
    spread = read_deviations(safe.read(smrmsg)) if smrmsg else None
    _refuse_outside(track, spread, listed, t)
    meaning = Meaning(crs=crs, heights="ellipsoidal" if heights is None else heights)
    k, share = _between(track.time, t)
    off, speed = _velocity_misfit(track, np.unique(k))
    is_faithful = off <= max(0.5, 0.1 * speed)  # m/s
    lonlath = _positions(track, k, share, by_velocity=is_faithful)
    roll, pitch, heading = np.round(np.degrees(_attitudes(track, k, share)), 9).T
    text_of = listed.table.text
    names = list(text_of.get("exposure") or text_of["image"])
    table: dict[str, Any] = {
        "exposure": names,
        "lat_deg": np.round(lonlath[:, 1], 11),
        "lon_deg": np.round(lonlath[:, 0], 11),
        "height_m": np.round(orientations.in_flight(track.source, meaning, lonlath), 5),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": heading,
        "time_s": np.round(t, 7),
    }
    interval = np.diff(track.time)
    found: tuple[str, ...] = (
        f"{len(t)} events in {len(track.time)} records of the SBET, {np.median(interval):.4g} s "
        f"apart, at most {interval.max():.4g} s.",
        f"Velocities, turned by the wander angle, and changes of position differ by {off:.3f} m/s "
        f"(median over the events) at {speed:.2f} m/s.",
    )
    if spread is not None:
        found += (
            f"Standard deviations from {len(spread.time)} records of the SMRMSG, linear between "
            "them; of angles in arc minutes there.",
        )
        for name, sigma in zip((*SIGMA_POSITION, *SIGMA_ATTITUDE), spread.sigma.T, strict=True):
            table[name] = np.round(np.interp(t, spread.time, sigma), 7)
    shift = f", and GPS time is {leap_seconds:g} s ahead of UTC" if is_utc else ""
    return orientations.part_of_flight(
        meaning,
        block,
        table,
        {"camera": [camera] * len(t)} if camera else {},
        source="SBET at events",
        sha256=safe.checksums([track.source, listed.source, *([spread.source] if spread else [])]),
        assumed=(
            "The trajectory counts seconds of the week in GPS time; the times of the events are "
            f"{time}{shift}; they are placed in the nearest week.",
            listed.said,
            "True heading is platform heading minus wander angle; roll, pitch and heading are "
            "forward-right-down against north-east-down.",
            "Positions are those of the point to which the SBET refers, taken for the IMU; "
            "latitude and longitude are of the datum of the flight's CRS.",
            orientations.heights_said(replace(meaning, ellipsoidal=True)),
        ),
        found=found,
        left_out=(
            "Accelerations and rates of turn of the SBET: attitudes turn evenly between records.",
            *([] if is_faithful else ["Velocities: positions are on straight lines instead."]),
            *([] if spread else [NO_SMRMSG]),
        ),
    )


def _refuse_outside(track: Track, spread: Deviations | None, listed: Listed, t: Array) -> None:
    """Refuse events outside the records of a file, or in a gap of the trajectory."""
    problems: list[Problem] = []

    def refuse(wrong: Mask, expected: str, found: Callable[[int], str]) -> None:
        rows = np.flatnonzero(wrong).tolist()
        problems.extend(listed.table.problem(k, "time", found(k), expected) for k in rows)

    files = [(track.source, track.time, 0.0)]
    files += [(spread.source, spread.time, SLACK_S)] if spread else []
    for source, time, slack in files:
        first, last = time[0] - slack, time[-1] + slack
        places = f"must lie between {first:.3f} and {last:.3f} s, of {source.name}"
        refuse((t < first) | (t > last), places, lambda k: f"is {t[k]:.3f} s")
    intervals = np.diff(track.time)
    usual = float(np.median(intervals))
    largest = max(LARGEST_GAP_S, usual)
    before, share = _between(track.time, t)
    gap = intervals[before]
    is_gap = (share >= 0) & (share <= 1) & (gap > 1.01 * largest)  # times are rounded
    cure = f"must be at most {largest:g} s; usual are {usual:.3g} s"
    refuse(is_gap, cure, lambda k: f"lies in a gap of {gap[k]:.3f} s")
    if problems:
        raise FlightError(lines_of(problems))


# --- SBET and SMRMSG, the smoothed trajectory of Applanix's POSPac and its standard deviations
#
# Both are binary without a header. The frame of the velocities, and of the platform heading, is
# turned by the wander angle from north; its y points west where x points north, and its z up.


_OF_SBET = "time lat lon height vx vy vz roll pitch heading wander ax ay az wx wy wz"
SBET = np.dtype([(name, "<f8") for name in _OF_SBET.split()])
"""Of one record: s of week, rad, m, m/s, m/s^2, rad/s."""

_OF_SMRMSG = "time north east down v_north v_east v_down roll pitch heading"
SMRMSG = np.dtype([(name, "<f8") for name in _OF_SMRMSG.split()])
"""Of one record: s of week, m, m/s, arc minutes."""

OF_TRACK = {
    "time": (0.0, 2e6),
    "lat": (-np.pi / 2, np.pi / 2),
    "lon": (-2 * np.pi, 2 * np.pi),
    "height": (-12_000.0, 100_000.0),
    **dict.fromkeys(("roll", "pitch", "heading", "wander"), (-10.0, 10.0)),
}
OF_DEVIATIONS = {
    "time": (0.0, 2e6),
    **dict.fromkeys(("north", "east", "down", "roll", "pitch", "heading"), (1e-9, 1e6)),
}
"""Least and largest values."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """A trajectory of many records.

    Attributes
    ----------
    source : Opened
    time : ndarray, shape (n,)
        Seconds, increasing; they count on through the end of a week.
    record : structured array, shape (n,)
        As the file has them.
    """

    source: Opened
    time: Array
    record: NDArray[Any]

    def lonlath(self, rows: Index) -> Array:
        """Return longitude, latitude (rad) and height (m) of records, shape (k, 3)."""
        selected = self.record[rows]
        return np.stack([selected["lon"], selected["lat"], selected["height"]], axis=-1)

    def rph(self, rows: Index) -> Array:
        """Return roll, pitch and true heading of records, rad, shape (k, 3)."""
        selected = self.record[rows]
        return np.stack(
            [selected["roll"], selected["pitch"], selected["heading"] - selected["wander"]], axis=-1
        )

    def velocity(self, rows: Index) -> Array:
        """Return the velocities to north, east and down of records, m/s, shape (k, 3)."""
        selected = self.record[rows]
        cos, sin = np.cos(selected["wander"]), np.sin(selected["wander"])
        north = selected["vx"] * cos - selected["vy"] * sin
        east = -selected["vx"] * sin - selected["vy"] * cos
        return np.stack([north, east, -selected["vz"]], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """Standard deviations along a trajectory.

    Attributes
    ----------
    source : Opened
    time : ndarray, shape (n,)
        On the clock of the trajectory.
    sigma : ndarray, shape (n, 6)
        To east, north and up, m; of roll, pitch and heading, degrees.
    """

    source: Opened
    time: Array
    sigma: Array


def read_track(source: Opened) -> Track:
    """Return the trajectory in an SBET file.

    Raises
    ------
    FlightError
        Where it is cut off, or a record has values that no trajectory has; the record is named.
    """
    record, time = _records(source, SBET, OF_TRACK)
    return Track(source=source, time=time, record=record)


def read_deviations(source: Opened) -> Deviations:
    """Return the standard deviations in an SMRMSG file.

    Raises
    ------
    FlightError
        As `read_track` does.
    """
    record, time = _records(source, SMRMSG, OF_DEVIATIONS)
    metres = [record[name] for name in ("east", "north", "down")]
    degrees = [record[name] / 60.0 for name in ("roll", "pitch", "heading")]
    return Deviations(source=source, time=time, sigma=np.stack([*metres, *degrees], axis=-1))


def _records(
    source: Opened, layout: np.dtype[Any], limits: Mapping[str, tuple[float, float]]
) -> tuple[NDArray[Any], Array]:
    """Return the records of a file, and their seconds, which count on through the end of a week.

    The first record is refused that lies outside the limits, or not after the one before.
    """
    record = records(source, layout)
    seconds = record["time"]
    falls = np.diff(seconds, prepend=seconds[:1]) < -WEEK_S / 2
    time = seconds + WEEK_S * np.cumsum(falls)
    faults = [
        (name, ~((record[name] >= low) & (record[name] <= high)), f"{low:g} to {high:g}")
        for name, (low, high) in limits.items()
    ]
    faults.append(("time", np.diff(time, prepend=-np.inf) <= 0, "after that before"))
    for name, wrong, expected in faults:
        if wrong.any():
            k = int(np.argmax(wrong))
            fault = f"record {k + 1} of {len(record)} has ({record[name][k]})"
            raise source.wrong(name, fault, f"must be {expected}")
    return record, time


# --- Position and attitude between the records of a trajectory


AXIS_M, FLATTENING = 6_378_137.0, 1 / 298.257222101
"""GRS 80; that of WGS 84 differs by 0.1 mm. It turns velocities into rates of angles."""


def _between(times: Array, t: Array) -> tuple[Index, Array]:
    """Return the record before each time, and the share of the interval after it that has passed.

    Outside the records they are those of the first or the last interval.
    """
    before = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    return before, (t - times[before]) / (times[before + 1] - times[before])


def _steps(track: Track, k: Index) -> Array:
    """Return what longitude, latitude (rad) and height (m) change by from records to the next."""
    step = track.lonlath(k + 1) - track.lonlath(k)
    step[:, 0] = (step[:, 0] + np.pi) % (2 * np.pi) - np.pi
    return step


def _positions(track: Track, k: Index, share: Array, *, by_velocity: bool) -> Array:
    """Return longitude, latitude (deg) and height (m), shape (n, 3)."""
    step, s = _steps(track, k), share[:, None]
    x = track.lonlath(k) + s * step
    if by_velocity:  # a cubic, whose error grows with the fourth power of the interval
        interval = (track.time[k + 1] - track.time[k])[:, None]
        begin, end = interval * _rates(track, k), interval * _rates(track, k + 1)
        x += s * (1 - s) * ((1 - s) * (begin - step) - s * (end - step))
    x[:, 0] = (x[:, 0] + np.pi) % (2 * np.pi) - np.pi
    return np.column_stack([np.degrees(x[:, :2]), x[:, 2]])


def _rates(track: Track, rows: Index) -> Array:
    """Return the rates of longitude, latitude (rad/s) and height (m/s) of records, shape (k, 3)."""
    _, lat, height = track.lonlath(rows).T
    north, east, down = track.velocity(rows).T
    e_sq = FLATTENING * (2 - FLATTENING)
    w_sq = 1 - e_sq * np.sin(lat) ** 2
    along = AXIS_M * (1 - e_sq) / w_sq**1.5 + height
    across = AXIS_M / np.sqrt(w_sq) + height
    return np.stack([east / (across * np.cos(lat)), north / along, -down], axis=-1)


def _attitudes(track: Track, k: Index, share: Array) -> Array:
    """Return roll, pitch and true heading, rad, shape (n, 3); the body turns at a constant rate."""
    R_n_b, after = (frames.rotation_from_rph(track.rph(rows)) for rows in (k, k + 1))
    turned = frames.log(np.swapaxes(R_n_b, -1, -2) @ after)
    rph = frames.rph_from_rotation(R_n_b @ frames.exp(share[:, None] * turned))
    return np.column_stack([rph[:, :2], rph[:, 2] % (2 * np.pi)])


def _velocity_misfit(track: Track, k: Index) -> tuple[float, float]:
    """Return how much velocities and changes of position differ, and the speed; medians, m/s."""
    interval = (track.time[k + 1] - track.time[k])[:, None]
    rates = 0.5 * (_rates(track, k) + _rates(track, k + 1))
    metres = np.column_stack(
        [AXIS_M * np.cos(track.lonlath(k)[:, 1]), np.full((len(k), 2), [AXIS_M, 1.0])]
    )
    off = np.linalg.norm(metres * (_steps(track, k) / interval - rates), axis=1)
    return float(np.median(off)), float(np.median(np.linalg.norm(metres * rates, axis=1)))


# --- A list of events: names of images, and when they were exposed


WEEK_S = 604_800.0
FIRST_DAY = dt.datetime(1980, 1, 6, tzinfo=dt.UTC)
"""When GPS weeks began."""


def _on_clock(weeks: Array, seconds: Array, times: Array) -> Array:
    """Return the times of events on the clock of a trajectory, whose week no file says."""
    nearest = np.round((times[[0, -1]].mean() - seconds) / WEEK_S)
    if np.isfinite(weeks).all():
        nearest = weeks - weeks[0] + nearest[0]
    return np.asarray(seconds + WEEK_S * nearest, dtype=float)


def _events(source: Opened, columns: str, clock: str) -> tuple[Listed, Array, Array]:
    """Return the events of a text, and their GPS weeks, NaN where none is stated, and seconds."""
    texts = (*TEXTS, "time") if clock == ISO else TEXTS
    listed = read_list(source, columns, keys=[("exposure",), ("image",)], texts=texts)
    needed = ["time"] + ["week"] * (clock == WEEK_SOW)
    needed += [] if listed.has("exposure") else ["image"]
    listed.require(*needed, says=" ".join(needed))
    if listed.has("week") and clock != WEEK_SOW:
        expected = f"needs --time {WEEK_SOW}; or declare skip"
        raise source.wrong("columns", "'week' is there", expected)
    cells, numbers = listed.cells["time"], listed.table.numbers
    if clock == ISO:
        weeks, seconds = np.array([_of_date(cell) for cell in cells]).T
        expected = "must be a date with its time and zone, as 2026-05-02T10:15:30.25Z"
    else:
        seconds, expected = numbers["time"], "must be seconds of the week, 0 to 604800"
        weeks = numbers.get("week", np.full(len(seconds), np.nan))
    wrong: Mask = ~((seconds >= 0) & (seconds <= WEEK_S + 86_400.0))
    listed.refuse("time", wrong, [quoted(cell) for cell in cells], expected)
    return listed, weeks, seconds


def _of_date(cell: str) -> tuple[float, float]:
    """Return the week and the seconds of a date with its zone, on its own clock; else NaN."""
    try:
        weeks, rest = divmod(dt.datetime.fromisoformat(cell) - FIRST_DAY, dt.timedelta(weeks=1))
    except (TypeError, ValueError):  # TypeError: it has no zone
        return np.nan, np.nan
    return float(weeks), rest.total_seconds()
