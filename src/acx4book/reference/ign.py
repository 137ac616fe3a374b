"""A block of IGN's airborne camera, with surveyed points and the agency's orientation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyproj

from acx4book.reference import data
from acx4lib.block import Block, ImagePoints, Images, Trajectory
from acx4lib.calibration import estimates
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.collinearity import directions, image_residuals
from acx4lib.geometry.frames import Pose, rotation_from_opk, turn
from acx4lib.geometry.geodesy import GridSystem, MappingFrame, mean_origin
from acx4lib.geometry.intersection import intersect
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import direct

# --- IGN's Borea: orientations (OPK), image measurements (mes), ground points (app), cameras
#
# Borea counts columns and rows from the pixel that it calls (0, 0), rows downwards. It gives the
# principal point and the focal length in pixels. Its image heights may be altered, so that the map
# can be used as if it were Cartesian: Z' = z0 + k (Z - z0), with the ground height z0 below the
# image and the scale k of the map there. `unaltered` removes this.


@dataclass(frozen=True, kw_only=True, eq=False)
class Orientations:
    """Exterior orientations of an OPK file.

    Attributes
    ----------
    names : tuple of str
    enh : ndarray, shape (n, 3)
        Easting, northing and height of the perspective centres, m.
    opk : ndarray, shape (n, 3)
        Attitudes of the camera relative to the grid, radians.
    """

    names: tuple[str, ...]
    enh: Array
    opk: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurements:
    """Image points of a mes file.

    Attributes
    ----------
    points, images : tuple of str
        The point and the image of each measurement.
    colrow : ndarray, shape (n, 2)
        Pixels.
    """

    points: tuple[str, ...]
    images: tuple[str, ...]
    colrow: Array


def _rows(path: Path) -> list[list[str]]:
    lines = path.read_text(encoding="utf-8").replace('"', "").splitlines()
    return [line.split() for line in lines if line.strip()]


def _read_opk(path: Path) -> Orientations:
    """Read "NOM X Y Z O P K CAMERA" below a line of headings."""
    rows = _rows(path)[1:]
    values = np.array([row[1:7] for row in rows], dtype=float)
    return Orientations(
        names=tuple(row[0] for row in rows), enh=values[:, :3], opk=np.radians(values[:, 3:])
    )


def _read_measurements(path: Path) -> Measurements:
    """Read "point image column row"."""
    rows = _rows(path)
    return Measurements(
        points=tuple(row[0] for row in rows),
        images=tuple(row[1] for row in rows),
        colrow=np.array([row[2:4] for row in rows], dtype=float),
    )


def _read_points(path: Path) -> dict[str, Array]:
    """Read ground points, "point X Y Z" or "point type X Y Z": easting, northing, height in m."""
    return {row[0]: np.array(row[-3:], dtype=float) for row in _rows(path)}


def _read_camera(path: Path, *, pixel_mm: float) -> Camera:
    """Read a camera; the unit of the file is the pixel, so any pixel size can be given."""
    words = {row[0]: row[-1] for row in _rows(path)}  # rows are "name = value"
    width, height = int(words["width"]), int(words["height"])
    return Camera(
        name=words["Name"],
        width_px=width,
        height_px=height,
        pixel_mm=pixel_mm,
        interior=Interior(
            f=float(words["focal"]) * pixel_mm,
            xp=(float(words["PPAx"]) - (width - 1) / 2) * pixel_mm,
            yp=((height - 1) / 2 - float(words["PPAy"])) * pixel_mm,
        ),
    )


def _indices(names: tuple[str, ...], within: tuple[str, ...]) -> Index:
    """Return the indices of names among others."""
    where = {name: k for k, name in enumerate(within)}
    return np.array([where[name] for name in names], dtype=np.intp)


# --- Points intersected from seven UltraCam images, and the error of each forgotten step


POINTING_PX = 0.5
"""Standard deviation of a measurement of a surveyed point; IGN gives none."""


# --- intersections ---------------------------------------------------------------------------


def _block(flight: Flight, reading: Reading) -> Block:
    names, measurements = flight.orientations.names, flight.measurements
    return Block(
        name="validation",
        frame=flight.frame,
        cameras=(flight.camera,),
        images=Images(names=names),
        points=flight.points,
        image_points=ImagePoints(
            image_idx=_indices(measurements.images, names),
            point_idx=_indices(measurements.points, flight.points),
            colrow=measurements.colrow,
            sigma_px=np.full(len(measurements.points), POINTING_PX),
        ),
        trajectory=Trajectory(exposures=names, T_m_b=reading.T_m_c),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Intersected:
    """All points intersected under one interpretation.

    Attributes
    ----------
    rays : Rays
        Sorted by point; a group is a point.
    found : Intersections
    d : ndarray, shape (n_points, 3)
        East, north, height minus IGN's, m.
    sigma : ndarray, shape (n_points, 3)
        Standard deviations from the pointing only, m.
    misfit : ndarray, shape (n, 2)
        Residuals of IGN's coordinates, px.
    d_nearest : ndarray, shape (n_points, 3)
        As `d`, for the points with the smallest distances from their rays in space.
    """

    rays: direct.Rays
    found: direct.Intersections
    d: Array
    sigma: Array
    misfit: Array
    d_nearest: Array


def intersected(flight: Flight, reading: Reading) -> Intersected:
    """Intersect all points: least squares of the image residuals."""
    block = _block(flight, reading)
    points = block.image_points
    order: Index = np.argsort(points.point_idx, kind="stable")
    selected = direct.Rays(
        image_idx=points.image_idx[order],
        group=points.point_idx[order],
        colrow=points.colrow[order],
        sigma_px=points.sigma_px[order],
    )
    poses = direct.georeference(block, estimates.given([flight.camera]))
    intersections = direct.intersect_rays(block, poses, selected)
    measurement = direct.measured(block, poses, selected)
    nearest = intersect(
        measurement.T_m_c.r, directions(measurement), selected.group, selected.n_groups
    )
    published = reading.from_enh(flight.enh)[selected.group]
    R_g_m = flight.frame.grid_axes(flight.frame.from_grid(flight.enh))
    cov = R_g_m @ intersections.cov @ np.swapaxes(R_g_m, -1, -2)
    return Intersected(
        rays=selected,
        found=intersections,
        d=reading.to_enh(intersections.x_m) - flight.enh,
        sigma=np.sqrt(np.diagonal(cov, axis1=1, axis2=2)),
        misfit=image_residuals(measurement, published),
        d_nearest=reading.to_enh(nearest) - flight.enh,
    )


# --- tables ----------------------------------------------------------------------------------


def results() -> pd.DataFrame:
    """Return every intersected point with IGN's coordinates.

    Returns
    -------
    DataFrame
        point, kind (surveyed or tie point), rays, d_*_m (ours minus theirs), sigma_*_m;
        ground_pixels: the distance in space, in pixels on the ground; nearest_ground_pixels: the
        same for the point nearest to the rays in space.
    """
    flight = load()
    intersection = intersected(flight, _complete(flight))
    table = pd.DataFrame(
        {
            "point": flight.points,
            "kind": np.where(flight.is_surveyed, "surveyed", "tie point"),
            "rays": np.bincount(intersection.rays.group),
        }
    )
    for k, axis in enumerate(AXES):
        table[f"d_{axis}_m"] = intersection.d[:, k]
    for k, axis in enumerate(AXES):
        table[f"sigma_{axis}_m"] = intersection.sigma[:, k]
    pixel_m = _ground_pixel_m(flight)
    table["ground_pixels"] = np.linalg.norm(intersection.d, axis=1) / pixel_m
    table["nearest_ground_pixels"] = np.linalg.norm(intersection.d_nearest, axis=1) / pixel_m
    return table.round(6)


def _ground_pixel_m(flight: Flight) -> float:
    """Return the size of a pixel on the ground, m."""
    above = flight.orientations.enh[:, 2].mean()
    return float(above * flight.camera.pixel_mm / flight.camera.interior.f)


def forgotten_steps() -> pd.DataFrame:
    """Return the errors of the tie points if a step is left out, for each step.

    Returns
    -------
    DataFrame
        reading, RMS of the intersections' residuals (px), RMS of the residuals of IGN's
        coordinates (px), mean differences along east, north and height, and the standard
        deviation of the height (m).
    """
    flight = load()
    tie = ~flight.is_surveyed
    rows = []
    for name, read in READINGS.items():
        intersection = intersected(flight, read(flight))
        of_ties = tie[intersection.rays.group]
        d = intersection.d[tie]
        rows.append(
            {
                "reading": name,
                "residual_px": _rms(intersection.found.v[of_ties]),
                "misfit_px": _rms(intersection.misfit[of_ties]),
                **{f"mean_{axis}_m": d[:, k].mean() for k, axis in enumerate(AXES)},
                "std_height_m": d[:, 2].std(ddof=1),
            }
        )
    return pd.DataFrame(rows)


def _rms(v: Array) -> float:
    return float(np.sqrt(np.mean(v**2)))


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the surveyed points one by one, and mean and standard deviation of the tie points.

    Parameters
    ----------
    table : DataFrame
        As `results` returns it.

    Returns
    -------
    DataFrame
        point, rays, differences (m), their predicted sigma (m) and the distance in pixels on
        the ground; NaN where not known.
    """
    tie = table[table["kind"] == "tie point"]
    names = [f"d_{axis}_m" for axis in AXES]
    shown = ["point", "rays", *names, *(f"sigma_{axis}_m" for axis in AXES), "ground_pixels"]
    rows = [table.loc[table["kind"] == "surveyed", shown]]
    for label, values in (("mean", tie[names].mean()), ("standard deviation", tie[names].std())):
        point = f"{len(tie)} tie points, {label}"
        rows.append(pd.DataFrame([{"point": point, "rays": float(tie["rays"].mean()), **values}]))
    return pd.concat(rows, ignore_index=True)


