"""Lists of orientations in one of the two forms that a flight's trajectory has.

A text has declared columns or a heading that names them; that of Applanix has its own.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from itertools import dropwhile
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
    Column,
    Listed,
    left_out,
    read_list,
    text_said,
)
from acx4files.flight.problems import quoted
from acx4files.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4lib.expected import Array, Mask
from acx4lib.geometry import frames
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, GridSystem

OPK, RPH = ("omega", "phi", "kappa"), ("roll", "pitch", "heading")
GRID, GEOGRAPHIC = ("east", "north"), ("lat", "lon")
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


def grid_system(source: Opened, meaning: Meaning, needed_by: str) -> GridSystem:
    """Return the CRS and the heights of the flight.

    Raises
    ------
    FlightError
        Naming what needs it, where there is none, or it is no projected CRS in metres.
    """
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
    undulation = grid_system(source, meaning, "ellipsoidal heights").undulation(lonlat)
    if not np.isfinite(undulation).all():
        k = int(np.flatnonzero(~np.isfinite(undulation))[0])
        fault = f"position {k + 1}, {lonlat[k, 1]:.5f} {lonlat[k, 0]:.5f},"
        raise source.wrong("height", fault, f"must lie inside the geoid grid {meaning.heights}")
    return ellipsoidal - undulation


class Oriented:
    """Positions of a list, and attitudes if it has them, in the systems of the flight.

    Attributes
    ----------
    listed : Listed
    meaning : Meaning
    east_north, lonlat : ndarray, shape (n, 2), or None
        Metres; degrees. One is there at least.
    angles : tuple of str
        Omega, phi, kappa or roll, pitch, heading; none for points.
    radians : ndarray, shape (n, 3)
        Of these angles.
    north : str
        Against which north the attitudes are, ``grid`` or ``true``.
    """

    def __init__(self, listed: Listed, meaning: Meaning, angles: tuple[str, ...] = ()) -> None:
        self.listed, self.meaning, self.angles = listed, meaning, angles
        self.lonlat: Array | None = None
        if listed.has(*GEOGRAPHIC):
            self.lonlat = np.stack([listed.degrees(name) for name in ("lon", "lat")], axis=-1)
            wrong: Mask = np.abs(self.lonlat[:, 1]) > 90
            listed.refuse("lat", wrong, "must lie between -90 and 90 degrees")
        self.east_north: Array | None = None
        if listed.has(*GRID):
            self.east_north = np.stack([listed.numbers(name) for name in GRID], axis=-1)
        degrees = [listed.degrees(name, meaning.angle) for name in angles]
        self.radians: Array = np.radians(np.stack(degrees, axis=-1)) if angles else np.empty(0)
        self.north = meaning.north or ("grid" if angles == OPK else "true")

    def _grid(self, needed_by: str) -> GridSystem:
        return grid_system(self.listed.source, self.meaning, needed_by)

    def _reached(self, values: Array) -> Array:
        """Return transformed positions, refused where the CRS does not hold."""
        wrong: Mask = np.asarray(~np.isfinite(values).all(axis=1))
        self.listed.refuse("position", wrong, "must lie where the CRS holds")
        return values

    def geographic(self) -> Array:
        """Return longitude and latitude, deg, shape (n, 2), of east and north if it has both."""
        if self.lonlat is not None and (self.east_north is None or not self.meaning.crs):
            return self.lonlat
        grid = self._grid("east and north, and attitudes against true north")
        return self._reached(grid.lonlat_from_grid(np.asarray(self.east_north)))

    def in_grid(self) -> dict[str, Array]:
        """Return east, north and height, columns of a flight's tables."""
        east_north = self.east_north
        if east_north is None:
            grid = self._grid("latitude and longitude that become east and north")
            east_north = self._reached(grid.grid_from_lonlat(np.asarray(self.lonlat)))
        east, north = np.round(east_north, 5).T
        return {"east_m": east, "north_m": north, "height_m": self.heights()}

    def heights(self) -> Array:
        """Return the heights in the system of the flight, unscaled, m, shape (n,)."""
        height, meaning = self.listed.numbers("height"), self.meaning
        if meaning.ground_m is not None:
            scale = self._grid("heights with the scale of the map").scale(self.geographic())
            height = meaning.ground_m + (height - meaning.ground_m) / scale
        if meaning.ellipsoidal and meaning.heights != "ellipsoidal":
            height = in_flight(self.listed.source, meaning, self.geographic(), height)
        return np.round(height, 5)

    def trajectory(self) -> dict[str, Array]:
        """Return the columns of trajectory.csv but for the exposures.

        Omega, phi, kappa against the grid stay what they are; all else becomes latitude, longitude,
        roll, pitch and true heading.
        """
        rph = self.radians.copy()
        if self.angles == OPK:
            omega, phi, kappa = self.radians.T
            R_a_b = (
                frames.rotation_from_opk(self.radians)
                if self.meaning.order == "opk"
                else frames.turn(1, phi) @ frames.turn(0, omega) @ frames.turn(2, kappa)
            )
            if self.north == "grid":
                opk = np.round(np.degrees(frames.opk_from_rotation(R_a_b)), 9).T
                names = ("omega_deg", "phi_deg", "kappa_deg")
                return self.in_grid() | dict(zip(names, opk, strict=True)) | self.extras()
            rph = frames.rph_from_rotation(R_ENU_NED @ R_a_b @ R_FRD_FLU)
        elif self.north == "grid":
            grid = self._grid("a heading from grid north")
            rph[:, 2] += grid.convergence(self.geographic())
        lon, lat = np.round(self.geographic(), 11).T
        roll, pitch, heading = np.degrees(rph).T
        table = {
            "lat_deg": lat,
            "lon_deg": lon,
            "height_m": self.heights(),
            "roll_deg": np.round(roll, 9),
            "pitch_deg": np.round(pitch, 9),
            "heading_deg": np.round(heading % 360, 9),
        }
        return table | self.extras()

    def extras(self) -> dict[str, Array]:
        """Return times and standard deviations, where the list has them."""
        listed = self.listed
        table = {"time_s": listed.numbers("time")} if listed.has("time") else {}
        for name in (*SIGMA_POSITION, *SIGMA_ATTITUDE):
            word = name.rpartition("_")[0]
            if listed.has(word):
                table[name] = listed.numbers(word)
                if name in SIGMA_ATTITUDE:
                    table[name] = np.round(listed.scaled(word, self.meaning.angle), 9)
        return table

    def apart(self) -> float:
        """Return the largest distance of the grid positions from the geographic ones, m.

        Raises
        ------
        FlightError
            Where it is more than `AGREED_M` and the last digit.
        """
        grid = self._grid("positions in two forms")
        off = grid.grid_from_lonlat(np.asarray(self.lonlat)) - np.asarray(self.east_north)
        far = np.hypot(*off.T)
        k_lat = self.listed.at("lat")
        decimals = min(len(row.cells[k_lat].partition(".")[2]) for row in self.listed.rows)
        allowed = AGREED_M + METRES_A_DEGREE * 10.0**-decimals
        crs = self.meaning.crs
        expected = f"must be within {allowed:.4g} m of lat, lon in {crs}; is --crs right?"
        self.listed.refuse("east, north", ~(far <= allowed), expected)
        return float(far.max())


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
    system = "ellipsoidal"
    if heights != "ellipsoidal":
        named = (
            f"by {Path(heights).name}"
            if isinstance(heights, str)
            else f"by an undulation of {heights:g} m"
        )
        there = "ellipsoidal there, and {} in the flight" if meaning.ellipsoidal else "{}"
        system = there.format(named)
    ground = (
        ""
        if meaning.ground_m is None
        else f"; above {meaning.ground_m:g} m they carry the scale of the map, which is taken out"
    )
    return f"Heights are {system}{ground}."


