"""The tables of a simulated flight."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from acx4sim.earth import Array, Grid, opk_from_attitude, rph_from_attitude
from acx4sim.fly import Track
from acx4sim.observe import Sight
from acx4sim.plan import BlockPlan, Options, Plan, stated

# A millionth of a pixel, a micrometre, and an angle that moves the ground by less than that.
DECIMALS = {"px": 6, "m": 6, "deg": 10, "s": 3}
_LAT_LON_DECIMALS = 12


def rounded(table: pd.DataFrame) -> pd.DataFrame:
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
    return rounded(table)


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
    return rounded(table)


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
    return rounded(table)
