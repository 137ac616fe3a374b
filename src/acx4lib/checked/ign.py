"""Seven UltraCam images over the Camargue: from the map's numbers to ground points and back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyproj

from acx4lib import calibration, reference
from acx4lib._typing import Array, Index
from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.camera import Camera
from acx4lib.collinearity import image_residuals
from acx4lib.formats import borea
from acx4lib.formats.borea import Measurements, Orientations
from acx4lib.frames import Pose, rotation_from_opk, turn
from acx4lib.geodesy import GridSystem, MappingFrame, mean_origin
from acx4lib.georeferencing import (
    Intersections,
    Rays,
    directions,
    georeference,
    intersect_rays,
    measured,
)
from acx4lib.intersection import intersect

CRS = "EPSG:2154"
PIXEL_MM = 0.004

SCALE = 1.000283
"""Scale of the map here, as the data set states it."""

POINTING_PX = 0.5
"""Standard deviation of a measurement of a surveyed point; IGN gives none."""

AXES = ("east", "north", "height")


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """The data set as it is.

    Attributes
    ----------
    camera : Camera
    orientations : Orientations
        Heights are altitudes above the geoid, linearly altered.
    measurements : Measurements
        Of tie points and surveyed points.
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
    """One way to read the data set.

    Attributes
    ----------
    T_m_c : Pose
        Camera poses.
    to_enh, from_enh : callable
        Between the Cartesian frame of the poses and the map with ellipsoidal heights.
    """

    T_m_c: Pose
    to_enh: Callable[[Array], Array]
    from_enh: Callable[[Array], Array]


