"""Lists of orientations in one of the two forms that a flight's trajectory has.

A text has declared columns or a heading that names them; that of Applanix has its own.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from acx4files.exchange import safe
from acx4files.exchange.flight_folder import ImportedFlight, number_of
from acx4files.exchange.options import Block, Camera, Columns, Crs, Ellipsoidal, Heights, Option
from acx4files.exchange.safe import Opened
from acx4files.exchange.trajectories.listed import (
    KNOWN,
    MEASURED,
    SURVEYED,
    Listed,
    read_list,
)
from acx4files.flight.problems import quoted
from acx4files.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4lib.expected import Array, Mask
from acx4lib.geometry import frames
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, GridSystem

NAMED = (("image",), ("exposure",))
"""Columns that name an exposure, the first that is there."""

OPK, RPH = ("omega", "phi", "kappa"), ("roll", "pitch", "heading")
GRID, LONLAT = ("east", "north"), ("lon", "lat")
METRES_A_DEGREE = 111_320.0


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """Conventions that a list does not state of its numbers.

    Attributes
    ----------
    crs : str
        Projected CRS of the flight; empty where positions and attitudes need none.
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
    order: str = "opk"
    north: str = ""
    heights: str | float = "ellipsoidal"
    ellipsoidal: bool = False
    ground_m: float | None = None

    def north_of(self, angles: Sequence[str]) -> str:
        """Return the north against which attitudes of these angles are, ``grid`` or ``true``."""
        return self.north or ("grid" if angles == OPK else "true")


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


def in_flight(source: Opened, meaning: Meaning, lonlath: Array) -> Array:
    """Return ellipsoidal heights in the height system of the flight, m, shape (n,).

    Parameters
    ----------
    source : Opened
        Which errors name.
    meaning : Meaning
    lonlath : ndarray, shape (n, 3)
        Longitude and latitude, degrees; ellipsoidal height, m.
    """
    if meaning.heights == "ellipsoidal":
        return lonlath[:, 2]
    grid = grid_system(source, meaning, "ellipsoidal heights")
    undulation = grid.undulation(lonlath[:, :2])
    outside = ~np.isfinite(undulation)
    if outside.any():
        lon, lat, _ = lonlath[np.argmax(outside)]
        fault = f"the position {lat:.5f} {lon:.5f}"
        raise source.wrong("height", fault, f"must lie inside the geoid grid {meaning.heights}")
    return lonlath[:, 2] - undulation


def _finite(listed: Listed, values: Array) -> Array:
    """Return transformed positions, refused where the CRS does not hold."""
    wrong: Mask = np.asarray(~np.isfinite(values).all(axis=1))
    listed.refuse("position", wrong, ["is none"] * len(wrong), "must lie where the CRS holds")
    return values


def _lonlat(listed: Listed, meaning: Meaning) -> Array:
    """Return longitude and latitude, deg, shape (n, 2), of east and north if it has both."""
    if listed.has(*LONLAT) and not (listed.has(*GRID) and meaning.crs):
        return listed.stack(*LONLAT)
    needed_by = "east and north, and attitudes against true north"
    grid = grid_system(listed.source, meaning, needed_by)
    return _finite(listed, grid.lonlat_from_grid(listed.stack(*GRID)))


def _in_grid(listed: Listed, meaning: Meaning) -> dict[str, Array]:
    """Return east, north and height, columns of a flight's tables."""
    if listed.has(*GRID):
        east_north = listed.stack(*GRID)
    else:
        needed_by = "latitude and longitude that become east and north"
        grid = grid_system(listed.source, meaning, needed_by)
        east_north = _finite(listed, grid.grid_from_lonlat(listed.stack(*LONLAT)))
    east, north = np.round(east_north, 5).T
    return {"east_m": east, "north_m": north, "height_m": _heights(listed, meaning)}


def _heights(listed: Listed, meaning: Meaning) -> Array:
    """Return the heights in the system of the flight, unscaled, m, shape (n,)."""
    height = listed.table.numbers["height"]
    if meaning.ground_m is not None:
        grid = grid_system(listed.source, meaning, "heights with the scale of the map")
        scale = grid.scale(_lonlat(listed, meaning))
        height = meaning.ground_m + (height - meaning.ground_m) / scale
    if meaning.ellipsoidal and meaning.heights != "ellipsoidal":
        lonlath = np.column_stack([_lonlat(listed, meaning), height])
        height = in_flight(listed.source, meaning, lonlath)
    return np.round(height, 5)


