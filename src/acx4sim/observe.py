"""Exact image coordinates of points, their visibility, and the measured tie points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4sim.earth import Array, BoolArray, Grid, axes_of_enu_in_ecef, terrain_height
from acx4sim.fly import Track, poses_in_ecef
from acx4sim.optics import Camera, bent, project
from acx4sim.plan import BlockPlan, Plan, grid_from_field

_MARGIN_PX = 25.0  # nothing is measured nearer to the edge
_MEASURED = 0.9  # share of the images showing a tie point in which it is measured
_MIN_RAYS = 3
_BATCH = 1000
_MAX_BATCHES = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class Visibility:
    """Image coordinates of every point in every camera at every exposure.

    Attributes
    ----------
    colrow : ndarray, shape (n_cameras, n_exposures, n_points, 2)
        Exact pixel coordinates.
    seen : ndarray of bool, shape (n_cameras, n_exposures, n_points)
        Whether the point is on the sensor and the camera is above the point's horizon.
    """

    colrow: Array
    seen: BoolArray


def ground_points(plan: Plan, block: BlockPlan, places: Array) -> Array:
    """Compute east, north, height of positions given forward and left of a block's centre."""
    grid = Grid(crs=plan.crs)
    if len(places) == 0:
        return np.empty((0, 3))
    en = grid_from_field(block, places)
    llh = grid.geodetic_from_grid(np.column_stack([en, np.zeros(len(en))]))
    return np.column_stack([en, terrain_height(llh, plan.ground_m, relief=plan.relief)])


def _look(plan: Plan, cameras: Sequence[str], track: Track, x_g: Array) -> Visibility:
    """Project points into cameras at all exposures of a track."""
    grid = Grid(crs=plan.crs)
    llh = grid.geodetic_from_grid(x_g)
    x_e, up = grid.ecef_from_geodetic(llh), axes_of_enu_in_ecef(llh)[:, :, 2]
    shape = (len(cameras), len(track.exposure), len(x_g))
    colrow, seen = np.empty((*shape, 2)), np.empty(shape, dtype=np.bool_)
    for i, name in enumerate(cameras):
        camera = plan.cameras[name]
        r_e_c, R_e_c = poses_in_ecef(grid, track, camera.boresight_deg, np.array(camera.lever_m))
        ray = x_e - r_e_c[:, None]
        apparent_ray = bent(ray, up, x_g[:, 2]) if plan.refraction == "standard" else ray
        colrow[i] = project(camera, apparent_ray @ R_e_c)
        above = np.einsum("tpk,pk->tp", ray, up) < 0
        seen[i] = _inside(camera, colrow[i], _MARGIN_PX) & above
    return Visibility(colrow=colrow, seen=seen)


def _inside(camera: Camera, colrow: Array, margin_px: float) -> BoolArray:
    """Tell which pixel coordinates lie on the sensor, at least `margin_px` from its edge."""
    low = margin_px - 0.5
    high = np.array([camera.width_px, camera.height_px]) - 0.5 - margin_px
    on_sensor: BoolArray = np.all((colrow >= low) & (colrow <= high), axis=-1)
    return on_sensor


def measure(
    plan: Plan, block: BlockPlan, track: Track, surveyed_g: Array, rng: np.random.Generator
) -> Visibility:
    """Measure the surveyed points of a block, then its tie points, in its cameras.

    Where the block has a frame, every camera measures the points that it sees and that lie in the
    frame's image.
    """
    deciding = (block.frame,) if block.frame else block.cameras
    surveyed = _look(plan, deciding, track, surveyed_g)
    if block.tie_places is None:
        ties_g, ties = _strew_tie_points(plan, block, deciding, track, rng)
    else:
        ties_g, ties = _placed_tie_points(plan, block, block.tie_places, deciding, track)
    seen = np.concatenate([surveyed.seen, ties.seen], axis=2)
    if block.frame:
        sight = _look(plan, block.cameras, track, np.concatenate([surveyed_g, ties_g]))
        return replace(sight, seen=sight.seen & seen)
    return Visibility(colrow=np.concatenate([surveyed.colrow, ties.colrow], axis=2), seen=seen)


def _placed_tie_points(
    plan: Plan, block: BlockPlan, places: Array, cameras: Sequence[str], track: Track
) -> tuple[Array, Visibility]:
    """Measure tie points at given places in every image; drop those with fewer than three rays.

    Returns as `_strew_tie_points`.
    """
    x_g = ground_points(plan, block, places)
    sight = _look(plan, cameras, track, x_g)
    good = (sight.seen.sum(axis=1) >= _MIN_RAYS).any(axis=0)
    return x_g[good], Visibility(colrow=sight.colrow[:, :, good], seen=sight.seen[:, :, good])


def _strew_tie_points(
    plan: Plan,
    block: BlockPlan,
    cameras: Sequence[str],
    track: Track,
    rng: np.random.Generator,
) -> tuple[Array, Visibility]:
    """Spread tie points over the ground until every camera has enough with three rays."""
    grounds, sights = [], []
    missing = np.full(len(cameras), block.tie_points)
    for _ in range(_MAX_BATCHES):
        if not np.any(missing > 0):
            break
        places = np.array(block.tie_area_m) * rng.uniform(-1, 1, (_BATCH, 2))
        x_g = ground_points(plan, block, places)
        sight = _look(plan, cameras, track, x_g)
        sight.seen[rng.random(sight.seen.shape) >= _MEASURED] = False
        good = sight.seen.sum(axis=1) >= _MIN_RAYS
        enough = np.all(np.cumsum(good, axis=1) >= missing[:, None], axis=0)
        last = int(np.argmax(enough)) if enough.any() else _BATCH - 1
        keep = good.any(axis=0) & (np.arange(_BATCH) <= last)
        missing = missing - good[:, keep].sum(axis=1)
        grounds.append(x_g[keep])
        sights.append(Visibility(colrow=sight.colrow[:, :, keep], seen=sight.seen[:, :, keep]))
    else:
        msg = f"block {block.letter} does not see {block.tie_points} tie points in every camera"
        raise ValueError(msg)
    if not grounds:
        x_g = np.empty((0, 3))
        return x_g, _look(plan, cameras, track, x_g)
    return np.concatenate(grounds), Visibility(
        colrow=np.concatenate([sight.colrow for sight in sights], axis=2),
        seen=np.concatenate([sight.seen for sight in sights], axis=2),
    )