def load() -> Flight:
    """Read the data set."""

    def file(name: str) -> Path:
        return reference.path(f"ign-uce-m3/{name}")

    surveyed = borea.read_points(file("control_points.app"))
    located = borea.read_points(file("tie_points_world.mes"))
    parts = [borea.read_measurements(file(f"{name}_points.mes")) for name in ("control", "tie")]
    return Flight(
        camera=borea.read_camera(file("camera.txt"), pixel_mm=PIXEL_MM),
        orientations=borea.read_opk(file("images.OPK")),
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

    The ground below is taken at the mean altitude of the points.
    """
    lonlat = flight.grid.lonlat_from_grid(flight.enh[:, :2])
    ground = float(np.mean(flight.enh[:, 2] - flight.altitudes.undulation(lonlat)))
    return borea.unaltered(flight.orientations.enh[:, 2], ground=ground, scale=scale)


def map_scale(flight: Flight) -> Array:
    """Return the scale of the map at every image."""
    factors = pyproj.Proj(pyproj.CRS(CRS)).get_factors(*flight.lonlat.T)
    return np.asarray(factors.meridional_scale, dtype=float)


def complete(flight: Flight) -> Reading:
    """Read the data as they are meant."""
    return _topocentric(flight, flight.altitudes, true_altitudes(flight, SCALE))


def _topocentric(flight: Flight, heights: GridSystem, height: Array) -> Reading:
    """Place images by the height system that their heights are said to be in."""
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
    """Take kappa against true north."""
    reading = complete(flight)
    R_g_t = turn(2, flight.grid.convergence(flight.lonlat))
    R_m_g = np.swapaxes(flight.frame.grid_axes(reading.T_m_c.r), -1, -2)
    R_m_c = R_m_g @ R_g_t @ rotation_from_opk(flight.orientations.opk)
    return replace(reading, T_m_c=Pose(R=R_m_c, r=reading.T_m_c.r))


def _one_vertical(flight: Flight) -> Reading:
    """Take the angles against the axes in the middle of the images."""
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
"""What is done, or left out, and the poses that follow."""


# --- intersections ---------------------------------------------------------------------------


def _block(flight: Flight, reading: Reading) -> Block:
    n = len(flight.orientations.names)
    measurements = flight.measurements
    unknown = np.full((n, 3), np.inf)
    nobody = SurveyedPoints(
        point_idx=np.zeros(0, dtype=np.intp),
        x_m=np.zeros((0, 3)),
        R_g_m=np.zeros((0, 3, 3)),
        sigma_m=np.zeros((0, 3)),
    )
    return Block(
        name="validation",
        frame=flight.frame,
        cameras=(flight.camera,),
        images=Images(
            names=flight.orientations.names,
            camera_idx=np.zeros(n, dtype=np.intp),
            exposure_idx=np.arange(n),
            strips=("",) * n,
        ),
        points=flight.points,
        image_points=ImagePoints(
            image_idx=borea.indices(measurements.images, flight.orientations.names),
            point_idx=borea.indices(measurements.points, flight.points),
            colrow=measurements.colrow,
            sigma_px=np.full(len(measurements.points), POINTING_PX),
        ),
        control=nobody,
        check=nobody,
        trajectory=Trajectory(
            exposures=flight.orientations.names,
            T_m_b=reading.T_m_c,
            R_g_m=flight.frame.grid_axes(reading.T_m_c.r),
            sigma_position=unknown,
            sigma_attitude=unknown,
        ),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Intersected:
    """All points intersected under one reading.

    Attributes
    ----------
    rays : Rays
        Sorted by point; group = point.
    found : Intersections
    d : ndarray, shape (n_points, 3)
        East, north, height less IGN's, m.
    sigma : ndarray, shape (n_points, 3)
        From the pointing alone, m.
    misfit : ndarray, shape (n, 2)
        Residuals of IGN's coordinates, px.
    d_nearest : ndarray, shape (n_points, 3)
        As `d`, of the points nearest to their rays in space.
    """

    rays: Rays
    found: Intersections
    d: Array
    sigma: Array
    misfit: Array
    d_nearest: Array


def intersected(flight: Flight, reading: Reading) -> Intersected:
    """Intersect all points: least squares of the image residuals."""
    block = _block(flight, reading)
    points = block.image_points
    order: Index = np.argsort(points.point_idx, kind="stable")
    selected = Rays(
        image_idx=points.image_idx[order],
        group=points.point_idx[order],
        colrow=points.colrow[order],
        sigma_px=points.sigma_px[order],
    )
    poses = georeference(block, calibration.given([flight.camera]))
    found = intersect_rays(block, poses, selected)
    seen = measured(block, poses, selected)
    nearest = intersect(seen.T_m_c.r, directions(seen), selected.group, selected.n_groups)
    given = reading.from_enh(flight.enh)[selected.group]
    R_g_m = flight.frame.grid_axes(flight.frame.from_grid(flight.enh))
    cov = R_g_m @ found.cov @ np.swapaxes(R_g_m, -1, -2)
    return Intersected(
        rays=selected,
        found=found,
        d=reading.to_enh(found.x_m) - flight.enh,
        sigma=np.sqrt(np.diagonal(cov, axis1=1, axis2=2)),
        misfit=image_residuals(seen, given),
        d_nearest=reading.to_enh(nearest) - flight.enh,
    )


def ground_pixel_m(flight: Flight) -> float:
    """Return the size of a pixel on the ground."""
    above = flight.orientations.enh[:, 2].mean()
    return float(above * flight.camera.pixel_mm / flight.camera.interior.f)


# --- tables ----------------------------------------------------------------------------------


def results() -> pd.DataFrame:
    """Return every intersected point beside IGN's coordinates.

    Returns
    -------
    DataFrame
        point, kind (surveyed or tie point), rays, d_*_m (ours less theirs), sigma_*_m,
        ground_pixels: the distance in space in pixels on the ground; nearest_ground_pixels: the
        same of the point nearest to the rays in space.
    """
    flight = load()
    got = intersected(flight, complete(flight))
    table = pd.DataFrame(
        {
            "point": flight.points,
            "kind": np.where(flight.is_surveyed, "surveyed", "tie point"),
            "rays": np.bincount(got.rays.group),
        }
    )
    for k, axis in enumerate(AXES):
        table[f"d_{axis}_m"] = got.d[:, k]
    for k, axis in enumerate(AXES):
        table[f"sigma_{axis}_m"] = got.sigma[:, k]
    pixel_m = ground_pixel_m(flight)
    table["ground_pixels"] = np.linalg.norm(got.d, axis=1) / pixel_m
    table["nearest_ground_pixels"] = np.linalg.norm(got.d_nearest, axis=1) / pixel_m
    return table.round(6)


def residuals() -> pd.DataFrame:
    """Return the residuals of all measurements: image, point, col, row, v_col, v_row (px)."""
    flight = load()
    got = intersected(flight, complete(flight))
    names = flight.orientations.names
    return pd.DataFrame(
        {
            "image": [names[image] for image in got.rays.image_idx],
            "point": [flight.points[point] for point in got.rays.group],
            "kind": np.where(flight.is_surveyed[got.rays.group], "surveyed", "tie point"),
            "col": got.rays.colrow[:, 0],
            "row": got.rays.colrow[:, 1],
            "v_col": got.found.v[:, 0],
            "v_row": got.found.v[:, 1],
        }
    )


def forgotten_steps() -> pd.DataFrame:
    """Return what each step costs where it is left out, on the tie points.

    Returns
    -------
    DataFrame
        reading, rms of the intersections' residuals (px), rms of the residuals that IGN's
        coordinates have (px), mean differences along east, north and height, and the standard
        deviation of the height (m).
    """
    flight = load()
    tie = ~flight.is_surveyed
    rows = []
    for name, read in READINGS.items():
        got = intersected(flight, read(flight))
        own = tie[got.rays.group]
        d = got.d[tie]
        rows.append(
            {
                "reading": name,
                "residual_px": _rms(got.found.v[own]),
                "misfit_px": _rms(got.misfit[own]),
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
        the ground; empty where there is none.
    """
    tie = table[table["kind"] == "tie point"]
    names = [f"d_{axis}_m" for axis in AXES]
    shown = ["point", "rays", *names, *(f"sigma_{axis}_m" for axis in AXES), "ground_pixels"]
    rows = [table.loc[table["kind"] == "surveyed", shown]]
    for label, values in (("mean", tie[names].mean()), ("standard deviation", tie[names].std())):
        point = f"{len(tie)} tie points, {label}"
        rows.append(pd.DataFrame([{"point": point, "rays": float(tie["rays"].mean()), **values}]))
    return pd.concat(rows, ignore_index=True)
