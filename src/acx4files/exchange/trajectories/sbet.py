"""The trajectory of POSPac, taken at the times of events."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from acx4files.exchange import safe
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.options import Block, Camera, Columns, Crs, HeightsOfFlight, Option
from acx4files.exchange.safe import Line, Opened, records
from acx4files.exchange.trajectories import orientations
from acx4files.exchange.trajectories.listed import Listed, read_list, text_said
from acx4files.exchange.trajectories.orientations import Meaning
from acx4files.flight.problems import Range, lines_of, quoted
from acx4files.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index
from acx4lib.geometry import frames

ROUNDED = 1.01
"""Of a gap: steps of 0.1 s are a little longer or shorter, as their times are rounded."""

SLACK_S = 2.0
"""Standard deviations, of one record a second, may begin later and end sooner by this."""

FAITHFUL_MS, FAITHFUL = 0.5, 0.1
"""Largest difference of velocities from changes of position: m/s, or a share of the speed."""

STRAIGHT = (
    "Velocities: they differ from the changes of position by {:.2f} m/s; positions are on straight "
    "lines between records."
)


# --- Time bases of events, and their place on the clock of a trajectory


GPS_SOW, UTC_SOW = "gps-sow", "utc-sow"

LARGEST_GAP_S = 0.1
"""Largest interval between two records that is interpolated, unless all are longer."""


def read(  # noqa: PLR0913 options of a command
    source: Annotated[Path, Option("SBET", "Trajectory of POSPac.")],
    *,
    events: Annotated[Path, Option("FILE", "Names and times of exposures.")],
    time: Annotated[
        Literal["gps-sow", "utc-sow", "gps-week-sow", "iso-8601", "iso-8601-utc", "iso-8601-gps"],
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
    listed, names, weeks, seconds = _events(safe.of_windows(safe.read(events)), columns, time)
    if len(track.time) < 2:
        raise track.source.wrong("file", "has one record", "must have two at least")
    is_utc = time in (UTC_SOW, ISO, ISO_UTC)
    if is_utc and leap_seconds is None:
        fault = "are UTC, those of the trajectory GPS time"
        expected = "needs --leap-seconds, 18 since 2017; or declare --time"
        raise listed.source.wrong("times", fault, expected)
    t = _on_clock(weeks, seconds + (leap_seconds or 0.0) * is_utc, track.time)
    between = Between.of(track.time, t)
    spread = read_deviations(safe.read(smrmsg)) if smrmsg else None
    _refuse_outside(track, spread, listed, t, between)
    meaning = Meaning(crs=crs, heights="ellipsoidal" if heights is None else heights)
    off, speed = _velocity_misfit(track, between)
    faithful = off <= max(FAITHFUL_MS, FAITHFUL * speed)
    lonlath = _positions(track, between, by_velocity=faithful)
    height = orientations.in_flight(track.source, meaning, lonlath[:, :2], lonlath[:, 2])
    roll, pitch, heading = np.round(np.degrees(_attitudes(track, between)), 9).T
    table: dict[str, Any] = {
        "exposure": names,
        "lat_deg": np.round(lonlath[:, 1], 11),
        "lon_deg": np.round(lonlath[:, 0], 11),
        "height_m": np.round(height, 5),
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": heading,
        "time_s": np.round(t, 7),
    }
    if spread is not None:
        for name, sigma in zip((*SIGMA_POSITION, *SIGMA_ATTITUDE), spread.sigma.T, strict=True):
            table[name] = np.round(np.interp(t, spread.time, sigma), 7)
    tables = {f"{block}/trajectory.csv": table}
    if camera:
        cameras = [camera] * len(t)
        tables[f"{block}/images.csv"] = {"image": names, "camera": cameras, "exposure": names}
    shift = f", and GPS time is {leap_seconds:g} s ahead of UTC" if is_utc else ""
    return ImportedFlight(
        source="SBET at events",
        sha256=safe.checksums([track.source, listed.source, *([spread.source] if spread else [])]),
        settings=orientations.settings(meaning),
        tables=tables,
        pictures=orientations.grid_file(meaning),
        assumed=(
            "The trajectory counts seconds of the week in GPS time; the times of the events are "
            f"{time}{shift}; they are placed in the nearest week.",
            "The columns of the list of events are: "
            f"{' '.join(column.name for column in listed.columns)}"
            f"{'; its first line is a heading' if listed.heading else ''}.",
            *text_said(listed),
            "True heading is platform heading minus wander angle; roll, pitch and heading are "
            "forward-right-down against north-east-down.",
            "Positions are those of the point to which the SBET refers, taken for the IMU; "
            "latitude and longitude are of the datum of the flight's CRS.",
            orientations.heights_said(replace(meaning, ellipsoidal=True)),
        ),
        found=_found(track, spread, len(t), off, speed),
        left_out=(
            "Accelerations and rates of turn of the SBET: attitudes turn evenly between records.",
            *([] if faithful else [STRAIGHT.format(off)]),
            "Standard deviations of velocities; correlations are not in the SMRMSG."
            if spread
            else "No SMRMSG was given: the standard deviations are those of [apriori].",
        ),
    )


def _found(
    track: Track, spread: Deviations | None, n: int, off: float, speed: float
) -> tuple[str, ...]:
    interval = np.diff(track.time)
    said = (
        f"{n} events in {len(track.time)} records of the SBET, {np.median(interval):.4g} s "
        f"apart, at most {interval.max():.4g} s.",
        f"Velocities, turned by the wander angle, and changes of position differ by {off:.3f} m/s "
        f"(median over the events) at {speed:.2f} m/s.",
    )
    if spread is None:
        return said
    return (
        *said,
        f"Standard deviations from {len(spread.time)} records of the SMRMSG, linear between them; "
        "of angles in arc minutes there.",
    )


def _refuse_outside(
    track: Track, spread: Deviations | None, listed: Listed, t: Array, between: Between
) -> None:
    """Refuse events outside the records of a file, or in a gap of the trajectory."""
    problems = []
    files = [(track.source, track.time, 0.0)]
    files += [(spread.source, spread.time, SLACK_S)] if spread else []
    for source, time, slack in files:
        first, last = time[0] - slack, time[-1] + slack
        places = f"must lie between {first:.3f} and {last:.3f} s, of {source.name}"
        outside = (t < first) | (t > last)
        problems += listed.problems("time", outside, places, lambda k: f"is {t[k]:.3f} s")
    usual = float(np.median(np.diff(track.time)))
    largest = max(LARGEST_GAP_S, usual)
    gap = (between.share >= 0) & (between.share <= 1) & (between.interval > ROUNDED * largest)
    cure = f"must be at most {largest:g} s; usual are {usual:.3g} s"
    problems += listed.problems(
        "time", gap, cure, lambda k: f"lies in a gap of {between.interval[k]:.3f} s"
    )
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

LIMITS = {
    "time": (0.0, 2e6),
    "lat": (-np.pi / 2, np.pi / 2),
    "lon": (-2 * np.pi, 2 * np.pi),
    "height": (-12_000.0, 100_000.0),
    **dict.fromkeys(("roll", "pitch", "heading", "wander"), (-10.0, 10.0)),
}
"""Least and largest values of an SBET."""

POSITIVE = ("north", "east", "down", "roll", "pitch", "heading")


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
    record = records(source, SBET)
    for name, (low, high) in LIMITS.items():
        values = record[name]
        _refuse(source, name, values, ~((values >= low) & (values <= high)), f"{low:g} to {high:g}")
    return Track(source=source, time=_increasing(source, record), record=record)


def read_deviations(source: Opened) -> Deviations:
    """Return the standard deviations in an SMRMSG file.

    Raises
    ------
    FlightError
        As `read_track` does.
    """
    record = records(source, SMRMSG)
    for name in POSITIVE:
        values = record[name]
        _refuse(source, name, values, ~((values > 0) & (values < 1e6)), "a positive number")
    metres = [record[name] for name in ("east", "north", "down")]
    degrees = [record[name] / 60.0 for name in ("roll", "pitch", "heading")]
    sigma = np.stack([*metres, *degrees], axis=-1)
    return Deviations(source=source, time=_increasing(source, record), sigma=sigma)


def _increasing(source: Opened, record: NDArray[Any]) -> Array:
    values = record["time"]
    _refuse(source, "time", values, ~np.isfinite(values), "seconds of the week")
    time = _continued(values)
    _refuse(source, "time", values, np.diff(time, prepend=-np.inf) <= 0, "after that before")
    return time


def _refuse(source: Opened, name: str, values: Array, bad: NDArray[Any], expected: str) -> None:
    """Refuse the first record with a value that is wrong."""
    wrong_rows = np.flatnonzero(bad)
    if len(wrong_rows):
        fault = f"record {wrong_rows[0] + 1} of {len(values)} has {values[wrong_rows[0]]!r}"
        raise source.wrong(name, fault.replace("np.float64", ""), f"must be {expected}")


# --- Position, attitude and standard deviations between the records of a trajectory


AXIS_M, FLATTENING = 6_378_137.0, 1 / 298.257222101
"""GRS 80; that of WGS 84 differs by 0.1 mm. It turns velocities into rates of angles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Between:
    """Where times lie between the records of a trajectory.

    Attributes
    ----------
    before : ndarray of int, shape (n,)
        The record before each time; the next is the one after it.
    share : ndarray, shape (n,)
        Of the interval that has passed, 0 to 1.
    interval : ndarray, shape (n,)
        Seconds.
    """

    before: Index
    share: Array
    interval: Array

    @classmethod
    def of(cls, times: Array, t: Array) -> Between:
        """Return where times lie between increasing ones, two at least; outside: the end's."""
        before = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        interval = times[before + 1] - times[before]
        return cls(before=before, share=(t - times[before]) / interval, interval=interval)


