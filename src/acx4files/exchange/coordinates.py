"""Axes of other programs' cameras, and the coordinate system that a project gives its flight.

Their cameras have x right, y down, z ahead; the library's are turned about x.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pyproj
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info
from pyproj.exceptions import CRSError, ProjError

from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, turn
from acx4lib.geometry.geodesy import LOCAL, GridSystem, crs_fault, grid_system

FLIP = np.diag([1.0, -1.0, -1.0])
"""Between the library's camera axes and those with y down, z ahead."""

TOP_AHEAD = turn(2, -np.pi / 2)
"""R_b_c of a camera that looks down with the top of its images ahead: yaw, pitch, roll are zero."""

AHEAD = Pose(R=np.eye(3), r=np.zeros(3))
"""Mounting of a camera whose own axes are the body's."""

UNKNOWN = Pose(R=np.full((3, 3), np.nan), r=np.full(3, np.nan))
"""Pose of an image that is not oriented."""


def turned(R_cv: Array) -> Array:
    """Return rotations between axes with y down, z ahead as those between the library's."""
    return FLIP @ R_cv @ FLIP


def is_rotation(R: Array, off: float = 1e-4) -> bool:
    """Tell whether a matrix, shape (3, 3), of any numbers turns, and does not mirror."""
    if not (np.abs(R) < 2).all():
        return False
    return bool(np.abs(R @ R.T - np.eye(3)).max() <= off and np.linalg.det(R) > 0)


def nearest_rotation(R: Array) -> Array:
    """Return the rotation that is nearest to a matrix printed with few digits, shape (3, 3)."""
    u, _, v = np.linalg.svd(R)
    return u @ v


def stacked(poses: list[Pose]) -> Pose:
    """Return single poses as one of shape (n,)."""
    return Pose(
        R=np.array([pose.R for pose in poses]).reshape(-1, 3, 3),
        r=np.array([pose.r for pose in poses]).reshape(-1, 3),
    )


# --- The coordinate system of the flight, from what a project says of its own


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """A flight's coordinate system.

    Attributes
    ----------
    crs : str
    heights : str or float
        Keys of flight.toml.
    assumed : tuple of str
    source : CRS, optional
        What the project's own coordinates are in; None where they are local, and then those of
        the flight's CRS.
    """

    crs: str
    heights: str | float
    assumed: tuple[str, ...]
    source: pyproj.CRS | None = None

    @property
    def settings(self) -> dict[str, str | float]:
        """Keys of flight.toml."""
        return {"crs": self.crs, "heights": self.heights}

    def grid(self) -> GridSystem:
        """Return both for computations; a ValueError where the geoid's grid is not here."""
        return grid_of(self.crs, self.heights)

    def from_source(self, xyh: Array) -> Array:
        """Return coordinates of the project as east, north of the flight; heights stay, (n, 3).

        Raises
        ------
        ValueError
            Where PROJ cannot do it exactly.
        """
        horizontal = None if self.source is None else _horizontal(self.source)
        if self.crs == LOCAL or horizontal is None or horizontal == _horizontal(parsed(self.crs)):
            return np.asarray(xyh, dtype=float)
        try:
            transformer = _between(horizontal, self.crs)
        except ProjError:
            msg = f"PROJ knows no exact way from {horizontal.name!r} to {self.crs}"
            raise ValueError(msg) from None
        east, north = transformer.transform(xyh[:, 0], xyh[:, 1])
        return np.column_stack([east, north, xyh[:, 2]])


@cache
def grid_of(crs: str, heights: str | float = "ellipsoidal") -> GridSystem:
    """Return a CRS and heights for computations; a ValueError where they cannot be used."""
    return grid_system(crs, heights)


@cache
def _between(source: pyproj.CRS, crs: str) -> pyproj.Transformer:
    return pyproj.Transformer.from_crs(
        source, pyproj.CRS(crs), always_xy=True, allow_ballpark=False
    )


