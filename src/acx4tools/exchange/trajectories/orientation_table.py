"""A text with a row for each image: its position and attitude, in declared columns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acx4tools.exchange.flight_folder import Brought
from acx4tools.exchange.safe import opened
from acx4tools.exchange.trajectories import orientations
from acx4tools.exchange.trajectories.listed import NUMBERS, Listed, left_out, read_list
from acx4tools.exchange.trajectories.orientations import Meaning

NORTH = {"grid": "grid north", "true": "true north"}


@dataclass(frozen=True, kw_only=True)
class TableOptions:
    """What is done with a list.

    Attributes
    ----------
    columns, separator : str
        As `read_list` takes them.
    of : str
        ``imu``, or ``camera``: whose positions and attitudes they are.
    block, camera : str
        Block of the flight; camera of all images, empty: that of the column, or no images.csv.
    """

    columns: str = ""
    separator: str = ""
    of: str = "imu"
    block: str = "calibration"
    camera: str = ""


def read(path: Path, meaning: Meaning, options: TableOptions) -> Brought:
    """Return the orientations of a text with declared columns.

    Parameters
    ----------
    path : Path
    meaning : Meaning
    options : TableOptions

    Raises
    ------
    FlightError
        With file and line.
    """
    source = opened.of_windows(opened.read(path))
    listed = read_list(source, options.columns, separator=options.separator, numbers=NUMBERS)
    return brought(listed, meaning, options, source="Table of orientations")


def brought(
    listed: Listed,
    meaning: Meaning,
    options: TableOptions,
    *,
    source: str,
    says: tuple[str, ...] = (),
) -> Brought:
    """Return what a list of orientations brings of a flight; `says` is what it states itself."""
    found = orientations.oriented(listed, meaning)
    names = _names(listed)
    table = {"exposure": names, **orientations.trajectory(listed, found, meaning)}
    tables: dict[str, Any] = {f"{options.block}/trajectory.csv": table}
    if options.camera or listed.has("camera"):
        tables[f"{options.block}/images.csv"] = _images(listed, names, options.camera)
    return Brought(
        source=source,
        sha256=opened.checksums([listed.source]),
        settings=orientations.settings(meaning),
        tables=tables,
        pictures=orientations.grid_file(meaning),
        assumed=_assumed(listed, found, meaning, options),
        found=(*_found(listed, found, meaning), *says),
        left_out=left_out(listed, "orientation"),
    )


def _names(listed: Listed) -> list[str]:
    """Return the names of exposures: images, events, or else the numbers of the rows from 1."""
    name = next((one for one in ("image", "exposure") if listed.has(one)), "")
    return listed.unique(name) if name else [str(k + 1) for k in range(len(listed.rows))]


def _images(listed: Listed, names: list[str], camera: str) -> dict[str, Any]:
    cameras = [camera] * len(names) if camera else listed.names("camera")
    table: dict[str, Any] = {"image": names, "camera": cameras, "exposure": names}
    if listed.has("strip"):
        table["strip"] = listed.names("strip")
    return table


def _assumed(
    listed: Listed, found: orientations.Oriented, meaning: Meaning, options: TableOptions
) -> tuple[str, ...]:
    columns = " ".join(one.name for one in listed.columns)
    heading = "declaration" if listed.declared else "its heading"
    numbered = "" if listed.has("image") or listed.has("exposure") else "; exposures are numbered"
    unit = {listed.columns[listed.at(name)].unit or meaning.angle for name in _angles(found)}
    north = NORTH[found.north(meaning)]
    if found.opk is not None:
        order = (
            "Rx(omega) Ry(phi) Rz(kappa)"
            if meaning.order == "opk"
            else ("Ry(phi) Rx(omega) Rz(kappa)")
        )
        attitude = (
            f"Omega, phi, kappa in {', '.join(sorted(unit))}: R = {order} takes the axes of the "
            f"{options.of} (x, y, up) to east, north, up; kappa is against {north}."
        )
    else:
        attitude = (
            f"Roll, pitch, heading in {', '.join(sorted(unit))}: forward-right-down against "
            f"north-east-down; the heading is from {north}."
        )
    return (
        f"The columns, by {heading}, are: {columns}; x counts east, y north{numbered}.",
        *(["The text is in Windows-1252: it is not UTF-8."] if listed.source.encoding else []),
        attitude,
        _whose(options.of),
        orientations.heights_said(meaning),
    )


def _whose(of: str) -> str:
    if of == "imu":
        return (
            "Positions and attitudes are those of the IMU: no boresight, no lever arm is applied."
        )
    return (
        "Positions and attitudes are those of the camera, with another program's boresight and "
        "lever arm: the camera stands in the place of the IMU, and what is then estimated as "
        "boresight is a correction to that program's."
    )


def _angles(found: orientations.Oriented) -> tuple[str, ...]:
    return orientations.OPK if found.opk is not None else orientations.RPH


def _found(listed: Listed, found: orientations.Oriented, meaning: Meaning) -> tuple[str, ...]:
    lines = [f"Positions and attitudes: {len(listed.rows)}."]
    angles = found.opk if found.opk is not None else found.rph
    low, high = (
        np.degrees(np.asarray(angles)).min(axis=0),
        np.degrees(np.asarray(angles)).max(axis=0),
    )
    ranges = zip(_angles(found), low, high, strict=True)
    lines.append("; ".join(f"{n} {a:.2f} to {b:.2f} deg" for n, a, b in ranges) + ".")
    if found.east_north is not None and found.lonlat is not None and meaning.crs:
        largest = orientations.apart(listed, found, meaning)
        lines.append(
            f"East and north, and latitude and longitude in {meaning.crs}, differ by at most "
            f"{largest:.3f} m."
        )
    return tuple(lines)
