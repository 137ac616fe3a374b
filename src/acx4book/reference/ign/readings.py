"""Seven UltraCam images of the Camargue, and ways to interpret their orientations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyproj

from acx4book.reference import data
from acx4book.reference.ign import files
from acx4book.reference.ign.files import Measurements, Orientations
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, rotation_from_opk, turn
from acx4lib.geometry.geodesy import GridSystem, MappingFrame, mean_origin

CRS = "EPSG:2154"
PIXEL_MM = 0.004

SCALE = 1.000283
"""Scale of the map here, given by the data set."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """The data set without any interpretation.

    Attributes
    ----------
    camera : Camera
    orientations : Orientations
        Heights are altitudes above the geoid, linearly altered.
    measurements : Measurements
        Measurements of tie points and surveyed points.
    points : tuple of str
    is_surveyed : ndarray, shape (n_points,)
    enh : ndarray, shape (n_points, 3)
        IGN's coordinates of the points; heights are ellipsoidal.
    grid, altitudes : GridSystem
        The map with ellipsoidal heights, and with altitudes above the geoid.
    """

    camera: Camera
    orientations: Orientations
    measurements: Measurements
    points: tuple[str, ...]
    is_surveyed: np.ndarray
    enh: Array
    grid: GridSystem
    altitudes: GridSystem

    @property
    def lonlat(self) -> Array:
        """Longitude and latitude of the images, degrees, shape (n_images, 2)."""
        return self.grid.lonlat_from_grid(self.orientations.enh[:, :2])

    @property
    def frame(self) -> MappingFrame:
        """The mapping frame in the middle of the images, with ellipsoidal heights."""
        return mean_origin(self.grid, self.lonlat)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """One way to interpret the data set.

    Attributes
    ----------
    T_m_c : Pose
        Camera poses.
    to_enh, from_enh : callable
        Conversions between the Cartesian frame of the poses and the map with ellipsoidal heights.
    """

    T_m_c: Pose
    to_enh: Callable[[Array], Array]
    from_enh: Callable[[Array], Array]


def load() -> Flight:
    """Read the data set."""

    def file(name: str) -> Path:
        return data.path(f"ign-uce-m3/{name}")

    surveyed = files.read_points(file("control_points.app"))
    located = files.read_points(file("tie_points_world.mes"))
    parts = [files.read_measurements(file(f"{name}_points.mes")) for name in ("control", "tie")]
    return Flight(
        camera=files.read_camera(file("camera.txt"), pixel_mm=PIXEL_MM),
        orientations=files.read_opk(file("images.OPK")),
        measurements=Measurements(
            points=parts[0].points + parts[1].points,
            images=parts[0].images + parts[1].images,
            colrow=np.concatenate([part.colrow for part in parts]),
        ),
        points=(*surveyed, *located),
        is_surveyed=np.arange(len(surveyed) + len(located)) < len(surveyed),
        enh=np.array([*surveyed.values(), *located.values()]),
        grid=GridSystem(crs=CRS),
        altitudes=GridSystem(crs=CRS, heights=str(file("fr_ign_RAF20.tif"))),
    )


# --- readings --------------------------------------------------------------------------------


def true_altitudes(flight: Flight, scale: Array | float) -> Array:
    """Return the images' altitudes above the geoid without the linear alteration, m.

    The ground below is assumed at the mean altitude of the points.
    """
    lonlat = flight.grid.lonlat_from_grid(flight.enh[:, :2])
    ground = float(np.mean(flight.enh[:, 2] - flight.altitudes.undulation(lonlat)))
    return files.unaltered(flight.orientations.enh[:, 2], ground=ground, scale=scale)


def map_scale(flight: Flight) -> Array:
    """Return the scale of the map at every image."""
    factors = pyproj.Proj(pyproj.CRS(CRS)).get_factors(*flight.lonlat.T)
    return np.asarray(factors.meridional_scale, dtype=float)


def complete(flight: Flight) -> Reading:
    """Return the correct reading of the data."""
    return _topocentric(flight, flight.altitudes, true_altitudes(flight, SCALE))


def _topocentric(flight: Flight, heights: GridSystem, height: Array) -> Reading:
    """Return the reading with the images' heights in a given height system."""
    frame = flight.frame
    seen = MappingFrame(grid=heights, origin=frame.origin)
    enh = np.column_stack([flight.orientations.enh[:, :2], height])
    T_m_c = seen.pose_from_grid(enh, flight.orientations.opk)
    return Reading(T_m_c=T_m_c, to_enh=frame.to_grid, from_enh=frame.from_grid)


def _scale_at_images(flight: Flight) -> Reading:
    return _topocentric(flight, flight.altitudes, true_altitudes(flight, map_scale(flight)))


def _altered(flight: Flight) -> Reading:
    return _topocentric(flight, flight.altitudes, flight.orientations.enh[:, 2])


def _without_geoid(flight: Flight) -> Reading:
    return _topocentric(flight, flight.grid, true_altitudes(flight, SCALE))


def _without_convergence(flight: Flight) -> Reading:
    """Return the reading with kappa relative to true north."""
    reading = complete(flight)
    R_g_t = turn(2, flight.grid.convergence(flight.lonlat))
    R_m_g = np.swapaxes(flight.frame.grid_axes(reading.T_m_c.r), -1, -2)
    R_m_c = R_m_g @ R_g_t @ rotation_from_opk(flight.orientations.opk)
    return replace(reading, T_m_c=Pose(R=R_m_c, r=reading.T_m_c.r))


def _one_vertical(flight: Flight) -> Reading:
    """Return the reading with angles relative to the axes in the middle of the images."""
    reading = complete(flight)
    R_g_m = flight.frame.grid_axes(np.zeros((1, 3)))[0]
    R_m_c = R_g_m.T @ rotation_from_opk(flight.orientations.opk)
    return replace(reading, T_m_c=Pose(R=R_m_c, r=reading.T_m_c.r))


def _map_as_cartesian(flight: Flight, height: Array) -> Reading:
    east_north = flight.orientations.enh[:, :2]
    origin = np.append(east_north.mean(axis=0).round(-3), 0.0)
    enh = np.column_stack([east_north, height + flight.altitudes.undulation(flight.lonlat)])
    return Reading(
        T_m_c=Pose(R=rotation_from_opk(flight.orientations.opk), r=enh - origin),
        to_enh=lambda x: x + origin,
        from_enh=lambda x: x - origin,
    )


def _map_with_altered_heights(flight: Flight) -> Reading:
    return _map_as_cartesian(flight, flight.orientations.enh[:, 2])


def _map_with_true_heights(flight: Flight) -> Reading:
    return _map_as_cartesian(flight, true_altitudes(flight, SCALE))


READINGS: dict[str, Callable[[Flight], Reading]] = {
    "complete": complete,
    "map scale at every image instead of 1.000283": _scale_at_images,
    "linear alteration left in": _altered,
    "geoid forgotten": _without_geoid,
    "convergence forgotten": _without_convergence,
    "one vertical for all images": _one_vertical,
    "map as Cartesian, altered heights": _map_with_altered_heights,
    "map as Cartesian, true heights": _map_with_true_heights,
}
"""Readings by the step that is done or left out."""