# --- A text with a row for each image: its position and attitude, in declared columns


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
    forms = [form for form in (OPK, RPH) if listed.has(*form)]
    if len(forms) != 1 or not listed.is_located:
        expected = (
            "must have east north or lat lon, height, and omega phi kappa or roll pitch heading"
        )
        raise listed.undeclared(f"are {', '.join(c.name for c in listed.columns)}", expected)
    oriented = Oriented(listed, meaning, forms[0])
    name = next((column for column in ("image", "exposure") if listed.has(column)), "")
    names = listed.unique(name) if name else [str(k + 1) for k in range(len(listed.rows))]
    tables: dict[str, Any] = {
        f"{block}/trajectory.csv": {"exposure": names, **oriented.trajectory()}
    }
    if camera or listed.has("camera"):
        cameras = [camera] * len(names) if camera else listed.names("camera")
        images = {"image": names, "camera": cameras, "exposure": names}
        strips = {"strip": listed.names("strip")} if listed.has("strip") else {}
        tables[f"{block}/images.csv"] = images | strips
    return ImportedFlight(
        source=source,
        sha256=safe.checksums([listed.source]),
        settings=settings(meaning),
        tables=tables,
        pictures=grid_file(meaning),
        assumed=(
            f"{listed.said}; x counts east, y north{'' if name else '; exposures are numbered'}.",
            *text_said(listed),
            *_attitudes_said(oriented, of),
            heights_said(meaning),
        ),
        found=(*_found(oriented), *says),
        left_out=left_out(listed, "orientation"),
    )