def _positions(track: Track, between: Between, *, by_velocity: bool) -> Array:
    """Return longitude, latitude (deg) and height (m), shape (n, 3)."""
    first, last = track.lonlath(between.before), track.lonlath(between.before + 1)
    step = last - first
    step[:, 0] = (step[:, 0] + np.pi) % (2 * np.pi) - np.pi
    s = between.share[:, None]
    x = first + s * step
    if by_velocity:  # a cubic, whose error grows with the fourth power of the interval
        begin, end = (between.interval[:, None] * _rates(track, between.before + k) for k in (0, 1))
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


def _attitudes(track: Track, between: Between) -> Array:
    """Return roll, pitch and true heading, rad, shape (n, 3); the body turns at a constant rate."""
    R_n_b, after = (frames.rotation_from_rph(track.rph(between.before + k)) for k in (0, 1))
    turned = frames.log(np.swapaxes(R_n_b, -1, -2) @ after)
    rph = frames.rph_from_rotation(R_n_b @ frames.exp(between.share[:, None] * turned))
    return np.column_stack([rph[:, :2], rph[:, 2] % (2 * np.pi)])


def _velocity_misfit(track: Track, between: Between) -> tuple[float, float]:
    """Return how much velocities and changes of position differ, and the speed; medians, m/s."""
    rows = np.unique(between.before)
    first, last = track.lonlath(rows), track.lonlath(rows + 1)
    step = last - first
    step[:, 0] = (step[:, 0] + np.pi) % (2 * np.pi) - np.pi
    dt = (track.time[rows + 1] - track.time[rows])[:, None]
    rates = 0.5 * (_rates(track, rows) + _rates(track, rows + 1))
    across = np.column_stack([AXIS_M * np.cos(first[:, 1]), np.full((len(rows), 2), [AXIS_M, 1.0])])
    off = np.linalg.norm(across * (step / dt - rates), axis=1)
    return float(np.median(off)), float(np.median(np.linalg.norm(across * rates, axis=1)))


