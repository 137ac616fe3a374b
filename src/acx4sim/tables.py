"""Tables of a simulated flight, and gross errors in them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from acx4sim.earth import Array, Grid, opk_from_attitude, rph_from_attitude
from acx4sim.fly import Track, stream
from acx4sim.observe import Sight
from acx4sim.plan import BlockPlan, GrossErrors, Options, Plan, stated

# --- The tables of a simulated flight


# A millionth of a pixel, a micrometre, and an angle that moves the ground by less than that.
DECIMALS = {"px": 6, "m": 6, "deg": 10, "s": 3}
_LAT_LON_DECIMALS = 12


def _rounded(table: pd.DataFrame) -> pd.DataFrame:
    """Round every column according to the unit that its name ends with."""
    decimals = {
        name: DECIMALS[name.rsplit("_", 1)[-1]]
        for name in table.columns
        if name.rsplit("_", 1)[-1] in DECIMALS
    }
    decimals |= dict.fromkeys(decimals.keys() & {"lat_deg", "lon_deg"}, _LAT_LON_DECIMALS)
    return table.round(decimals)


def images(block: BlockPlan, track: Track) -> pd.DataFrame:
    """Tabulate the images of a block, exposure by exposure."""
    many = len(block.cameras) > 1
    return pd.DataFrame(
        [
            (f"{exposure}_{camera}" if many else exposure, camera, exposure, strip)
            for exposure, strip in zip(track.exposure, track.strip, strict=True)
            for camera in block.cameras
        ],
        columns=["image", "camera", "exposure", "strip"],
    )


def grid_attitude_deg(plan: Plan, track: Track) -> Array:
    """Compute omega, phi, kappa of the body relative to the grid, degrees."""
    grid = Grid(crs=plan.crs)
    gamma = grid.convergence(grid.geodetic_from_grid(track.x_g))
    return np.degrees(opk_from_attitude(track.R_enu_b, gamma))


def trajectory(plan: Plan, track: Track) -> pd.DataFrame:
    """Tabulate a trajectory in the form that the plan has."""
    if plan.angles == "grid":
        names = "east_m north_m height_m omega_deg phi_deg kappa_deg"
        values = np.column_stack([track.x_g, grid_attitude_deg(plan, track)])
    else:
        names = "lat_deg lon_deg height_m roll_deg pitch_deg heading_deg"
        llh = Grid(crs=plan.crs).geodetic_from_grid(track.x_g)
        rph = rph_from_attitude(track.R_enu_b)
        values = np.column_stack([np.degrees(llh[:, :2]), llh[:, 2], np.degrees(rph)])
    table = pd.DataFrame(values, columns=names.split())
    table.insert(0, "exposure", track.exposure)
    table["time_s"] = track.time_s
    return _rounded(table)


def control_points(
    sigma_m: Sequence[float],
    names: list[str],
    x_g: Array,
    options: Options,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Tabulate surveyed points: true coordinates plus noise."""
    sigma = np.array(sigma_m)
    survey = x_g + options.control_noise * sigma * rng.standard_normal(x_g.shape)
    table = pd.DataFrame(survey, columns=["east_m", "north_m", "height_m"])
    table.insert(0, "point", names)
    for name, value in zip(("east", "north", "height"), sigma, strict=True):
        table[f"sigma_{name}_m"] = value * stated(options.control_noise)
    return _rounded(table)


def image_points(
    image_names: pd.Series, points: pd.DataFrame, sight: Sight, rng: np.random.Generator
) -> pd.DataFrame:
    """Tabulate measurements, image by image.

    Parameters
    ----------
    image_names : Series
        Names of the images, exposure by exposure.
    points : DataFrame
        Columns point, noise_px and, if it must be written, sigma_px.
    sight : Sight
        Positions of the points in the images.
    rng : Generator
        Random numbers.
    """
    exposure_idx, camera_idx, point_idx = np.nonzero(sight.seen.transpose(1, 0, 2))
    exact = sight.colrow[camera_idx, exposure_idx, point_idx]
    point = points.iloc[point_idx].reset_index(drop=True)
    noise = point["noise_px"].to_numpy()[:, None] * rng.standard_normal(exact.shape)
    table = pd.DataFrame(exact + noise, columns=["col_px", "row_px"])
    table.insert(0, "image", image_names.to_numpy()[exposure_idx * len(sight.seen) + camera_idx])
    table.insert(1, "point", point["point"])
    if "sigma_px" in point:
        table["sigma_px"] = point["sigma_px"]
    return _rounded(table)


# --- Gross errors put into a simulated flight, to see whether they are found
#
# All other observations keep the values that they have without gross errors.


_COORDINATES = ("east_m", "north_m", "height_m")
_MIN_RAYS = 4  # images of the control point with the error: in fewer it may not be detectable


@dataclass(frozen=True, kw_only=True, eq=False)
class Spoiled:
    """Tables with gross errors, and a list of these errors.

    Attributes
    ----------
    tables : mapping of str to DataFrame
        All tables of the flight by path.
    mistakes : list of dict
        One for every gross error: `kind`, `image_or_exposure` and `point` as in rejected.csv,
        `block`, and the errors that were added, by column.
    """

    tables: Mapping[str, pd.DataFrame]
    mistakes: list[dict[str, Any]]