def _trajectory(listed: Listed, meaning: Meaning, angles: Sequence[str]) -> dict[str, Array]:
    """Return the columns of trajectory.csv but for the exposures.

    Omega, phi, kappa against the grid stay what they are; all else becomes latitude, longitude,
    roll, pitch and true heading.
    """
    radians = np.radians(listed.stack(*angles))
    if angles == OPK:
        omega, phi, kappa = radians.T
        R_a_b = (
            frames.rotation_from_opk(radians)
            if meaning.order == "opk"
            else frames.turn(1, phi) @ frames.turn(0, omega) @ frames.turn(2, kappa)
        )
        if meaning.north_of(angles) == "grid":
            opk = np.round(np.degrees(frames.opk_from_rotation(R_a_b)), 9).T
            named = dict(zip(("omega_deg", "phi_deg", "kappa_deg"), opk, strict=True))
            return _in_grid(listed, meaning) | named | _extras(listed)
        radians = frames.rph_from_rotation(R_ENU_NED @ R_a_b @ R_FRD_FLU)
    elif meaning.north_of(angles) == "grid":
        grid = grid_system(listed.source, meaning, "a heading from grid north")
        radians[:, 2] += grid.convergence(_lonlat(listed, meaning))
    lon, lat = np.round(_lonlat(listed, meaning), 11).T
    roll, pitch, heading = np.degrees(radians).T
    table = {
        "lat_deg": lat,
        "lon_deg": lon,
        "height_m": _heights(listed, meaning),
        "roll_deg": np.round(roll, 9),
        "pitch_deg": np.round(pitch, 9),
        "heading_deg": np.round(heading % 360, 9),
    }
    return table | _extras(listed)


def _extras(listed: Listed) -> dict[str, Array]:
    """Return times and standard deviations, where the list has them."""
    numbers = listed.table.numbers
    table = {"time_s": numbers["time"]} if "time" in numbers else {}
    for name in (*SIGMA_POSITION, *SIGMA_ATTITUDE):
        word = name.rpartition("_")[0]
        if word in numbers:
            digits = 9 if name in SIGMA_ATTITUDE else None
            table[name] = numbers[word] if digits is None else np.round(numbers[word], digits)
    return table


def _apart(listed: Listed, meaning: Meaning) -> float:
    """Return the largest distance of the grid positions from the geographic ones, m.

    Raises
    ------
    FlightError
        Where it is more than a metre and the last digit of the latitudes.
    """
    grid = grid_system(listed.source, meaning, "positions in two forms")
    far = np.hypot(*(grid.grid_from_lonlat(listed.stack(*LONLAT)) - listed.stack(*GRID)).T)
    decimals = min(len(cell.partition(".")[2]) for cell in listed.cells["lat"])
    allowed = 1.0 + METRES_A_DEGREE * 10.0**-decimals
    expected = f"must be within {allowed:.4g} m of lat, lon in {meaning.crs}; is --crs right?"
    found = [f"are {metres:.4g} m apart" for metres in far]
    listed.refuse("east, north", ~(far <= allowed), found, expected)
    return float(far.max())


def settings(meaning: Meaning) -> dict[str, Any]:
    """Return the keys of flight.toml on CRS and heights; a geoid grid is named as in the flight."""
    file = next(iter(grid_file(meaning)), "")
    return ({"crs": meaning.crs} if meaning.crs else {}) | {"heights": file or meaning.heights}


def grid_file(meaning: Meaning) -> dict[str, Path]:
    """Return the file of a geoid grid by its name in the flight; none where heights name none."""
    path = Path(str(meaning.heights))
    return {path.name: path} if path.is_file() else {}


def heights_said(meaning: Meaning) -> str:
    """Return the sentence on heights."""
    system = "ellipsoidal"
    if meaning.heights != "ellipsoidal":
        by = "by an undulation of {:g} m" if isinstance(meaning.heights, float | int) else "by {}"
        system = by.format(next(iter(grid_file(meaning)), meaning.heights))
        system = f"ellipsoidal there, and {system} in the flight" if meaning.ellipsoidal else system
    if meaning.ground_m is not None:
        ground = f"above {meaning.ground_m:g} m"
        system += f"; {ground} they carry the scale of the map, which is taken out"
    return f"Heights are {system}."