def _attitudes_said(oriented: Oriented, of: str) -> tuple[str, str]:
    """Return sentences on the attitudes, and on the body whose they are."""
    listed, meaning = oriented.listed, oriented.meaning
    units = ", ".join(sorted({listed.unit(name, meaning.angle) for name in oriented.angles}))
    if oriented.angles == OPK:
        pok = "Ry(phi) Rx(omega) Rz(kappa)"
        order = "Rx(omega) Ry(phi) Rz(kappa)" if meaning.order == "opk" else pok
        attitude = (
            f"Omega, phi, kappa in {units}: R = {order} takes the axes of the {of} (x, y, up) to "
            f"east, north, up; kappa is against {oriented.north} north."
        )
    else:
        attitude = (
            f"Roll, pitch, heading in {units}: forward-right-down against north-east-down; the "
            f"heading is from {oriented.north} north."
        )
    if of == "imu":
        return attitude, (
            "Positions and attitudes are those of the IMU: no boresight, no lever arm is applied."
        )
    return attitude, (
        "Positions and attitudes are those of the camera, with another program's boresight and "
        "lever arm: the camera stands in the place of the IMU, and what is then estimated as "
        "boresight is a correction to that program's."
    )


def _found(oriented: Oriented) -> list[str]:
    degrees = np.degrees(oriented.radians)
    ranges = zip(oriented.angles, degrees.min(axis=0), degrees.max(axis=0), strict=True)
    said = [
        f"Positions and attitudes: {len(degrees)}.",
        "; ".join(f"{n} {low:.2f} to {high:.2f} deg" for n, low, high in ranges) + ".",
    ]
    crs = oriented.meaning.crs
    if oriented.east_north is not None and oriented.lonlat is not None and crs:
        said.append(
            f"East and north, and latitude and longitude in {crs}, differ by at most "
            f"{oriented.apart():.3f} m."
        )
    return said


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

