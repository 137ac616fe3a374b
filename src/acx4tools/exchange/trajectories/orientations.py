"""A list of orientations in one of the two forms that a flight's trajectory has."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import Problem, lines_of, quoted
from acx4lib.flight.tables import SIGMA_ATTITUDE, SIGMA_POSITION
from acx4lib.geometry import frames
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, GridSystem
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories.listed import UNITS, Listed, position_of

OPK, RPH = ("omega", "phi", "kappa"), ("roll", "pitch", "heading")
GRID, GEOGRAPHIC = ("east", "north"), ("lat", "lon")
TURN_DEG = 360.0
METRES_A_DEGREE = 111_320.0
AGREED_M = 1.0
"""Within this, and the last digit, positions in two forms must agree."""


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """What a list does not say of its numbers.

    Attributes
    ----------
    crs : str
        Projected CRS of the flight; empty where positions and attitudes need none.
    angle : str
        Unit of attitudes whose columns do not say it, one of `columns.UNITS`.
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


def oriented(listed: Listed, meaning: Meaning) -> Oriented:
    """Return the numbers of a list.

    Raises
    ------
    FlightError
        Where a column is missing, both forms of an attitude are there, or a number is out of range.
    """
    forms = [form for form in (OPK, RPH) if listed.has(*form)]
    if len(forms) != 1 or not is_located(listed):
        names = [one.name for one in listed.columns]
        expected = (
            "must have east north or lat lon, height, and omega phi kappa or roll pitch heading; "
            "declare them by --columns"
        )
        raise _of_columns(listed, f"are {', '.join(names)}", expected)
    angles = np.radians(np.stack([_degrees(listed, n, meaning.angle) for n in forms[0]], axis=-1))
    found = located(listed)
    return replace(found, **{"opk" if forms[0] == OPK else "rph": angles})


def is_located(listed: Listed) -> bool:
    """Tell whether a list has the columns of a position in the grid, or of a geographic one."""
    return listed.has("height") and (listed.has(*GRID) or listed.has(*GEOGRAPHIC))


def located(listed: Listed) -> Oriented:
    """Return the positions of a list that has them, without attitudes.

    Raises
    ------
    FlightError
        Where a number is out of range.
    """
    lonlat = None
    if listed.has(*GEOGRAPHIC):
        lonlat = np.stack([_degrees(listed, name, "deg") for name in ("lon", "lat")], axis=-1)
        _refuse_far(listed, lonlat)
    east_north = None
    if listed.has(*GRID):
        east_north = np.stack([listed.numbers(name) for name in GRID], axis=-1)
    return Oriented(east_north=east_north, lonlat=lonlat, height=listed.numbers("height"))


def trajectory(listed: Listed, found: Oriented, meaning: Meaning) -> dict[str, Any]:
    """Return the columns of trajectory.csv but for the exposures.

    Omega, phi, kappa against the grid stay what they are; all else becomes latitude, longitude,
    roll, pitch and true heading.

    Raises
    ------
    FlightError
        Where the CRS is needed and not given, cannot be used, or does not reach the positions.
    """
    if found.opk is not None:
        R_a_b = _rotation(found.opk, meaning.order)
        if found.north(meaning) == "grid":
            table = _on_grid(listed, found, meaning, R_a_b)
        else:
            R_n_b = R_ENU_NED @ R_a_b @ R_FRD_FLU
            table = _geographic(listed, found, meaning, frames.rph_from_rotation(R_n_b))
    else:
        rph = np.zeros((0, 3)) if found.rph is None else found.rph.copy()
        if found.north(meaning) == "grid":
            grid = grid_system(listed.source, meaning, "a heading from grid north")
            rph[:, 2] += grid.convergence(lonlat_of(listed, found, meaning))
        table = _geographic(listed, found, meaning, rph)
    return table | extras(listed, meaning)