def part_of_flight(
    meaning: Meaning,
    block: str,
    trajectory: Mapping[str, Any],
    images: Mapping[str, Any],
    **others: Any,
) -> ImportedFlight:
    """Return a trajectory, and images if they have cameras, as a part of a flight.

    Parameters
    ----------
    meaning : Meaning
    block : str
    trajectory, images : mapping of str to sequence
        Columns of the tables; the images have no names but those of their exposures.
    others
        Other fields of `ImportedFlight`.
    """
    tables = {f"{block}/trajectory.csv": dict(trajectory)}
    if "camera" in images:
        names = {"image": trajectory["exposure"], "camera": [], "exposure": trajectory["exposure"]}
        tables[f"{block}/images.csv"] = names | dict(images)
    return ImportedFlight(
        settings=settings(meaning), tables=tables, pictures=grid_file(meaning), **others
    )


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
        listed, meaning, whose, says = _pospac(text, meaning)
        origin = f"POSPac {'exterior orientations' if listed.has(*OPK) else 'trajectory at events'}"
    else:
        listed, whose, says = read_list(text, columns, keys=NAMED), of, ()
        origin = "Table of orientations"
    forms = [form for form in (OPK, RPH) if listed.has(*form)]
    if len(forms) != 1 or not listed.is_located:
        expected = (
            "must have east north or lat lon, height, and omega phi kappa or roll pitch heading"
        )
        raise listed.undeclared(f"are {', '.join(c.name for c in listed.columns)}", expected)
    text_of, n = listed.table.text, len(listed.table)
    names = text_of.get("image") or text_of.get("exposure")
    images = {name: list(text_of[name]) for name in ("camera", "strip") if name in text_of}
    return part_of_flight(
        meaning,
        block,
        {
            "exposure": list(names or map(str, range(1, n + 1))),
            **_trajectory(listed, meaning, forms[0]),
        },
        images | ({"camera": [camera] * n} if camera else {}),
        source=origin,
        sha256=safe.checksums([text]),
        assumed=(
            f"{listed.said} {_axes_said(listed)}{'' if names else '; exposures are numbered'}.",
            *_attitudes_said(listed, meaning, forms[0], whose),
            heights_said(meaning),
        ),
        found=(*_found(listed, meaning, forms[0]), *says),
        left_out=listed.left_out("orientation"),
    )


def _axes_said(listed: Listed) -> str:
    datum = "; latitude and longitude are of the datum of the flight's CRS"
    return f"x counts east, y north{datum if listed.has(*LONLAT) else ''}"


def _attitudes_said(
    listed: Listed, meaning: Meaning, angles: Sequence[str], of: str
) -> tuple[str, str]:
    """Return sentences on the attitudes, and on the body whose they are."""
    units = ", ".join(sorted({c.unit for c in listed.columns if c.name in angles}))
    attitude = "Roll, pitch, heading in {}: forward-right-down against north-east-down; the heading"
    if angles == OPK:
        first = "Rx(omega) Ry(phi)" if meaning.order == "opk" else "Ry(phi) Rx(omega)"
        attitude = (
            f"Omega, phi, kappa in {{}}: R = {first} Rz(kappa) takes the axes of the {of} "
            "(x, y, up) to east, north, up; kappa"
        )
    verb = "is against" if angles == OPK else "is from"
    body = "Positions and attitudes are those of the IMU: no boresight, no lever arm is applied."
    if of == "camera":
        body = (
            "Positions and attitudes are those of the camera, with another program's boresight and "
            "lever arm: the camera stands in the place of the IMU, and what is then estimated as "
            "boresight is a correction to that program's."
        )
    return f"{attitude.format(units)} {verb} {meaning.north_of(angles)} north.", body


def _found(listed: Listed, meaning: Meaning, angles: Sequence[str]) -> list[str]:
    degrees = listed.stack(*angles)
    ranges = zip(angles, degrees.min(axis=0), degrees.max(axis=0), strict=True)
    said = [
        f"Positions and attitudes: {len(degrees)}.",
        "; ".join(f"{n} {low:.2f} to {high:.2f} deg" for n, low, high in ranges) + ".",
    ]
    if listed.has(*GRID, *LONLAT) and meaning.crs:
        said.append(
            f"East and north, and latitude and longitude in {meaning.crs}, differ by at most "
            f"{_apart(listed, meaning):.3f} m."
        )
    return said


# --- Text exports of Applanix's POSPac: exterior orientations, or the trajectory at events
#
# A preamble tells mapping frame, datum, boresight and lever arms; a heading the columns; a line in
# brackets, before the heading or after it, the units; rows follow. The heading has commas, tabs or
# spaces, the rows tabs or spaces. In exterior orientations the column ID may be empty.


POSPAC = "pospac"
"""The columns of such a text."""