def chosen(text: str, lonlat: Array | None, wanted: str | None) -> Chosen | None:
    """Return the flight's coordinate system.

    Parameters
    ----------
    text : str
        A project's own, as a code or WKT; empty if it has none.
    lonlat : ndarray, shape (2,), optional
        A place, by which a UTM zone is chosen where the project's own is geographic.
    wanted : str, optional
        What the user asks for; `geodesy.LOCAL` is on no map.

    Raises
    ------
    ValueError
        Where one of them cannot be used; the message says why.
    """
    source = parsed(text) if text else None
    if source is not None and not (source.is_projected or source.is_geographic):
        source = None
    if wanted == LOCAL:
        return _on_no_map(source)
    if wanted is not None:
        _ = grid_of(wanted)
        local = f"The project's coordinates are local: they are taken for those of {wanted}"
        remarks = (local,) if text and source is None else ()
        return Chosen(crs=wanted, heights=heights_of(source), assumed=remarks, source=source)
    if source is None:
        return None
    horizontal = _horizontal(source)
    if horizontal.is_projected:
        crs = _code(horizontal) or horizontal.to_wkt()
        sentence = f"Coordinates are in {horizontal.name} ({_code(horizontal) or 'no EPSG code'})"
    elif lonlat is not None:
        crs = _utm(horizontal, lonlat)
        sentence = (
            f"Coordinates are longitudes and latitudes of {horizontal.name}; the flight is in "
            f"{crs}, the UTM zone"
        )
    else:
        return None
    _ = grid_of(crs)
    assumed = (sentence, _said_heights(source))
    return Chosen(crs=crs, heights=heights_of(source), assumed=assumed, source=source)


def _on_no_map(source: pyproj.CRS | None) -> Chosen:
    """Return a local system for coordinates taken as they are; ValueError for those of a map."""
    if source is not None:
        msg = f"the project's coordinates are those of {source.name!r}: they are on a map"
        raise ValueError(msg)
    sentence = "Coordinates are the project's own, x, y, z with z up: they lie on no map"
    return Chosen(crs=LOCAL, heights="ellipsoidal", assumed=(sentence,))


@cache
def parsed(text: str) -> pyproj.CRS:
    """Return the CRS of a code or WKT; a ValueError says why it is none."""
    if fault := crs_fault(text):
        raise ValueError(f"coordinate system {fault}")
    try:
        return pyproj.CRS.from_user_input(text)
    except CRSError:
        raise ValueError("coordinate system is none that PROJ knows") from None


@cache
def _horizontal(crs: pyproj.CRS) -> pyproj.CRS:
    crs = crs.sub_crs_list[0] if crs.is_compound else crs
    crs = crs.source_crs if crs.is_bound and crs.source_crs else crs
    return crs.to_2d()


def is_north_first(crs: pyproj.CRS) -> bool:
    """Tell whether a CRS counts north, or latitude, before east."""
    return _horizontal(crs).axis_info[0].direction.lower() == "north"


def _code(crs: pyproj.CRS) -> str:
    authority = crs.to_authority(min_confidence=70)
    return ":".join(authority) if authority else ""


def heights_of(source: pyproj.CRS | None) -> str:
    """Return the key `heights` of flight.toml for coordinates of a CRS."""
    if source is None or not source.is_compound:
        return "ellipsoidal"
    vertical = source.sub_crs_list[1]
    return _code(vertical) or vertical.to_wkt()


def _said_heights(source: pyproj.CRS) -> str:
    if source.is_compound:
        return f"Heights are in {source.sub_crs_list[1].name}"
    return "Heights are above the ellipsoid: the coordinate system has no vertical part"


def into(system: Chosen, xyh: Array) -> Array:
    """Return coordinates of a project as east, north, height of the flight, shape (n, 3).

    Raises
    ------
    ValueError
        Where PROJ cannot do it exactly, or a geoid's grid is not here.
    """
    return with_heights(system, system.from_source(xyh), heights_of(system.source))


def with_heights(system: Chosen, enh: Array, given: str | float) -> Array:
    """Return east, north, height with heights as the flight has them.

    Parameters
    ----------
    system : Chosen
    enh : ndarray, shape (n, 3)
        East, north of the flight.
    given : str or float
        What the heights are, as the key `heights` says it.

    Raises
    ------
    ValueError
        Where a geoid's grid is not here.
    """
    if given == system.heights:
        return enh
    into, out_of = system.grid(), grid_of(system.crs, given)
    lonlat = into.lonlat_from_grid(enh[:, :2])
    more = out_of.undulation(lonlat) - into.undulation(lonlat)
    if not np.isfinite(more).all():
        raise ValueError(f"a place lies outside the geoid of {given!r} or {system.heights!r}")
    return np.column_stack([enh[:, :2], enh[:, 2] + more])


def _utm(crs: pyproj.CRS, lonlat: Array) -> str:
    lon, lat = map(float, lonlat)
    around = AreaOfInterest(lon, lat, lon, lat)
    zones = query_utm_crs_info(datum_name=crs.name, area_of_interest=around, contains=True)
    if not zones:
        msg = f"{crs.name!r} has no UTM zone that PROJ knows here; give a projected one by --crs"
        raise ValueError(msg)
    return f"{zones[0].auth_name}:{zones[0].code}"
