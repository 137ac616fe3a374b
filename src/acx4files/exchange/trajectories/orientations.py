"""Lists of orientations in one of the two forms that a flight's trajectory has.

A text has declared columns or a heading that names them; that of Applanix has its own.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from acx4files.exchange import safe
from acx4files.exchange.flight_folder import ImportedFlight, number_of
from acx4files.exchange.options import Block, Camera, Columns, Crs, Ellipsoidal, Heights, Option
from acx4files.exchange.safe import Line, Opened, cut, lines
from acx4files.exchange.trajectories.listed import (
    MEASURED,
    NUMBERS,
    SKIP,
    SURVEYED,
    UNITS,
    Column,
    Listed,
    left_out,
    position_of,
    read_list,
    text_said,
)
from acx4files.flight.problems import Problem, lines_of, quoted
from acx4files.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry import frames
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, GridSystem

OPK, RPH = ("omega", "phi", "kappa"), ("roll", "pitch", "heading")
GRID, GEOGRAPHIC = ("east", "north"), ("lat", "lon")
TURN_DEG = 360.0
METRES_A_DEGREE = 111_320.0
AGREED_M = 1.0
"""Within this, and the last digit, positions in two forms must agree."""


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """Conventions that a list does not state of its numbers.

    Attributes
    ----------
    crs : str
        Projected CRS of the flight; empty where positions and attitudes need none.
    angle : str
        Unit of attitudes whose columns do not say it, one of `listed.UNITS`.
    order : str
        opk: R = Rx(omega) Ry(phi) Rz(kappa); pok: Ry(phi) Rx(omega) Rz(kappa).
    north : str
        ``grid`` or ``true``: against what kappa, or the heading, is counted; empty: kappa against
        the grid, the heading from true north.
    heights : str or float
        Of the flight, as `GridSystem` takes it.
    ellipsoidal : bool
        Whether those of the list are ellipsoidal, whatever the flight's are.
    ground_m : float or None
        Heights above this one carry the scale of the map.
    """

    crs: str = ""
    angle: str = "deg"
    order: str = "opk"
    north: str = ""
    heights: str | float = "ellipsoidal"
    ellipsoidal: bool = False
    ground_m: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Oriented:
    """Positions and attitudes of a list, as far as it has them.

    Attributes
    ----------
    east_north, lonlat : ndarray, shape (n, 2), or None
        Metres; degrees. One is there at least.
    height : ndarray, shape (n,)
    opk, rph : ndarray, shape (n, 3), or None
        Radians. One of them is there, but for points.
    """

    east_north: Array | None
    lonlat: Array | None
    height: Array
    opk: Array | None = None
    rph: Array | None = None

    def north(self, meaning: Meaning) -> str:
        """Return against which north the attitudes are, ``grid`` or ``true``."""
        return meaning.north or ("true" if self.opk is None else "grid")


def _oriented(listed: Listed, meaning: Meaning) -> Oriented:
    """Return the numbers of a list."""
    forms = [form for form in (OPK, RPH) if listed.has(*form)]
    if len(forms) != 1 or not _is_located(listed):
        names = [column.name for column in listed.columns]
        expected = (
            "must have east north or lat lon, height, and omega phi kappa or roll pitch heading; "
            "declare them by --columns"
        )
        raise _of_columns(listed, f"are {', '.join(names)}", expected)
    angles = np.radians(np.stack([_degrees(listed, n, meaning.angle) for n in forms[0]], axis=-1))
    located = _located(listed)
    return replace(located, **{"opk" if forms[0] == OPK else "rph": angles})


def _is_located(listed: Listed) -> bool:
    """Tell whether a list has the columns of a position in the grid, or of a geographic one."""
    return listed.has("height") and (listed.has(*GRID) or listed.has(*GEOGRAPHIC))


def _located(listed: Listed) -> Oriented:
    """Return the positions of a list that has them, without attitudes."""
    lonlat = None
    if listed.has(*GEOGRAPHIC):
        lonlat = np.stack([_degrees(listed, name, "deg") for name in ("lon", "lat")], axis=-1)
        _refuse_far(listed, lonlat)
    east_north = None
    if listed.has(*GRID):
        east_north = np.stack([listed.numbers(name) for name in GRID], axis=-1)
    return Oriented(east_north=east_north, lonlat=lonlat, height=listed.numbers("height"))


def _trajectory(listed: Listed, oriented: Oriented, meaning: Meaning) -> dict[str, Any]:
    """Return the columns of trajectory.csv but for the exposures.

    Omega, phi, kappa against the grid stay what they are; all else becomes latitude, longitude,
    roll, pitch and true heading.
    """
    if oriented.opk is not None:
        R_a_b = _rotation(oriented.opk, meaning.order)
        if oriented.north(meaning) == "grid":
            table = _on_grid(listed, oriented, meaning, R_a_b)
        else:
            R_n_b = R_ENU_NED @ R_a_b @ R_FRD_FLU
            table = _geographic(listed, oriented, meaning, frames.rph_from_rotation(R_n_b))
    else:
        rph = np.zeros((0, 3)) if oriented.rph is None else oriented.rph.copy()
        if oriented.north(meaning) == "grid":
            grid = _grid_system(listed.source, meaning, "a heading from grid north")
            rph[:, 2] += grid.convergence(_lonlat_of(listed, oriented, meaning))
        table = _geographic(listed, oriented, meaning, rph)
    return table | _extras(listed, meaning)


def _grid_system(source: Opened, meaning: Meaning, needed_by: str) -> GridSystem:
    """Return the CRS and the heights of the flight."""
    if not meaning.crs:
        raise source.wrong("--crs", "is not given", f"{needed_by} need it, such as EPSG:32633")
    try:
        return GridSystem(crs=meaning.crs, heights=meaning.heights)
    except ValueError as error:
        expected = "must be a projected CRS in metres, and heights that PROJ can compute"
        raise source.wrong("--crs", str(error), expected) from None


def in_flight(source: Opened, meaning: Meaning, lonlat: Array, ellipsoidal: Array) -> Array:
    """Return ellipsoidal heights in the height system of the flight, m, shape (n,).

    Parameters
    ----------
    source : Opened
        Which errors name.
    meaning : Meaning
    lonlat : ndarray, shape (n, 2)
        Degrees.
    ellipsoidal : ndarray, shape (n,)
    """
    if meaning.heights == "ellipsoidal":
        return ellipsoidal
    undulation = _grid_system(source, meaning, "ellipsoidal heights").undulation(lonlat)
    if not np.isfinite(undulation).all():
        k = int(np.flatnonzero(~np.isfinite(undulation))[0])
        fault = f"position {k + 1}, {lonlat[k, 1]:.5f} {lonlat[k, 0]:.5f},"
        raise source.wrong("height", fault, f"must lie inside the geoid grid {meaning.heights}")
    return ellipsoidal - undulation


def _lonlat_of(listed: Listed, oriented: Oriented, meaning: Meaning) -> Array:
    """Return longitude and latitude, deg, shape (n, 2), of east and north if it has both."""
    if oriented.lonlat is not None and (oriented.east_north is None or not meaning.crs):
        return oriented.lonlat
    grid = _grid_system(listed.source, meaning, "east and north, and attitudes against true north")
    return _reached(listed, grid.lonlat_from_grid(np.asarray(oriented.east_north)))


def _apart(listed: Listed, oriented: Oriented, meaning: Meaning) -> float:
    """Return the largest distance of the grid positions from the geographic ones, m."""
    grid = _grid_system(listed.source, meaning, "positions in two forms")
    off = grid.grid_from_lonlat(np.asarray(oriented.lonlat)) - np.asarray(oriented.east_north)
    far = np.hypot(*off.T)
    k_lat = listed.at("lat")
    decimals = min(len(row.cells[k_lat].partition(".")[2]) for row in listed.rows)
    allowed = AGREED_M + METRES_A_DEGREE * 10.0**-decimals
    expected = f"must be within {allowed:.4g} m of lat, lon in {meaning.crs}; is --crs right?"
    _refuse(listed, "east, north", ~(far <= allowed), expected)
    return float(far.max())


def _rotation(opk: Array, order: str) -> Array:
    if order == "opk":
        return frames.rotation_from_opk(opk)
    omega, phi, kappa = opk.T
    return frames.turn(1, phi) @ frames.turn(0, omega) @ frames.turn(2, kappa)


def _on_grid(listed: Listed, oriented: Oriented, meaning: Meaning, R_g_b: Array) -> dict[str, Any]:
    opk = np.degrees(frames.opk_from_rotation(R_g_b))
    attitude = dict(zip(("omega_deg", "phi_deg", "kappa_deg"), np.round(opk, 9).T, strict=True))
    return _in_grid(listed, oriented, meaning) | attitude


def _in_grid(listed: Listed, oriented: Oriented, meaning: Meaning) -> dict[str, Any]:
    """Return east, north and height in the systems of the flight, columns of its tables."""
    east_north = oriented.east_north
    if east_north is None:
        grid = _grid_system(
            listed.source, meaning, "latitude and longitude that become east and north"
        )
        east_north = _reached(listed, grid.grid_from_lonlat(np.asarray(oriented.lonlat)))
    east, north = np.round(east_north, 5).T
    return {"east_m": east, "north_m": north} | _height(listed, oriented, meaning)


def _geographic(listed: Listed, oriented: Oriented, meaning: Meaning, rph: Array) -> dict[str, Any]:
    lon, lat = np.round(_lonlat_of(listed, oriented, meaning), 11).T
    angles = np.degrees(rph)
    angles[:, 2] %= TURN_DEG
    names = ("roll_deg", "pitch_deg", "heading_deg")
    attitude = dict(zip(names, np.round(angles, 9).T, strict=True))
    return {"lat_deg": lat, "lon_deg": lon} | _height(listed, oriented, meaning) | attitude


def _height(listed: Listed, oriented: Oriented, meaning: Meaning) -> dict[str, Array]:
    """Return the heights in the system of the flight, unscaled."""
    height = oriented.height
    if meaning.ground_m is not None:
        grid = _grid_system(listed.source, meaning, "heights with the scale of the map")
        scale = grid.scale(_lonlat_of(listed, oriented, meaning))
        height = meaning.ground_m + (height - meaning.ground_m) / scale
    if meaning.ellipsoidal and meaning.heights != "ellipsoidal":
        height = in_flight(listed.source, meaning, _lonlat_of(listed, oriented, meaning), height)
    return {"height_m": np.round(height, 5)}


def _extras(listed: Listed, meaning: Meaning) -> dict[str, Array]:
    """Return times and standard deviations, where the list has them."""
    table: dict[str, Array] = {}
    if listed.has("time"):
        table["time_s"] = listed.numbers("time")
    for name in (*SIGMA_POSITION, *SIGMA_ATTITUDE):
        word = name.rpartition("_")[0]
        if listed.has(word):
            values = listed.numbers(word)
            if name in SIGMA_ATTITUDE:
                values = np.round(values * UNITS[_unit(listed, word, meaning.angle)], 9)
            table[name] = values
    return table


def _unit(listed: Listed, name: str, otherwise: str) -> str:
    return listed.columns[listed.at(name)].unit or otherwise


def _degrees(listed: Listed, name: str, otherwise: str) -> Array:
    """Return an angle in degrees, refused where it is more than a turn."""
    unit = _unit(listed, name, otherwise)
    values = listed.numbers(name) * UNITS[unit]
    _refuse(listed, name, np.abs(values) > TURN_DEG, f"must be an angle in {unit}, within a turn")
    return values


def _refuse_far(listed: Listed, lonlat: Array) -> None:
    wrong = np.abs(lonlat[:, 1]) > TURN_DEG / 4
    _refuse(listed, "lat", wrong, "must lie between -90 and 90 degrees")


def _reached(listed: Listed, values: Array) -> Array:
    wrong = ~np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    _refuse(listed, "position", wrong, "must lie where the CRS holds")
    return values


def _refuse(listed: Listed, name: str, wrong: Any, expected: str) -> None:
    rows, file = listed.rows, listed.source.file
    position = position_of(listed.columns, name)
    problems = [
        Problem(
            file=file,
            line=rows[k].number,
            column=name,
            found=quoted(" ".join(rows[k].cells) if position is None else rows[k].cells[position]),
            expected=expected,
        )
        for k in np.flatnonzero(wrong).tolist()
    ]
    if problems:
        raise FlightError(lines_of(problems))


def _of_columns(listed: Listed, fault: str, expected: str) -> FlightError:
    line = listed.heading.number if listed.heading else 1
    return listed.source.wrong("columns", fault, expected, line=line)


def settings(meaning: Meaning) -> dict[str, Any]:
    """Return the keys of flight.toml on CRS and heights; a geoid grid is named as in the flight."""
    file = next(iter(grid_file(meaning)), "")
    return ({"crs": meaning.crs} if meaning.crs else {}) | {"heights": file or meaning.heights}


def grid_file(meaning: Meaning) -> dict[str, Path]:
    """Return the file of a geoid grid by its name in the flight; none where heights name none."""
    heights = meaning.heights
    if not isinstance(heights, str) or heights == "ellipsoidal" or not Path(heights).is_file():
        return {}
    return {Path(heights).name: Path(heights)}


def heights_said(meaning: Meaning) -> str:
    """Return the sentence on heights."""
    heights = meaning.heights
    named = (
        f"by {Path(heights).name}"
        if isinstance(heights, str)
        else f"by an undulation of {heights:g} m"
    )
    system = "ellipsoidal" if heights == "ellipsoidal" else named
    if meaning.ellipsoidal and heights != "ellipsoidal":
        system = f"ellipsoidal there, and {named} in the flight"
    ground = (
        ""
        if meaning.ground_m is None
        else f"; above {meaning.ground_m:g} m they carry the scale of the map, which is taken out"
    )
    return f"Heights are {system}{ground}."


# --- A text with a row for each image: its position and attitude, in declared columns


NORTH = {"grid": "grid north", "true": "true north"}


def read(  # noqa: PLR0913 options of a command
    source: Annotated[Path, Option("TABLE", "Text with a row for each image.")],
    *,
    columns: Columns = "",
    order: Annotated[
        Literal["opk", "pok"], Option("", "First rotation: omega (opk) or phi (pok).")
    ] = "opk",
    north: Annotated[
        Literal["grid", "true"] | None,
        Option("", "Else kappa is from the grid, a heading from true."),
    ] = None,
    of: Annotated[
        Literal["imu", "camera"], Option("", "Whose positions and attitudes they are.")
    ] = "imu",
    ellipsoidal: Ellipsoidal = False,
    scaled_above: Annotated[
        float | None,
        Option("M", "Heights above M have the map's scale, as IGN's: taken out."),
    ] = None,
    block: Block = "calibration",
    camera: Camera = "",
    crs: Crs = "",
    heights: Heights = None,
) -> ImportedFlight:
    """Read a table with a row for each image: its position and its attitude.

    The columns are those of its heading, or of --columns: image, east, north, height or lat, lon,
    height; omega, phi, kappa or roll, pitch, heading; camera, time, week, sigma_east, skip. Angles
    are degrees, or in the unit that a column names, as kappa_gon or kappa_rad.

    With --columns pospac it is a text export of POSPac, exterior orientations or the trajectory at
    events, whose heading and preamble say columns and units. Its omega, phi and kappa are the
    camera's: another program's boresight is in them. Its roll, pitch and heading are the IMU's.

    Examples
    --------
    acx4 import orientations eo.csv --crs EPSG:32633 --of camera --out flight
    acx4 import orientations ins.txt --columns "image lat lon height roll pitch heading" --out f
    acx4 import orientations event1.txt --columns pospac --crs EPSG:31982 --out flight

    Raises
    ------
    FlightError
        With file and line.
    """
    meaning = Meaning(
        crs=crs,
        order=order,
        north=north or "",
        heights="ellipsoidal" if heights is None else heights,
        ellipsoidal=ellipsoidal,
        ground_m=scaled_above,
    )
    text = safe.of_windows(safe.read(source))
    if columns == POSPAC:
        return _pospac(text, meaning, block, camera)
    listed = read_list(text, columns, numbers=NUMBERS)
    return _brought(listed, meaning, block, camera, of=of, source="Table of orientations")


def _brought(
    listed: Listed,
    meaning: Meaning,
    block: str,
    camera: str,
    *,
    of: str,
    source: str,
    says: tuple[str, ...] = (),
) -> ImportedFlight:
    """Return a list of orientations as a part of a flight; `says` are its own statements."""
    oriented = _oriented(listed, meaning)
    names = _names(listed)
    table = {"exposure": names, **_trajectory(listed, oriented, meaning)}
    tables: dict[str, Any] = {f"{block}/trajectory.csv": table}
    if camera or listed.has("camera"):
        tables[f"{block}/images.csv"] = _images(listed, names, camera)
    return ImportedFlight(
        source=source,
        sha256=safe.checksums([listed.source]),
        settings=settings(meaning),
        tables=tables,
        pictures=grid_file(meaning),
        assumed=_assumed(listed, oriented, meaning, of),
        found=(*_found(listed, oriented, meaning), *says),
        left_out=left_out(listed, "orientation"),
    )


def _names(listed: Listed) -> list[str]:
    """Return the names of exposures: images, events, or else the numbers of the rows from 1."""
    name = next((column for column in ("image", "exposure") if listed.has(column)), "")
    return listed.unique(name) if name else [str(k + 1) for k in range(len(listed.rows))]


def _images(listed: Listed, names: list[str], camera: str) -> dict[str, Any]:
    cameras = [camera] * len(names) if camera else listed.names("camera")
    table: dict[str, Any] = {"image": names, "camera": cameras, "exposure": names}
    if listed.has("strip"):
        table["strip"] = listed.names("strip")
    return table


def _assumed(listed: Listed, oriented: Oriented, meaning: Meaning, of: str) -> tuple[str, ...]:
    columns = " ".join(column.name for column in listed.columns)
    heading = "declaration" if listed.declared else "its heading"
    numbered = "" if listed.has("image") or listed.has("exposure") else "; exposures are numbered"
    unit = {listed.columns[listed.at(name)].unit or meaning.angle for name in _angles(oriented)}
    north = NORTH[oriented.north(meaning)]
    if oriented.opk is not None:
        order = (
            "Rx(omega) Ry(phi) Rz(kappa)"
            if meaning.order == "opk"
            else ("Ry(phi) Rx(omega) Rz(kappa)")
        )
        attitude = (
            f"Omega, phi, kappa in {', '.join(sorted(unit))}: R = {order} takes the axes of the "
            f"{of} (x, y, up) to east, north, up; kappa is against {north}."
        )
    else:
        attitude = (
            f"Roll, pitch, heading in {', '.join(sorted(unit))}: forward-right-down against "
            f"north-east-down; the heading is from {north}."
        )
    return (
        f"The columns, by {heading}, are: {columns}; x counts east, y north{numbered}.",
        *text_said(listed),
        attitude,
        _whose(of),
        heights_said(meaning),
    )


def _whose(body: str) -> str:
    if body == "imu":
        return (
            "Positions and attitudes are those of the IMU: no boresight, no lever arm is applied."
        )
    return (
        "Positions and attitudes are those of the camera, with another program's boresight and "
        "lever arm: the camera stands in the place of the IMU, and what is then estimated as "
        "boresight is a correction to that program's."
    )


def _angles(oriented: Oriented) -> tuple[str, ...]:
    return OPK if oriented.opk is not None else RPH


def _found(listed: Listed, oriented: Oriented, meaning: Meaning) -> tuple[str, ...]:
    lines = [f"Positions and attitudes: {len(listed.rows)}."]
    angles = oriented.opk if oriented.opk is not None else oriented.rph
    low, high = (
        np.degrees(np.asarray(angles)).min(axis=0),
        np.degrees(np.asarray(angles)).max(axis=0),
    )
    ranges = zip(_angles(oriented), low, high, strict=True)
    lines.append("; ".join(f"{n} {a:.2f} to {b:.2f} deg" for n, a, b in ranges) + ".")
    if oriented.east_north is not None and oriented.lonlat is not None and meaning.crs:
        largest = _apart(listed, oriented, meaning)
        lines.append(
            f"East and north, and latitude and longitude in {meaning.crs}, differ by at most "
            f"{largest:.3f} m."
        )
    return tuple(lines)


# --- Text exports of Applanix's POSPac: exterior orientations, or the trajectory at events
#
# A preamble tells mapping frame, datum, boresight and lever arms; a heading the columns; a line in
# brackets, before the heading or after it, the units; rows follow. The heading has commas, tabs or
# spaces, the rows tabs or spaces. In exterior orientations the column ID may be empty.


POSPAC = "pospac"
"""The columns of such a text."""

ELLIPSOIDAL, ORTHOMETRIC = "height", "orthometric"

PHRASES = {
    r"(?:ELLIPSOID(?:AL)?|ELL\.?) (?:HEIGHT|HGT)": ELLIPSOIDAL,
    r"(?:ORTHOMETRIC|ORTHO|MSL) (?:HEIGHT|HGT)": ORTHOMETRIC,
    r"(?:EAST|NORTH|UP|DOWN)(?:ING)? VELOCITY": SKIP,
    r"EAST(?:ING)? SD": "sigma_east",
    r"NORTH(?:ING)? SD": "sigma_north",
    r"HEIGHT SD": "sigma_height",
    r"ROLL SD": "sigma_roll",
    r"PITCH SD": "sigma_pitch",
    r"HEADING SD": "sigma_heading",
    r"(?:DISTANCE|WANDER(?: ANGLE)?)": SKIP,
    r"EASTING": "east",
    r"NORTHING": "north",
    r"LAT(?:ITUDE)?": "lat",
    r"LON(?:G|GITUDE)?": "lon",
    r"OMEGA": "omega",
    r"PHI": "phi",
    r"KAPPA": "kappa",
    r"ROLL": "roll",
    r"PITCH": "pitch",
    r"HEADING": "heading",
    r"(?:# ?)?EVENT(?: ?#)?": "exposure",
    r"(?:GPS ?)?TIME(?: ?\(S(?:EC)?\))?": "time",
    r"(?:IMAGE |PHOTO )?(?:ID|NAME)": "image",
    r"HEIGHT": ELLIPSOIDAL,
}
"""Phrases of a heading for its columns; the longer of two first."""

# The group is empty and behind its phrase: a branch that begins with a letter is quickly refused.
WORDS = re.compile("|".join(f"{p}(?![A-Z])(?P<_{k}>)" for k, p in enumerate(PHRASES)))
NEEDED = ({"omega", "phi", "kappa"}, {"roll", "pitch", "heading"})
ANGLE = {"DEG": "deg", "GRAD": "gon", "GON": "gon", "RAD": "rad"}
TURN = re.compile(r"(?:FIRST|SECOND|THIRD) ROTATION IS ABOUT THE \W?([XYZ])\W")
"""How a preamble states the sequence of rotations, mapping to image."""

SEQUENCES = {"": "", "XYZ": "opk", "YXZ": "pok"}
"""Orders of `Meaning` by the axes that a preamble lists."""

APPLIED = re.compile(r"(?:BORESIGHT|LEVER ARM) VALUES.*[1-9]")
"""A line of the preamble with a boresight or lever arms that are not zero."""

MOST_PREAMBLE = 60
"""Lines of the preamble that are kept."""


def _pospac(source: Opened, meaning: Meaning, block: str, camera_name: str) -> ImportedFlight:
    """Return the orientations of a text export of POSPac.

    The unit of angles, and the order of omega and phi, are those that the text states. Omega, phi,
    kappa are the camera's; roll, pitch and heading the IMU's, unless the preamble has a boresight
    or lever arms that are not zero.
    """
    heading, columns = _heading(source)
    listed = _listed(source, heading, columns)
    preamble = _preamble(source, heading.number)
    meaning = replace(meaning, angle=_angle_unit(source, listed.rows[0].number))
    names = {column.name for column in columns}
    camera = NEEDED[0] <= names
    applied = camera or any(APPLIED.match(line.upper()) for line in preamble)
    order = _order(source, heading.number) if camera else ""
    meaning = replace(meaning, order=order or meaning.order)
    if ORTHOMETRIC in names:
        if meaning.heights == "ellipsoidal":
            expected = "needs --heights: a vertical CRS, a geoid grid file or a number"
            raise heading.wrong("ORTHOMETRIC HEIGHT", "is no ellipsoidal height", expected)
    else:
        meaning = replace(meaning, ellipsoidal=True)
    if not camera:  # a heading of POSPac is from true north
        meaning = replace(meaning, north="true")
    return _brought(
        _with_height(listed),
        meaning,
        block,
        camera_name,
        of="camera" if applied else "imu",
        source=f"POSPac {'exterior orientations' if camera else 'trajectory at events'}",
        says=(f"The file states: {'; '.join(preamble)}.",) if preamble else (),
    )


def _heading(source: Opened) -> tuple[Line, tuple[Column, ...]]:
    """Return the heading and its columns, a column of every name once."""
    for number, text in enumerate(source.text().split("\n"), start=1):
        upper = re.sub(r"[ \t]+", " ", text.upper())
        if not ("KAPPA" in upper or "HEADING" in upper):
            continue
        words = list(WORDS.finditer(upper))
        names = [list(PHRASES.values())[int(str(word.lastgroup)[1:])] for word in words]
        if any(form <= set(names) for form in NEEDED) and not text.lstrip().startswith("("):
            line = Line(file=source.file, number=number, cells=(text,))
            unknown = re.findall(r"[A-Z]{2,}|\b[XYZ]\b", WORDS.sub("", upper))
            if unknown:
                raise line.wrong(
                    "heading",
                    f"{quoted(unknown[0])} is not known",
                    "declare the columns by --columns",
                )
            first = {name: k for k, name in reversed([*enumerate(names)])}
            once = (name if first[name] == k else SKIP for k, name in enumerate(names))
            return line, tuple(Column(name=name) for name in once)
    expected = (
        "must have a line with EASTING, NORTHING, … OMEGA, PHI, KAPPA or ROLL, PITCH, HEADING"
    )
    raise source.wrong("heading", "is not there", expected)


def _listed(source: Opened, heading: Line, columns: tuple[Column, ...]) -> Listed:
    """Return the rows after the heading; a first column ID that all rows lack is dropped."""
    rows: list[Line] = []
    for line in lines(source):
        are_units = not rows and line.cells[0].startswith("(")
        if line.number > heading.number and not are_units:
            rows.append(line)
    if not rows:
        raise source.wrong("file", "has a heading and no rows", "must have rows")
    text = source.text().split("\n")
    by_tabs = [cut(text[row.number - 1].rstrip(), "\t") for row in rows]
    if all(len(cells) == len(columns) for cells in by_tabs):
        rows = [replace(row, cells=cells) for row, cells in zip(rows, by_tabs, strict=True)]
    else:
        plain = (" ".join(row.cells).replace(",", " ").split() for row in rows)
        rows = [replace(row, cells=tuple(cells)) for row, cells in zip(rows, plain, strict=True)]
    if columns[0].name == "image" and all(_lacks_id(row, columns) for row in rows):
        rows = [replace(row, cells=row.cells[len(row.cells) == len(columns) :]) for row in rows]
        columns = columns[1:]
    for row in rows:
        if len(row) != len(columns):
            count = f"has {len(row)} cells"
            raise row.wrong(
                "row", count, f"must have {len(columns)}, as the heading of line {heading.number}"
            )
    return Listed(source=source, columns=columns, rows=tuple(rows), heading=heading)


def _lacks_id(row: Line, columns: tuple[Column, ...]) -> bool:
    return len(row) == len(columns) - 1 or (len(row) == len(columns) and not row.cells[0])


def _with_height(listed: Listed) -> Listed:
    columns = tuple(
        Column(name="height") if column.name == ORTHOMETRIC else column for column in listed.columns
    )
    return replace(listed, columns=columns)


def _preamble(source: Opened, before: int) -> list[str]:
    text = (" ".join(line.split()) for line in source.text().split("\n")[: before - 1])
    return [line[:200] for line in text if re.search(r"\w", line)][:MOST_PREAMBLE]


def _angle_unit(source: Opened, before: int) -> str:
    """Return the unit of attitudes by the line in brackets, degrees where there is none."""
    for number, text in enumerate(source.text().split("\n")[: before - 1], start=1):
        upper = text.upper()
        if "POSITION IN" not in upper:
            continue
        if not re.search(r"POSITION IN M", upper):
            raise source.wrong("units", quoted(text.strip()), "must be metres", line=number)
        unit = re.search(r"ORIENTATION(?: ANGLES)?(?: AND SD)? IN (DEG|GRAD|GON|RAD)", upper)
        if unit is None:
            expected = "must state degrees, grads or radians"
            raise source.wrong("units", quoted(text.strip()), expected, line=number)
        return ANGLE[unit[1]]
    return "deg"


def _order(source: Opened, before: int) -> str:
    """Return the order of omega, phi, kappa in the preamble; empty where it states none."""
    axes = ""
    for number, text in enumerate(source.text().split("\n")[: before - 1], start=1):
        if turn := TURN.search(text.upper()):
            axes += turn[1]
            if not any(known.startswith(axes) for known in SEQUENCES):
                expected = "must be about x, y, z or y, x, z"
                raise source.wrong("rotations", quoted(text.strip()), expected, line=number)
    return SEQUENCES.get(axes, "")


# --- Texts with a row for each point: measured in an image, or surveyed; in declared columns


ROLES = {"control": "control", "gcp": "control", "check": "check", "chk": "check", "": ""}
PLACES = ("east", "north", "height", "lat", "lon")


def measured(
    sources: Annotated[list[Path], Option("TABLE...", "Texts with a row for each measurement.")],
    *,
    columns: Columns = "",
    first: Annotated[
        Literal["0", "0.5", "1"],
        Option("", "Column and row that it gives the middle of the first pixel."),
    ] = "0",
    block: Block = "calibration",
    camera: Camera = "",
) -> ImportedFlight:
    """Read tables with a row for each point measured in an image, such as IGN's .mes.

    The columns are those of its heading, or of --columns, in any order: point, image, col, row;
    sigma, skip. They are pixels; --first says what the table calls the middle of the first pixel.
    Lines before a heading are not read. What several tables have is put together.

    Examples
    --------
    acx4 import image-points points.csv --first 0.5 --out flight
    acx4 import image-points ties.mes control.mes --columns "point image col row" --out flight

    Raises
    ------
    FlightError
        With file and line; for a point that stands twice in an image, too.
    """
    every = [_measured(path, columns) for path in sources]
    _refuse_twice(every)
    images = [name for listed in every for name in listed.names("image")]
    points = [name for listed in every for name in listed.names("point")]
    colrow = np.concatenate(
        [[listed.numbers("col"), listed.numbers("row")] for listed in every], axis=1
    )
    colrow = np.round(colrow - float(first), 5)
    cols, rows = colrow.tolist()
    table: dict[str, Any] = {"image": images, "point": points, "col_px": cols, "row_px": rows}
    if all(listed.has("sigma") for listed in every):
        table["sigma_px"] = [px for listed in every for px in listed.numbers("sigma").tolist()]
    names = [*dict.fromkeys(images)]
    tables: dict[str, Any] = {f"{block}/image_points.csv": table}
    if camera:
        by = {"image": names, "camera": [camera] * len(names), "exposure": names}
        tables[f"{block}/images.csv"] = by
    (left, top), (right, bottom) = colrow.min(axis=1), colrow.max(axis=1)
    return ImportedFlight(
        source="Table of image points",
        sha256=safe.checksums([listed.source for listed in every]),
        tables=tables,
        assumed=(
            *dict.fromkeys(_columns_said(listed) for listed in every),
            "Columns count to the right and rows down, in pixels; the middle of the first pixel is "
            f"{first}, {first}.",
        ),
        found=(
            f"{number_of(len(images), 'measurements')} of {number_of(len(set(points)), 'points')} "
            f"in {number_of(len(names), 'images')}; columns {left:.1f} to {right:.1f}, rows "
            f"{top:.1f} to {bottom:.1f} px.",
        ),
        left_out=tuple(
            line for listed in every for line in left_out(listed, "measurement", MEASURED)
        ),
    )


def _measured(path: Path, columns: str) -> Listed:
    source = safe.of_windows(safe.read(path))
    listed = read_list(source, columns, numbers=("col", "row"), known=MEASURED)
    _require(listed, "point", "image", "col", "row", says="point image col row")
    return listed


def surveyed(
    source: Annotated[Path, Option("TABLE", "Text with a row for each point.")],
    *,
    columns: Columns = "",
    role: Annotated[
        Literal["control", "check"] | None,
        Option("", "Of points whose role no column says; else control."),
    ] = None,
    ellipsoidal: Ellipsoidal = False,
    crs: Crs = "",
    heights: Heights = None,
) -> ImportedFlight:
    """Read a table with a row for each surveyed point, such as IGN's .app.

    The columns are those of its heading, or of --columns, in any order: point, east, north, height
    or lat, lon, height; sigma_east, sigma_north, sigma_height, role (control or check), skip.

    Examples
    --------
    acx4 import control-points control.csv --crs EPSG:32633 --out flight
    acx4 import control-points block.app --columns "point skip x y z" --role check --out flight

    Raises
    ------
    FlightError
        With file and line.
    """
    system = "ellipsoidal" if heights is None else heights
    meaning = Meaning(crs=crs, heights=system, ellipsoidal=ellipsoidal)
    text = safe.of_windows(safe.read(source))
    listed = read_list(text, columns, numbers=PLACES, known=SURVEYED)
    _require(listed, "point", says="point east north height")
    if not _is_located(listed):
        raise _lacks(listed, "no position", "point east north height")
    located = _located(listed)
    table = {"point": listed.unique("point"), **_in_grid(listed, located, meaning)}
    table |= _extras(listed, meaning)
    if listed.has("role") or role:
        table["role"] = _roles(listed, role or "")
    n_check = sum(use == "check" for use in table.get("role", ()))
    return ImportedFlight(
        source="Table of surveyed points",
        sha256=safe.checksums([text]),
        settings=settings(meaning),
        tables={"control_points.csv": table},
        pictures=grid_file(meaning),
        assumed=(
            _columns_said(listed) + " x counts east, y north.",
            heights_said(meaning),
        ),
        found=(
            f"{number_of(len(listed.rows), 'points')}, {n_check} of them to check; heights "
            f"{table['height_m'].min():.3f} to {table['height_m'].max():.3f} m.",
        ),
        left_out=left_out(listed, "coordinate", SURVEYED),
    )


def _require(listed: Listed, *names: str, says: str) -> None:
    missing = [name for name in names if not listed.has(name)]
    if missing:
        raise _lacks(listed, f"no {missing[0]}", says)


def _lacks(listed: Listed, fault: str, says: str) -> Exception:
    line = listed.heading.number if listed.heading else 1
    expected = f"must be {says}, in any order; declare them by --columns"
    return listed.source.wrong("columns", f"have {fault}", expected, line=line)


def _refuse_twice(every: Sequence[Listed]) -> None:
    first: dict[tuple[str, str], Line] = {}
    for listed in every:
        pairs = zip(listed.names("image"), listed.names("point"), strict=True)
        for row, (image, point) in zip(listed.rows, pairs, strict=True):
            if (image, point) in first:
                before = first[image, point]
                place = f"line {before.number}" + f" of {before.file}" * (before.file != row.file)
                fault = f"{quoted(point)} stands in image {quoted(image)} in {place} already"
                raise row.wrong("point", fault, "must stand once in an image")
            first[image, point] = row


def _roles(listed: Listed, otherwise: str) -> list[str]:
    if not listed.has("role"):
        return [otherwise] * len(listed.rows)
    k = listed.at("role")
    roles = []
    for row in listed.rows:
        cell = row.cell(k, "role")
        if cell.lower() not in ROLES:
            raise row.wrong("role", quoted(cell), "must be control or check")
        roles.append(ROLES[cell.lower()] or otherwise)
    return roles


def _columns_said(listed: Listed) -> str:
    names = " ".join(column.name for column in listed.columns)
    by = "declaration" if listed.declared else "its heading"
    return " ".join([f"The columns, by {by}, are: {names}.", *text_said(listed)])