PHRASES = {
    r"(ELLIPSOID(AL)?|ELL\.?|ORTHOMETRIC|ORTHO|MSL) (HEIGHT|HGT)": "HEIGHT",
    r"(EAST|NORTH|UP|DOWN)(ING)? VELOCITY|WANDER ANGLE": "VELOCITY",
    r"(EAST|NORTH|HEIGHT|ROLL|PITCH|HEADING)(ING)? SD": r"SIGMA_\1",
    r"(GPS )?TIME( ?\(S(EC)?\))?": "TIME",
    r"(IMAGE|PHOTO) (ID|NAME)": "IMAGE",
}
"""Phrases of a heading, and the words for them."""

UNREAD = ("velocity", "wander", "distance")
"""Columns that are no orientation."""

ANGLE = {"DEG": "deg", "GRAD": "gon", "GON": "gon", "RAD": "rad"}
TURN = re.compile(r"(?:FIRST|SECOND|THIRD) ROTATION IS ABOUT THE \W?([XYZ])\W")
"""How a preamble states the sequence of rotations, mapping to image."""

SEQUENCES = {"XYZ": "opk", "YXZ": "pok"}
"""Orders of `Meaning` by the axes that a preamble lists."""

APPLIED = re.compile(r"(?:BORESIGHT|LEVER ARM) VALUES.*[1-9]")
"""A line of the preamble with a boresight or lever arms that are not zero."""


def _pospac(source: Opened, meaning: Meaning) -> tuple[Listed, Meaning, str, tuple[str, ...]]:
    """Return a text export of POSPac as a list, what it means, whose it is, and what it states.

    The unit of angles, and the order of omega and phi, are those that the text states. Omega, phi,
    kappa are the camera's; roll, pitch and heading the IMU's, unless the preamble has a boresight
    or lever arms that are not zero.
    """
    text = source.text().split("\n")
    k_heading, names = _heading(source, text)
    rows = [re.sub(r"[,\t]", " ", line) for line in text[k_heading + 1 :]]
    widths = {len(row.split()) for row in rows if row.strip() and not row.lstrip().startswith("(")}
    if names[0] == "image" and widths == {len(names) - 1}:
        names = names[1:]
    unit, order = _stated(source, text, k_heading)
    plain = "\n".join([*[""] * k_heading, " ".join(names), *rows])
    plain_source = replace(source, data=plain.encode(), encoding="")
    listed = read_list(plain_source, "", keys=NAMED, angle=unit)
    preamble = [" ".join(line.split()) for line in text[:k_heading] if re.search(r"\w", line)]
    is_camera = listed.has(*OPK)
    is_applied = is_camera or any(APPLIED.match(line.upper()) for line in preamble)
    is_orthometric = re.search(r"\b(ORTHO|MSL)", text[k_heading].upper()) is not None
    if is_orthometric and meaning.heights == "ellipsoidal":
        fault = "is no ellipsoidal height"
        expected = "needs --heights: a vertical CRS, a geoid grid file or a number"
        raise source.wrong("ORTHOMETRIC HEIGHT", fault, expected, line=k_heading + 1)
    meaning = replace(
        meaning,
        order=order or meaning.order,
        ellipsoidal=meaning.ellipsoidal or not is_orthometric,
        north=meaning.north if is_camera else "true",  # a heading of POSPac is from true north
    )
    says = (f"The file states: {'; '.join(preamble)}.",) if preamble else ()
    return listed, meaning, "camera" if is_applied else "imu", says


def _heading(source: Opened, text: Sequence[str]) -> tuple[int, list[str]]:
    """Return the place of the heading, and the names of its columns, each once."""
    for k, line in enumerate(text):
        rest = " ".join(line.upper().split())
        for phrase, word in PHRASES.items():
            rest = re.sub(rf"\b{phrase}", word, rest)
        words = re.findall("[a-z_]+", rest.lower())
        names = [KNOWN.get(word, word) for word in words]
        if line.lstrip().startswith("(") or not any({*form} <= {*names} for form in (OPK, RPH)):
            continue
        if unknown := [word for word in words if word not in (*KNOWN, *UNREAD)]:
            fault = f"{quoted(unknown[0].upper())} is not known"
            raise source.wrong("heading", fault, "declare the columns by --columns", line=k + 1)
        return k, [n if names.index(n) == i else f"{n}_again" for i, n in enumerate(names)]
    expected = (
        "must have a line with EASTING, NORTHING, … OMEGA, PHI, KAPPA or ROLL, PITCH, HEADING"
    )
    raise source.wrong("heading", "is not there", expected)


