"""The trajectory of POSPac, taken at the times of events."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array, Mask
from acx4lib.flight.problems import Problem, lines_of
from acx4lib.flight.table_files import free_memory
from acx4lib.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4tools.exchange.brought import Brought
from acx4tools.exchange.safe import opened
from acx4tools.exchange.trajectories import interpolation, orientations, sbet
from acx4tools.exchange.trajectories.events import Events, read_events
from acx4tools.exchange.trajectories.orientations import Meaning
from acx4tools.exchange.trajectories.times import GPS_SOW, UTC_SOW, is_utc, on_clock

SHARE_OF_MEMORY = 4
"""A trajectory may take the free memory divided by this."""

SLACK_S = 2.0
"""Standard deviations, of one record a second, may begin later and end sooner by this."""

FAITHFUL_MS, FAITHFUL = 0.5, 0.1
"""Largest difference of velocities from changes of position: m/s, or a share of the speed."""

NAMES = {GPS_SOW: "GPS time", UTC_SOW: "UTC"}


@dataclass(frozen=True, kw_only=True)
class SbetOptions:
    """What the files do not say.

    Attributes
    ----------
    columns : str
        Of the list of events; empty: its heading names them.
    separator : str
        Of its cells; empty: found from its first line.
    time : str
        Base of the events' times, one of `times.BASES`.
    trajectory_time : str
        That of the trajectory, `gps-sow` or `utc-sow`.
    leap_seconds : float or None
        GPS time minus UTC, where the bases differ.
    week : int or None
        GPS week in which the trajectory begins.
    gap_s : float
        Largest interval between two records that is interpolated.
    block, camera : str
        Block of the flight; camera of all images, empty where not said.
    meaning : Meaning
        CRS and heights of the flight.
    """

    time: str
    columns: str = ""
    separator: str = ""
    trajectory_time: str = GPS_SOW
    leap_seconds: float | None = None
    week: int | None = None
    gap_s: float = 0.1
    block: str = "calibration"
    camera: str = ""
    meaning: Meaning = field(default_factory=Meaning)


def read(trajectory: Path, events: Path, deviations: Path | None, options: SbetOptions) -> Brought:
    """Return a trajectory at the times of events.

    Parameters
    ----------
    trajectory, events : Path
        SBET, and text with a name and a time in every row.
    deviations : Path or None
        SMRMSG.
    options : SbetOptions

    Raises
    ------
    FlightError
        With file and line: where a file is cut off or no such file, time bases differ and no leap
        seconds are given, or an event lies outside the trajectory or in a gap.
    """
    track = sbet.read_track(_opened(trajectory))
    listed = read_events(
        opened.of_windows(_opened(events)),
        columns=options.columns,
        separator=options.separator,
        base=options.time,
    )
    if len(track.time) < 2:
        raise track.source.wrong("file", "has one record", "must have two at least")
    t = on_clock(listed.stamps, track.time, ahead=_ahead(listed, options), week=options.week)
    _refuse_outside(track, listed, t, options)
    spread = sbet.read_deviations(_opened(deviations)) if deviations else None
    if spread is not None:
        _refuse_without_deviation(spread, listed, t)
    return _brought(track, listed, spread, t, options)


def _opened(path: Path) -> opened.Opened:
    return opened.read(path, most=free_memory() // SHARE_OF_MEMORY)


def _ahead(listed: Events, options: SbetOptions) -> float:
    """Return the seconds by which the trajectory's clock is ahead of that of the events."""
    events_utc, track_utc = is_utc(options.time), is_utc(options.trajectory_time)
    if events_utc == track_utc:
        return 0.0
    if options.leap_seconds is None:
        ours, theirs = NAMES[options.trajectory_time], "UTC" if events_utc else "GPS time"
        found = f"are {theirs}, those of the trajectory {ours}"
        expected = "needs --leap-seconds, 18 since 2017; or declare --time or --trajectory-time"
        raise listed.listed.source.wrong("times", found, expected)
    return options.leap_seconds if events_utc else -options.leap_seconds


def _refuse_outside(track: sbet.Track, listed: Events, t: Array, options: SbetOptions) -> None:
    first, last = track.time[[0, -1]].tolist()
    file = Path(track.source.file).name
    at = interpolation.between(track.time, t)
    outside = (t < first) | (t > last)
    gap = ~outside & (at.interval > options.gap_s)
    places = f"must lie between {first:.3f} and {last:.3f} s, of {file}"
    problems = _problems(listed, outside, lambda k: f"is {t[k]:.3f} s", places)
    usual = float(np.median(np.diff(track.time)))
    cure = f"must be at most {options.gap_s:g} s: --gap; usual are {usual:.3g} s"
    problems += _problems(listed, gap, lambda k: f"lies in a gap of {at.interval[k]:.3f} s", cure)
    if problems:
        raise FlightError(lines_of(problems))


