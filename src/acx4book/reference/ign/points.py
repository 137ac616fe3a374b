"""Points intersected from seven UltraCam images, and the error of each forgotten step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from acx4book.reference.ign import files
from acx4book.reference.ign.readings import READINGS, Flight, Reading, complete, load
from acx4lib.calibration import estimates
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block, ImagePoints, Images, Trajectory
from acx4lib.geometry.collinearity import directions, image_residuals
from acx4lib.geometry.intersection import intersect
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import direct

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
            image_idx=files.indices(measurements.images, names),
            point_idx=files.indices(measurements.points, flight.points),
            colrow=measurements.colrow,
            sigma_px=np.full(len(measurements.points), POINTING_PX),
        ),
        trajectory=Trajectory(exposures=names, T_m_b=reading.T_m_c),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Intersected:
    """All points intersected under one reading.

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
    found = direct.intersect_rays(block, poses, selected)
    seen = direct.measured(block, poses, selected)
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
    """Return the size of a pixel on the ground, m."""
    above = flight.orientations.enh[:, 2].mean()
    return float(above * flight.camera.pixel_mm / flight.camera.interior.f)


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