def _stated(source: Opened, text: Sequence[str], k_heading: int) -> tuple[str, str]:
    """Return the unit of attitudes, degrees if none is stated, and the order of omega and phi."""
    unit, axes = "", ""
    for k, line in enumerate(text):
        upper = line.upper()
        if "POSITION IN" in upper and not unit:
            found = re.search(r"ORIENTATION(?: ANGLES)?(?: AND SD)? IN (DEG|GRAD|GON|RAD)", upper)
            if found is None or "POSITION IN M" not in upper:
                expected = "must be metres, and degrees, grads or radians"
                raise source.wrong("units", quoted(line.strip()), expected, line=k + 1)
            unit = ANGLE[found[1]]
        if k < k_heading and (turn := TURN.search(upper)):
            axes += turn[1]
            if not any(known.startswith(axes) for known in SEQUENCES):
                expected = "must be about x, y, z or y, x, z"
                raise source.wrong("rotations", quoted(line.strip()), expected, line=k + 1)
    return unit or "deg", SEQUENCES.get(axes, "")


# --- Texts with a row for each point: measured in an image, or surveyed; in declared columns


ROLES = {"control": "control", "gcp": "control", "check": "check", "chk": "check", "": ""}


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
        read_list(
            safe.of_windows(safe.read(path)), columns, known=MEASURED, keys=[("image", "point")]
        )
        for path in sources
    ]
    for listed in every:
        listed.require("point", "image", "col", "row", says="point image col row")
    images = [name for listed in every for name in listed.table.text["image"]]
    points = [name for listed in every for name in listed.table.text["point"]]
    colrow = np.concatenate([listed.stack("col", "row") for listed in every])
    colrow = np.round(colrow - float(first), 5)
    cols, rows = colrow.T.tolist()
    table: dict[str, Any] = {"image": images, "point": points, "col_px": cols, "row_px": rows}
    if all(listed.has("sigma") for listed in every):
        table["sigma_px"] = [px for one in every for px in one.table.numbers["sigma"].tolist()]
    names = [*dict.fromkeys(images)]
    tables: dict[str, Any] = {f"{block}/image_points.csv": table}
    if camera:
        by = {"image": names, "camera": [camera] * len(names), "exposure": names}
        tables[f"{block}/images.csv"] = by
    (left, top), (right, bottom) = colrow.min(axis=0), colrow.max(axis=0)
    return ImportedFlight(
        source="Table of image points",
        sha256=safe.checksums([listed.source for listed in every]),
        tables=tables,
        assumed=(
            *dict.fromkeys(one.said for one in every),
            "Columns count to the right and rows down, in pixels; the middle of the first pixel is "
            f"{first}, {first}.",
        ),
        found=(
            f"{number_of(len(images), 'measurements')} of {number_of(len(set(points)), 'points')} "
            f"in {number_of(len(names), 'images')}; columns {left:.1f} to {right:.1f}, rows "
            f"{top:.1f} to {bottom:.1f} px.",
        ),
        left_out=tuple(line for one in every for line in one.left_out("measurement", MEASURED)),
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
    listed = read_list(text, columns, known=SURVEYED, keys=[("point",)])
    listed.require("point", says="point east north height")
    if not listed.is_located:
        raise listed.undeclared("have no position", "must be point east north height, in any order")
    table: dict[str, Any] = {"point": list(listed.table.text["point"])}
    table |= _in_grid(listed, meaning) | _extras(listed)
    if listed.has("role"):
        cells = [cell.lower() for cell in listed.table.text["role"]]
        wrong = np.array([cell not in ROLES for cell in cells])
        found = [quoted(cell) for cell in listed.table.text["role"]]
        listed.refuse("role", wrong, found, "must be control or check")
        table["role"] = [ROLES[cell] or role or "" for cell in cells]
    elif role:
        table["role"] = [role] * len(listed.table)
    n_check = sum(use == "check" for use in table.get("role", ()))
    return ImportedFlight(
        source="Table of surveyed points",
        sha256=safe.checksums([text]),
        settings=settings(meaning),
        tables={"control_points.csv": table},
        pictures=grid_file(meaning),
        assumed=(
            f"{listed.said} {_axes_said(listed)}.",
            heights_said(meaning),
        ),
        found=(
            f"{number_of(len(listed.table), 'points')}, {n_check} of them to check; heights "
            f"{table['height_m'].min():.3f} to {table['height_m'].max():.3f} m.",
        ),
        left_out=listed.left_out("coordinate", SURVEYED),
    )