# --- Seven UltraCam images of the Camargue, and ways to interpret their orientations


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

    surveyed = _read_points(file("control_points.app"))
    located = _read_points(file("tie_points_world.mes"))
    parts = [_read_measurements(file(f"{name}_points.mes")) for name in ("control", "tie")]
    return Flight(
        camera=_read_camera(file("camera.txt"), pixel_mm=PIXEL_MM),
        orientations=_read_opk(file("images.OPK")),
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
    # altered is Z' = z0 + k (Z - z0)
    return np.asarray(ground + (flight.orientations.enh[:, 2] - ground) / scale)


def _map_scale(flight: Flight) -> Array:
    """Return the scale of the map at every image."""
    factors = pyproj.Proj(pyproj.CRS(CRS)).get_factors(*flight.lonlat.T)
    return np.asarray(factors.meridional_scale, dtype=float)


def _complete(flight: Flight) -> Reading:
    """Return the correct interpretation of the data."""
    return _topocentric(flight, flight.altitudes, true_altitudes(flight, SCALE))


def _topocentric(flight: Flight, heights: GridSystem, height: Array) -> Reading:
    """Return the interpretation with the images' heights in a given height system."""
    frame = flight.frame
    mapping = MappingFrame(grid=heights, origin=frame.origin)
    enh = np.column_stack([flight.orientations.enh[:, :2], height])
    T_m_c = mapping.pose_from_grid(enh, flight.orientations.opk)
    return Reading(T_m_c=T_m_c, to_enh=frame.to_grid, from_enh=frame.from_grid)


def _scale_at_images(flight: Flight) -> Reading:
    return _topocentric(flight, flight.altitudes, true_altitudes(flight, _map_scale(flight)))


def _altered(flight: Flight) -> Reading:
    return _topocentric(flight, flight.altitudes, flight.orientations.enh[:, 2])


def _without_geoid(flight: Flight) -> Reading:
    return _topocentric(flight, flight.grid, true_altitudes(flight, SCALE))


def _without_convergence(flight: Flight) -> Reading:
    """Return the interpretation with kappa relative to true north."""
    reading = _complete(flight)
    R_g_t = turn(2, flight.grid.convergence(flight.lonlat))
    R_m_g = np.swapaxes(flight.frame.grid_axes(reading.T_m_c.r), -1, -2)
    R_m_c = R_m_g @ R_g_t @ rotation_from_opk(flight.orientations.opk)
    return replace(reading, T_m_c=Pose(R=R_m_c, r=reading.T_m_c.r))


def _one_vertical(flight: Flight) -> Reading:
    """Return the interpretation with angles relative to the axes in the middle of the images."""
    reading = _complete(flight)
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
    "complete": _complete,
    "map scale at every image instead of 1.000283": _scale_at_images,
    "linear alteration left in": _altered,
    "geoid forgotten": _without_geoid,
    "convergence forgotten": _without_convergence,
    "one vertical for all images": _one_vertical,
    "map as Cartesian, altered heights": _map_with_altered_heights,
    "map as Cartesian, true heights": _map_with_true_heights,
}
"""Interpretations by the step that is done or left out."""
