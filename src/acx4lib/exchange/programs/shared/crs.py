"""The coordinate system of the flight, from what a project says of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyproj
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info
from pyproj.exceptions import CRSError, ProjError

from acx4lib.expected import Array
from acx4lib.geometry.crs.text import crs_fault
from acx4lib.geometry.geodesy import GridSystem


@dataclass(frozen=True, kw_only=True)
class Chosen:
    """A flight's coordinate system.

    Attributes
    ----------
    crs, heights : str
        Keys of flight.toml.
    assumed : tuple of str
    source : CRS, optional
        What the project's own coordinates are in.
    """

    crs: str
    heights: str
    assumed: tuple[str, ...]
    source: pyproj.CRS | None = None

    @property
    def settings(self) -> dict[str, str]:
        """Keys of flight.toml."""
        return {"crs": self.crs, "heights": self.heights}

    def grid(self) -> GridSystem:
        """Return both for computations; a ValueError where the geoid's grid is not here."""
        return GridSystem(crs=self.crs, heights=self.heights)

    def from_source(self, xyh: Array) -> Array:
        """Return coordinates of the project as east, north, height of the flight, shape (n, 3).

        Raises
        ------
        ValueError
            Where PROJ cannot do it exactly.
        """
        horizontal = None if self.source is None else _horizontal(self.source)
        if horizontal is None or horizontal == _horizontal(pyproj.CRS(self.crs)):
            return np.asarray(xyh, dtype=float)
        try:
            there = pyproj.Transformer.from_crs(
                horizontal, pyproj.CRS(self.crs), always_xy=True, allow_ballpark=False
            )
        except ProjError:
            msg = f"PROJ knows no exact way from {horizontal.name!r} to {self.crs}"
            raise ValueError(msg) from None
        east, north = there.transform(xyh[:, 0], xyh[:, 1])
        return np.column_stack([east, north, xyh[:, 2]])


def chosen(text: str, lonlat: Array | None, wanted: str | None) -> Chosen | None:
    """Return the flight's coordinate system.

    Parameters
    ----------
    text : str
        A project's own, as a code or WKT; empty if it has none.
    lonlat : ndarray, shape (2,), optional
        A place, by which a UTM zone is chosen where the project's own is geographic.
    wanted : str, optional
        What the user asks for.

    Raises
    ------
    ValueError
        Where one of them cannot be used; the message says why.
    """
    source = _parsed(text) if text else None
    if wanted is not None:
        _ = GridSystem(crs=wanted)
        return Chosen(crs=wanted, heights=_heights(source), assumed=(), source=source)
    if source is None or not (source.is_projected or source.is_geographic):
        return None
    horizontal = _horizontal(source)
    if horizontal.is_projected:
        crs = _code(horizontal) or horizontal.to_wkt()
        said = f"Coordinates are in {horizontal.name} ({_code(horizontal) or 'no EPSG code'})"
    elif lonlat is not None:
        crs = _utm(horizontal, lonlat)
        said = (
            f"Coordinates are longitudes and latitudes of {horizontal.name}; the flight is in "
            f"{crs}, the UTM zone"
        )
    else:
        return None
    _ = GridSystem(crs=crs)
    assumed = (said, _said_heights(source))
    return Chosen(crs=crs, heights=_heights(source), assumed=assumed, source=source)


def _parsed(text: str) -> pyproj.CRS:
    if fault := crs_fault(text):
        msg = f"coordinate system {fault}"
        raise ValueError(msg)
    try:
        return pyproj.CRS.from_user_input(text)
    except CRSError:
        msg = "coordinate system is none that PROJ knows"
        raise ValueError(msg) from None


def _horizontal(crs: pyproj.CRS) -> pyproj.CRS:
    crs = crs.sub_crs_list[0] if crs.is_compound else crs
    crs = crs.source_crs if crs.is_bound and crs.source_crs else crs
    return crs.to_2d()


def _code(crs: pyproj.CRS) -> str:
    found = crs.to_authority(min_confidence=70)
    return ":".join(found) if found else ""


def _heights(source: pyproj.CRS | None) -> str:
    """Return the key `heights` of flight.toml."""
    if source is None or not source.is_compound:
        return "ellipsoidal"
    vertical = source.sub_crs_list[1]
    return _code(vertical) or vertical.to_wkt()


def _said_heights(source: pyproj.CRS) -> str:
    if source.is_compound:
        return f"Heights are in {source.sub_crs_list[1].name}"
    return "Heights are above the ellipsoid: the coordinate system has no vertical part"


def _utm(crs: pyproj.CRS, lonlat: Array) -> str:
    lon, lat = map(float, lonlat)
    around = AreaOfInterest(lon, lat, lon, lat)
    found = query_utm_crs_info(datum_name=crs.name, area_of_interest=around, contains=True)
    if not found:
        msg = f"{crs.name!r} has no UTM zone that PROJ knows here; give a projected one by --crs"
        raise ValueError(msg)
    return f"{found[0].auth_name}:{found[0].code}"