def spoil(
    plan: Plan,
    files: Mapping[str, pd.DataFrame],
    recorded: Mapping[str, Track],
    errors: GrossErrors,
    seed: int,
) -> Spoiled:
    """Put gross errors into one block of a flight and into its control points.

    Parameters
    ----------
    plan, seed : Plan, int
        Plan and seed of the flight.
    files : mapping of str to DataFrame
        The flight's tables by path, with their noise.
    recorded : mapping of str to Track
        Poses recorded by the GNSS/INS, by block.
    errors : GrossErrors
        Number and size of the errors.

    Raises
    ------
    ValueError
        Where the block is not simulated, or no control point is in four or more of its images.
    """
    block = errors.block
    if block not in recorded:
        msg = f"gross_errors: block {block!r} is not simulated; there are {list(recorded)}"
        raise ValueError(msg)
    rng = stream(seed, plan.draws, block, "gross errors")
    paths = [f"{block}/{name}.csv" for name in ("trajectory", "image_points")]
    control = f"{block}/control_points.csv"
    paths.append(control if control in files else "control_points.csv")
    track, in_track = _spoil_track(recorded[block], errors, rng)
    points, in_images = _spoil_images(plan, files, errors, rng)
    survey, in_survey = _spoil_control(files[paths[2]], files[paths[1]], errors, rng)
    spoiled = dict(zip(paths, (trajectory(plan, track), points, survey), strict=True))
    mistakes = [{**mistake, "block": block} for mistake in in_track + in_images + in_survey]
    return Spoiled(tables={**files, **spoiled}, mistakes=mistakes)


def _spoil_track(
    track: Track, errors: GrossErrors, rng: np.random.Generator
) -> tuple[Track, list[dict[str, Any]]]:
    """Shift one exposure, and turn another about its vertical axis."""
    shifted, turned = rng.choice(len(track.exposure), 2, replace=False)
    way = rng.standard_normal(3)
    x_g, turn_deg = track.x_g.copy(), np.zeros((len(track.exposure), 3))
    shift = errors.gnss_m * way / np.linalg.norm(way)
    x_g[shifted] += shift
    turn_deg[turned, 2] = errors.heading_deg * rng.choice([-1.0, 1.0])
    spoiled = replace(
        track, x_g=x_g, R_enu_b=track.R_enu_b * Rotation.from_rotvec(turn_deg, degrees=True)
    )
    return spoiled, [
        _mistake("gnss", track.exposure[shifted], "", _COORDINATES, shift),
        # The body's z axis points up; heading is clockwise.
        _mistake("attitude", track.exposure[turned], "", ("heading_deg",), -turn_deg[turned, 2:]),
    ]


def _spoil_images(
    plan: Plan, files: Mapping[str, pd.DataFrame], errors: GrossErrors, rng: np.random.Generator
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Move a share of the measurements in any direction, but not off the sensor."""
    table = files[f"{errors.block}/image_points.csv"].copy()
    rows = np.flatnonzero(rng.random(len(table)) < errors.image_points)
    least, greatest = np.log(errors.image_px)
    length = np.exp(rng.uniform(least, greatest, len(rows)))
    direction = rng.uniform(0, 2 * np.pi, len(rows))
    move = length[:, None] * np.column_stack([np.cos(direction), np.sin(direction)])
    names = ["col_px", "row_px"]
    before = table.loc[rows, names].to_numpy()
    cameras = files[f"{errors.block}/images.csv"].set_index("image")["camera"]
    sensors = [plan.cameras[name] for name in cameras[table.loc[rows, "image"]]]
    last = np.array([[sensor.width_px, sensor.height_px] for sensor in sensors]).reshape(-1, 2) - 1
    after = before + move
    move = np.where((after < 0) | (after > last), -move, move)
    table.loc[rows, names] = before + move
    mistakes = [
        _mistake("image_point", image, point, names, added)
        for image, point, added in zip(
            table.loc[rows, "image"], table.loc[rows, "point"], move, strict=True
        )
    ]
    return _rounded(table), mistakes


def _spoil_control(
    survey: pd.DataFrame, points: pd.DataFrame, errors: GrossErrors, rng: np.random.Generator
) -> tuple[pd.DataFrame, list[dict[str, Any]]]:
    """Add an error to one coordinate of one surveyed point."""
    rays = survey["point"].map(points["point"].value_counts()).fillna(0)
    candidates = np.flatnonzero(rays >= _MIN_RAYS)
    if not len(candidates):
        msg = f"gross_errors: no control point is in {_MIN_RAYS} images of {errors.block}"
        raise ValueError(msg)
    row, name = rng.choice(candidates), rng.choice(_COORDINATES)
    error = errors.control_m * rng.choice([-1.0, 1.0])
    table = survey.copy()
    table.loc[row, name] += error
    return _rounded(table), [
        _mistake("control_point", "", table.loc[row, "point"], (name,), np.array([error]))
    ]


def _mistake(
    kind: str, image_or_exposure: str, point: str, names: tuple[str, ...] | list[str], added: Array
) -> dict[str, Any]:
    values = {str(name): round(float(value), 6) for name, value in zip(names, added, strict=True)}
    return {"kind": kind, "image_or_exposure": image_or_exposure, "point": str(point), **values}