WEEK_SOW = "gps-week-sow"
ISO, ISO_UTC, ISO_GPS = "iso-8601", "iso-8601-utc", "iso-8601-gps"
"""Seconds of the GPS week in GPS time or UTC, the former with the week; dates with their zone, or
without one in UTC or GPS time."""

WEEK_S = 604_800.0
SECONDS = Range(0.0, WEEK_S + 86_400.0, "must be seconds of the week, 0 to 604800")
WEEKS = Range(0, 100_000, "must be the GPS week, a whole number", whole=True)
FIRST_DAY = dt.datetime(1980, 1, 6, tzinfo=dt.UTC)
"""When GPS weeks began."""


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


def _continued(times: Array) -> Array:
    """Return seconds of the week that count on through the end of a week."""
    falls = np.diff(times, prepend=times[:1]) < -WEEK_S / 2
    return times + WEEK_S * np.cumsum(falls)


def _on_clock(weeks: Array, seconds: Array, times: Array) -> Array:
    """Return the times of events on the clock of a trajectory, whose week no file says."""
    nearest = np.round((times[[0, -1]].mean() - seconds) / WEEK_S)
    if np.isfinite(weeks).all():
        nearest = weeks - weeks[0] + nearest[0]
    return np.asarray(seconds + WEEK_S * nearest, dtype=float)


# --- A list of events: names of images, and when they were exposed


def _events(source: Opened, columns: str, base: str) -> tuple[Listed, list[str], Array, Array]:
    """Return the events of a text: their list, names, GPS weeks, seconds of the week.

    Weeks are NaN where none is stated.
    """
    listed = read_list(source, columns, numbers=("time", "week"))
    name = next((column for column in ("exposure", "image") if listed.has(column)), "")
    needed = ("time", "week") if base == WEEK_SOW else ("time",)
    missing = [column for column in needed if not listed.has(column)] + ["image"] * (not name)
    if missing:
        raise source.wrong("columns", f"{missing[0]!r} is missing", f"--time {base} needs it")
    if listed.has("week") and base != WEEK_SOW:
        expected = f"needs --time {WEEK_SOW}; or declare skip"
        raise source.wrong("columns", "'week' is there", expected)
    k_time, k_week = listed.at("time"), listed.at("week")
    stamps = []
    for row in listed.rows:
        if base.startswith(ISO):
            stamps.append(_of_date(row, base, row.cell(k_time, "time")))
        else:
            seconds = row.number_at(k_time, "time", SECONDS)
            is_dated = base == WEEK_SOW
            week = row.number_at(k_week, "week", WEEKS) if is_dated else float("nan")
            stamps.append((week, seconds))
    weeks, seconds_of = np.array(stamps, dtype=float).T
    return listed, listed.unique(name), weeks, seconds_of