def grid_system(source: Opened, meaning: Meaning, needed_by: str) -> GridSystem:
    """Return the CRS and the heights of the flight.

    Raises
    ------
    FlightError
        Where the CRS is not given, or cannot be used.
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
        found = f"position {k + 1}, {lonlat[k, 1]:.5f} {lonlat[k, 0]:.5f},"
        raise source.wrong("height", found, f"must lie inside the geoid grid {meaning.heights}")
    return ellipsoidal - undulation


def lonlat_of(listed: Listed, found: Oriented, meaning: Meaning) -> Array:
    """Return longitude and latitude, deg, shape (n, 2), of east and north if it has both."""
    if found.lonlat is not None and (found.east_north is None or not meaning.crs):
        return found.lonlat
    grid = grid_system(listed.source, meaning, "east and north, and attitudes against true north")
    return _reached(listed, grid.lonlat_from_grid(np.asarray(found.east_north)))


def apart(listed: Listed, found: Oriented, meaning: Meaning) -> float:
    """Return the largest distance of the grid positions from the geographic ones, m.

    Raises
    ------
    FlightError
        Where it is more than the last digit of the geographic ones explains.
    """
    grid = grid_system(listed.source, meaning, "positions in two forms")
    off = grid.grid_from_lonlat(np.asarray(found.lonlat)) - np.asarray(found.east_north)
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


def _on_grid(listed: Listed, found: Oriented, meaning: Meaning, R_g_b: Array) -> dict[str, Any]:
    opk = np.degrees(frames.opk_from_rotation(R_g_b))
    attitude = dict(zip(("omega_deg", "phi_deg", "kappa_deg"), np.round(opk, 9).T, strict=True))
    return in_grid(listed, found, meaning) | attitude


def in_grid(listed: Listed, found: Oriented, meaning: Meaning) -> dict[str, Any]:
    """Return east, north and height in the systems of the flight, columns of its tables.

    Raises
    ------
    FlightError
        Where the CRS is needed and not given, cannot be used, or does not reach the positions.
    """
    east_north = found.east_north
    if east_north is None:
        grid = grid_system(
            listed.source, meaning, "latitude and longitude that become east and north"
        )
        east_north = _reached(listed, grid.grid_from_lonlat(np.asarray(found.lonlat)))
    east, north = np.round(east_north, 5).T
    return {"east_m": east, "north_m": north} | _height(listed, found, meaning)


def _geographic(listed: Listed, found: Oriented, meaning: Meaning, rph: Array) -> dict[str, Any]:
    lon, lat = np.round(lonlat_of(listed, found, meaning), 11).T
    angles = np.degrees(rph)
    angles[:, 2] %= TURN_DEG
    names = ("roll_deg", "pitch_deg", "heading_deg")
    attitude = dict(zip(names, np.round(angles, 9).T, strict=True))
    return {"lat_deg": lat, "lon_deg": lon} | _height(listed, found, meaning) | attitude


def _height(listed: Listed, found: Oriented, meaning: Meaning) -> dict[str, Array]:
    """Return the heights in the system of the flight, unscaled."""
    height = found.height
    if meaning.ground_m is not None:
        grid = grid_system(listed.source, meaning, "heights with the scale of the map")
        scale = grid.scale(lonlat_of(listed, found, meaning))
        height = meaning.ground_m + (height - meaning.ground_m) / scale
    if meaning.ellipsoidal and meaning.heights != "ellipsoidal":
        height = in_flight(listed.source, meaning, lonlat_of(listed, found, meaning), height)
    return {"height_m": np.round(height, 5)}


def extras(listed: Listed, meaning: Meaning) -> dict[str, Array]:
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
    at = position_of(listed.columns, name)
    problems = [
        Problem(
            file=file,
            line=rows[k].number,
            column=name,
            found=quoted(" ".join(rows[k].cells) if at is None else rows[k].cells[at]),
            expected=expected,
        )
        for k in np.flatnonzero(wrong).tolist()
    ]
    if problems:
        raise FlightError(lines_of(problems))


def _of_columns(listed: Listed, found: str, expected: str) -> FlightError:
    line = listed.heading.number if listed.heading else 1
    return listed.source.wrong("columns", found, expected, line=line)


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
