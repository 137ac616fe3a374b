"""Where a reconstruction is on the Earth: in topocentric axes, or, after ODM, in those of UTM.

OpenSfM writes east, north, up at the place of reference_lla. ODM replaces its reconstruction.json
by one in UTM, from which an offset was taken, and leaves reference_lla and the measured positions
as they were. The files do not say which of the two they are; the measured positions do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opensfm.project import Project, Shots
from acx4lib.exchange.safe import text_lines
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.problems import Range
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem, MappingFrame

LAT, LON, HEIGHT = Range(-90.0, 90.0), Range(-360.0, 360.0), Range(-12_000.0, 100_000.0)

COORDS = "../odm_georeferencing/coords.txt"
"""Zone and offset of ODM."""

BETTER = 2.0
"""Measured positions must fit UTM so many times better before it is believed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Place:
    """Where the frame w of a project is.

    Attributes
    ----------
    frame : MappingFrame
        Of the flight, with its origin below that of the project.
    altitude : float
        Of the project's origin, m.
    utm : MappingFrame, optional
        The same in UTM, where w has the axes of UTM.
    offset : ndarray, shape (2,)
        East and north of the origin of w in UTM, m.
    said : tuple of str
        What was assumed.
    """

    frame: MappingFrame
    altitude: float
    utm: MappingFrame | None = None
    offset: Array
    said: tuple[str, ...]

    @property
    def settings(self) -> Mapping[str, Any]:
        """Keys of flight.toml."""
        return {"crs": self.frame.grid.crs, "heights": self.frame.grid.heights}

    def in_frame(self, T_w: Pose) -> Pose:
        """Return poses of the project in the mapping frame."""
        if self.utm is None:
            return Pose(R=T_w.R, r=T_w.r + np.array([0.0, 0.0, self.altitude]))
        return self.utm.pose_from_grid(T_w.r + np.append(self.offset, 0.0), T_w.opk)


def read(found: Project, root: Node, shots: Shots, crs: str | None) -> Place | None:
    """Return where a project is; None without measured positions: then it is nowhere.

    Raises
    ------
    FlightError
        For a CRS that cannot be used, or a place that is none.
    """
    node = root.maybe("reference_lla") or found.tree("reference_lla.json")
    if node is None or not np.isfinite(shots.gps).any():
        return None
    lon, lat, altitude = (
        node.one(key).number(allowed)
        for key, allowed in (("longitude", LON), ("latitude", LAT), ("altitude", HEIGHT))
    )
    zone, offset = _zone_and_offset(found, lon, lat)
    try:
        utm, own = (
            MappingFrame(
                grid=GridSystem(crs=one, heights="ellipsoidal"), origin=np.array([lon, lat])
            )
            for one in (zone, crs or zone)
        )
    except ValueError as error:
        raise FlightError([f"--crs:1: crs: {error}; must be projected and in metres"]) from None
    place = Place(
        frame=own,
        altitude=altitude,
        offset=offset,
        said=(f"positions are of WGS 84, in {own.grid.crs}; altitudes are taken as ellipsoidal",),
    )
    return _in_utm_if_better(place, utm, shots)


def _zone_and_offset(found: Project, lon: float, lat: float) -> tuple[str, Array]:
    """Return the UTM zone as an EPSG code, and the origin of a reconstruction by ODM in it."""
    source = found.maybe(COORDS)
    rows = [] if source is None else list(text_lines.lines(source))[:2]
    if len(rows) == 2 and rows[0].cells[:2] == ("WGS84", "UTM"):
        zone = rows[0].cell(2, "zone")
        return _code(int(zone[:-1]), zone[-1] != "S"), rows[1].numbers(0, 2, "offset")
    zone = _code(min(int((lon + 180) % 360 // 6) + 1, 60), lat >= 0)
    grid = GridSystem(crs=zone, heights="ellipsoidal")
    return zone, grid.grid_from_lonlat(np.array([[lon, lat]]))[0]


def _code(zone: int, north: bool) -> str:
    return f"EPSG:{(32600 if north else 32700) + zone}"


def _in_utm_if_better(place: Place, utm: MappingFrame, shots: Shots) -> Place:
    """Return the place in which the camera centres fit the measured positions."""
    known = np.isfinite(shots.gps).all(axis=1)
    centres, gps = shots.T_w_v.r[known, :2], shots.gps[known]
    grid = utm.to_grid(gps + np.array([0.0, 0.0, place.altitude]))[:, :2] - place.offset
    plain, in_utm = (_rms(centres - one) for one in (gps[:, :2], grid))
    size = _rms(gps[:, :2] - gps[:, :2].mean(axis=0))
    if known.sum() < 3 or BETTER * in_utm > plain or in_utm > size:
        return place
    said = (
        f"orientations and points have the axes of UTM, as ODM writes them: camera centres are "
        f"{in_utm:.2g} m rms from the measured positions so, {plain:.2g} m in topocentric axes"
    )
    return Place(
        frame=place.frame,
        altitude=place.altitude,
        utm=utm,
        offset=place.offset,
        said=(*place.said, said),
    )


def _rms(off: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