SEQUENCES = {"XYZ": "opk", "YXZ": "pok"}
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
    names = {column.name for column in columns}
    camera = NEEDED[0] <= names
    preamble, unit, order = _stated(source, heading.number, listed.rows[0].number, camera)
    applied = camera or any(APPLIED.match(line.upper()) for line in preamble)
    if ORTHOMETRIC in names and meaning.heights == "ellipsoidal":
        expected = "needs --heights: a vertical CRS, a geoid grid file or a number"
        raise heading.wrong("ORTHOMETRIC HEIGHT", "is no ellipsoidal height", expected)
    meaning = replace(
        meaning,
        angle=unit,
        order=order or meaning.order,
        ellipsoidal=meaning.ellipsoidal or ORTHOMETRIC not in names,
        north=meaning.north if camera else "true",  # a heading of POSPac is from true north
    )
    plain = [replace(c, name="height") if c.name == ORTHOMETRIC else c for c in listed.columns]
    return _brought(
        replace(listed, columns=tuple(plain)),
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
                fault = f"{quoted(unknown[0])} is not known"
                raise line.wrong("heading", fault, "declare the columns by --columns")
            first = {name: k for k, name in reversed([*enumerate(names)])}
            once = (name if first[name] == k else SKIP for k, name in enumerate(names))
            return line, tuple(Column(name=name) for name in once)
    expected = (
        "must have a line with EASTING, NORTHING, … OMEGA, PHI, KAPPA or ROLL, PITCH, HEADING"
    )
    raise source.wrong("heading", "is not there", expected)


def _listed(source: Opened, heading: Line, columns: tuple[Column, ...]) -> Listed:
    """Return the rows after the heading; a first column ID that all rows lack is dropped."""
    after = (line for line in lines(source) if line.number > heading.number)
    rows = list(dropwhile(lambda line: line.cells[0].startswith("("), after))
    if not rows:
        raise source.wrong("file", "has a heading and no rows", "must have rows")
    text = source.text().split("\n")
    by_tabs = [cut(text[row.number - 1].rstrip(), "\t") for row in rows]
    if all(len(cells) == len(columns) for cells in by_tabs):
        rows = [replace(row, cells=cells) for row, cells in zip(rows, by_tabs, strict=True)]
    else:
        plain = (" ".join(row.cells).replace(",", " ").split() for row in rows)
        rows = [replace(row, cells=tuple(cells)) for row, cells in zip(rows, plain, strict=True)]
    n = len(columns)
    if columns[0].name == "image" and all(
        len(row) == n - 1 or (len(row) == n and not row.cells[0]) for row in rows
    ):
        rows = [replace(row, cells=row.cells[len(row) == n :]) for row in rows]
        columns = columns[1:]
    for row in rows:
        if len(row) != len(columns):
            expected = f"must have {len(columns)}, as the heading of line {heading.number}"
            raise row.wrong("row", f"has {len(row)} cells", expected)
    return Listed(source=source, columns=columns, rows=tuple(rows), heading=heading)


def _stated(
    source: Opened, heading: int, first_row: int, camera: bool
) -> tuple[list[str], str, str]:
    """Return the preamble, the unit of attitudes, and the order of omega and phi by it.

    The unit is that of the line in brackets, else degrees. The order is empty where none is stated.
    """
    preamble, unit, axes = [], "", ""
    for number, text in enumerate(source.text().split("\n")[: first_row - 1], start=1):
        upper = text.upper()
        if "POSITION IN" in upper and not unit:
            found = re.search(r"ORIENTATION(?: ANGLES)?(?: AND SD)? IN (DEG|GRAD|GON|RAD)", upper)
            if found is None or "POSITION IN M" not in upper:
                expected = "must be metres, and degrees, grads or radians"
                raise source.wrong("units", quoted(text.strip()), expected, line=number)
            unit = ANGLE[found[1]]
        if number < heading and re.search(r"\w", text):
            preamble.append(" ".join(text.split())[:200])
        if camera and number < heading and (turn := TURN.search(upper)):
            axes += turn[1]
            if not any(known.startswith(axes) for known in SEQUENCES):
                expected = "must be about x, y, z or y, x, z"
                raise source.wrong("rotations", quoted(text.strip()), expected, line=number)
    return preamble[:MOST_PREAMBLE], unit or "deg", SEQUENCES.get(axes, "")


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
    every = [
        read_list(safe.of_windows(safe.read(path)), columns, numbers=("col", "row"), known=MEASURED)
        for path in sources
    ]
    first_of: dict[tuple[str, str], Line] = {}
    for listed in every:
        listed.require("point", "image", "col", "row", says="point image col row")
        pairs = zip(listed.names("image"), listed.names("point"), strict=True)
        for row, (image, point) in zip(listed.rows, pairs, strict=True):
            before = first_of.setdefault((image, point), row)
            if before is not row:
                place = f"line {before.number}" + f" of {before.file}" * (before.file != row.file)
                fault = f"{quoted(point)} stands in image {quoted(image)} in {place} already"
                raise row.wrong("point", fault, "must stand once in an image")
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
            *dict.fromkeys(" ".join([f"{one.said}.", *text_said(one)]) for one in every),
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
    listed.require("point", says="point east north height")
    if not listed.is_located:
        expected = "must be point east north height, in any order"
        raise listed.undeclared("have no position", expected)
    located = Oriented(listed, meaning)
    table: dict[str, Any] = {"point": listed.unique("point"), **located.in_grid()}
    table |= located.extras()
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
            " ".join([f"{listed.said}.", *text_said(listed), "x counts east, y north."]),
            heights_said(meaning),
        ),
        found=(
            f"{number_of(len(listed.rows), 'points')}, {n_check} of them to check; heights "
            f"{table['height_m'].min():.3f} to {table['height_m'].max():.3f} m.",
        ),
        left_out=left_out(listed, "coordinate", SURVEYED),
    )


def _roles(listed: Listed, otherwise: str) -> list[str]:
    if not listed.has("role"):
        return [otherwise] * len(listed.rows)
    k = listed.at("role")
    cells = [(row, row.cell(k, "role")) for row in listed.rows]
    for row, cell in cells:
        if cell.lower() not in ROLES:
            raise row.wrong("role", quoted(cell), "must be control or check")
    return [ROLES[cell.lower()] or otherwise for _, cell in cells]
