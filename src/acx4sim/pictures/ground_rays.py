"""Exact projection from the pixels of a camera to the ground and back.

A ray is followed through lens, mounting, attitude and, if the flight has refraction, the air, to
the point where it meets the hills.
"""

from dataclasses import dataclass, replace

import numpy as np

from acx4sim.earth import Array, Grid, axes_of_enu_in_ecef, terrain_height
from acx4sim.fly import Track, fly, poses_in_ecef, stream
from acx4sim.observe import ground_points
from acx4sim.optics.air import bent
from acx4sim.optics.lens import Camera, correction, project
from acx4sim.plan import BlockPlan, Plan

_MAX_STEPS = 40
_GAP_M = 1e-7
_AIR_STEPS = 3  # each adds four correct digits


@dataclass(frozen=True, kw_only=True, eq=False)
class Station:
    """The true pose of the aircraft at one exposure, and the ground under it.

    Attributes
    ----------
    plan : Plan
        The flight.
    block : str
        Name of its block.
    track : Track
        The true body frame at this one exposure.
    marks_g : ndarray, shape (n, 3)
        True east, north, height of the block's surveyed points, m; they lie on the ground.
    latitude : float
        Latitude for `earth.terrain_height`, rad, with which these points lie on the ground.
    """

    plan: Plan
    block: str
    track: Track
    marks_g: Array
    latitude: float

    @property
    def exposure(self) -> str:
        """Name of the exposure."""
        return self.track.exposure[0]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that expose here."""
        return self.plan.blocks[self.block].cameras


def station(plan: Plan, exposure: str, *, seed: int = 1) -> Station:
    """Return the station of a flight's exposure, without simulating the flight.

    Parameters
    ----------
    plan : Plan
        The flight, for instance `acx4_plan()`.
    exposure : str
        Name of the exposure, for instance ``H3-04``, or with its block, ``heads/H3-04``.
    seed : int
        Seed of the flight.

    Raises
    ------
    ValueError
        Where the plan has no such exposure; the message names some that it has.
    """
    some = []
    for name, block in plan.blocks.items():
        track = fly(plan, block, stream(seed, plan.draws, name, "fly"))
        own = exposure.removeprefix(f"{name}/")
        if own in track.exposure:
            return _station(plan, name, track, track.exposure.index(own))
        some += [track.exposure[0], track.exposure[-1]]
    msg = f"exposure {exposure!r} is not in {plan.name}; it has, for instance, {', '.join(some)}"
    raise ValueError(msg)


def _station(plan: Plan, name: str, track: Track, i: int) -> Station:
    marks_g = _marks(plan, plan.blocks[name])
    at = Track(
        exposure=track.exposure[i : i + 1],
        strip=track.strip[i : i + 1],
        time_s=track.time_s[i : i + 1],
        x_g=track.x_g[i : i + 1],
        R_enu_b=track.R_enu_b[i : i + 1],
    )
    llh = Grid(crs=plan.crs).geodetic_from_grid(marks_g)
    return Station(
        plan=plan, block=name, track=at, marks_g=marks_g, latitude=float(llh[:, 0].mean())
    )


def _marks(plan: Plan, block: BlockPlan) -> Array:
    return ground_points(plan, block, block.targets if len(block.targets) else plan.control)


def reduced(camera: Camera, k: int) -> Camera:
    """Return the camera of an image at 1/k of the size, which covers the middle of the sensor.

    Raises
    ------
    ValueError
        Where k is not positive, or no pixel is left.
    """
    if k < 1 or min(camera.width_px, camera.height_px) < k:
        msg = f"an image cannot be reduced {k} times; it takes a whole number from 1 on"
        raise ValueError(msg)
    return replace(
        camera,
        width_px=camera.width_px // k,
        height_px=camera.height_px // k,
        pixel_um=camera.pixel_um * k,
    )


def ground_from_pixels(at: Station, camera: Camera, colrow: Array) -> Array:
    """Find the ground points that pixels see.

    Parameters
    ----------
    at : Station
        The exposure.
    camera : Camera
        Any camera on the IMU, with its lens, boresight and lever arm.
    colrow : ndarray, shape (n, 2)
        Pixels; they may lie outside the sensor.

    Returns
    -------
    x_g : ndarray, shape (n, 3)
        East, north and ellipsoidal height of the true ground, m, with errors below 1e-6; NaN
        where a ray does not reach the ground.
    """
    grid = Grid(crs=at.plan.crs)
    r_e_c, R_e_c = poses_in_ecef(grid, at.track, camera.boresight_deg, np.array(camera.lever_m))
    seen = _rays(camera, colrow) @ R_e_c[0].T
    straight = seen
    llh = _meet(at, grid, r_e_c[0], straight)
    for _ in range(_AIR_STEPS if at.plan.refraction == "standard" else 0):
        ray = grid.ecef_from_geodetic(llh) - r_e_c[0]
        turned = _unit(bent(ray, axes_of_enu_in_ecef(llh)[:, :, 2], llh[:, 2])) - _unit(ray)
        straight = _unit(seen - turned)
        llh = _meet(at, grid, r_e_c[0], straight)
    return grid.grid_from_geodetic(llh)


def _rays(camera: Camera, colrow: Array) -> Array:
    """Return unit vectors in the camera frame, from the left sides of eqs (1) and (2)."""
    pixel = camera.pixel_um / 1000
    x = (colrow[:, 0] - (camera.width_px - 1) / 2) * pixel - camera.xp_mm
    y = ((camera.height_px - 1) / 2 - colrow[:, 1]) * pixel - camera.yp_mm
    xy = np.column_stack([x, y])
    ideal = xy - correction(camera, xy)[0]
    return _unit(np.column_stack([ideal, np.full(len(ideal), -camera.f_mm)]))


def _unit(x: Array) -> Array:
    return np.asarray(x / np.linalg.norm(x, axis=-1, keepdims=True))


def _meet(at: Station, grid: Grid, r_e: Array, ray_e: Array) -> Array:
    """Return latitude, longitude, height where rays from one point meet the hills."""
    up = axes_of_enu_in_ecef(grid.geodetic_from_ecef(r_e[None]))[0, :, 2]
    fall = -(ray_e @ up)
    fall = np.where(fall > 0.05, fall, np.nan)
    way = (at.track.x_g[0, 2] - at.plan.ground_m) / fall
    for _ in range(_MAX_STEPS):
        llh = grid.geodetic_from_ecef(r_e + way[:, None] * ray_e)
        height = terrain_height(llh, at.plan.ground_m, latitude=at.latitude, relief=at.plan.relief)
        gap = llh[:, 2] - height
        if not np.nanmax(np.abs(gap), initial=0.0) > _GAP_M:
            break
        way = way + gap / fall
    return llh


def pixels_from_ground(at: Station, camera: Camera, x_g: Array) -> Array:
    """Project ground points.

    Parameters
    ----------
    at : Station
        The exposure.
    camera : Camera
        Any camera on the IMU.
    x_g : ndarray, shape (n, 3)
        East, north, ellipsoidal height, m.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Pixels; NaN far outside the sensor.
    """
    grid = Grid(crs=at.plan.crs)
    r_e_c, R_e_c = poses_in_ecef(grid, at.track, camera.boresight_deg, np.array(camera.lever_m))
    llh = grid.geodetic_from_grid(x_g)
    ray = grid.ecef_from_geodetic(llh) - r_e_c[0]
    if at.plan.refraction == "standard":
        ray = bent(ray, axes_of_enu_in_ecef(llh)[:, :, 2], x_g[:, 2])
    return project(camera, ray @ R_e_c[0])