def _refuse_without_deviation(spread: sbet.Deviations, listed: Events, t: Array) -> None:
    first, last = (spread.time[[0, -1]] + [-SLACK_S, SLACK_S]).tolist()
    name = Path(spread.source.file).name
    places = f"must lie between {first:.3f} and {last:.3f} s, of {name}"
    outside = (t < first) | (t > last)
    problems = _problems(listed, outside, lambda k: f"is {t[k]:.3f} s", places)
    if problems:
        raise FlightError(lines_of(problems))


def _problems(listed: Events, where: Mask, found: Any, expected: str) -> list[Problem]:
    rows, file = listed.listed.rows, listed.listed.source.file
    return [
        Problem(file=file, line=rows[k].number, column="time", found=found(k), expected=expected)
        for k in np.flatnonzero(where).tolist()
    ]


def _brought(
    track: sbet.Track,
    listed: Events,
    spread: sbet.Deviations | None,
    t: Array,
    options: SbetOptions,
) -> Brought:
    at = interpolation.between(track.time, t)
    off, speed = interpolation.velocity_misfit(track, at)
    faithful = off <= max(FAITHFUL_MS, FAITHFUL * speed)
    lonlath = interpolation.positions(track, at, by_velocity=faithful)
    rph = np.degrees(interpolation.attitudes(track, at))
    meaning, lonlat = options.meaning, lonlath[:, :2]
    height = orientations.in_flight(track.source, meaning, lonlat, lonlath[:, 2])
    table: dict[str, Any] = {
        "exposure": listed.names,
        "lat_deg": np.round(lonlath[:, 1], 11),
        "lon_deg": np.round(lonlath[:, 0], 11),
        "height_m": np.round(height, 5),
        **dict(zip(("roll_deg", "pitch_deg", "heading_deg"), np.round(rph, 9).T, strict=True)),
        "time_s": np.round(t, 7),
    }
    if spread is not None:
        sigma = np.round(interpolation.deviations(spread, t), 7)
        table |= dict(zip((*SIGMA_POSITION, *SIGMA_ATTITUDE), sigma.T, strict=True))
    tables = {f"{options.block}/trajectory.csv": table}
    if options.camera:
        images = {"image": listed.names, "camera": [options.camera] * len(t)}
        tables[f"{options.block}/images.csv"] = images | {"exposure": listed.names}
    sources = [track.source, listed.listed.source, *([spread.source] if spread else [])]
    return Brought(
        source="SBET at events",
        sha256=opened.checksums(sources),
        settings=orientations.settings(meaning),
        tables=tables,
        pictures=orientations.grid_file(meaning),
        assumed=_assumed(listed, options),
        found=_found(track, spread, t, off, speed),
        left_out=_left_out(spread, faithful=faithful, off=off),
    )


def _assumed(listed: Events, options: SbetOptions) -> tuple[str, ...]:
    seconds, dated = options.leap_seconds, np.isfinite(listed.stamps.weeks).all()
    shift = is_utc(options.time) != is_utc(options.trajectory_time)
    columns = " ".join(one.name for one in listed.listed.columns)
    weeks = "by their weeks" if dated and options.week is not None else "in the nearest week"
    heading = "" if listed.listed.heading is None else "; its first line is a heading"
    return (
        f"The trajectory counts seconds of the week in {NAMES[options.trajectory_time]}; the times "
        f"of the events are {options.time}"
        + (f", and GPS time is {seconds:g} s ahead of UTC" if shift else "")
        + f"; they are placed {weeks}.",
        f"The columns of the list of events are: {columns}{heading}.",
        "True heading is platform heading minus wander angle; roll, pitch and heading are forward-"
        "right-down against north-east-down.",
        "Positions are those of the point to which the SBET refers, taken for the IMU; latitude "
        "and longitude are of the datum of the flight's CRS.",
        orientations.heights_said(replace(options.meaning, ellipsoidal=True)),
    )


def _found(
    track: sbet.Track, spread: sbet.Deviations | None, t: Array, off: float, speed: float
) -> tuple[str, ...]:
    interval = np.diff(track.time)
    lines = [
        f"{len(t)} events in {len(track.time)} records of the SBET, {np.median(interval):.4g} s "
        f"apart, at most {interval.max():.4g} s.",
        f"Velocities, turned by the wander angle, and changes of position differ by {off:.3f} m/s "
        f"(median over the events) at {speed:.2f} m/s.",
    ]
    if spread is not None:
        lines.append(
            f"Standard deviations from {len(spread.time)} records of the SMRMSG, linear between "
            "them; of angles in arc minutes there."
        )
    return tuple(lines)


def _left_out(spread: sbet.Deviations | None, *, faithful: bool, off: float) -> tuple[str, ...]:
    lines = ["Accelerations and rates of turn of the SBET: attitudes turn evenly between records."]
    if not faithful:
        lines.append(
            f"Velocities: they differ from the changes of position by {off:.2f} m/s; positions "
            "are on straight lines between records."
        )
    if spread is None:
        lines.append("No SMRMSG was given: the standard deviations are those of [apriori].")
    else:
        lines.append("Standard deviations of velocities; correlations are not in the SMRMSG.")
    return tuple(lines)
