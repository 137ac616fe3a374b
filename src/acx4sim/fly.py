"""The true poses of the aircraft at the exposures, what its GNSS/INS records, what images show."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from acx4sim.earth import (
    Array,
    BoolArray,
    Grid,
    attitude_from_rph,
    axes_of_enu_in_ecef,
    rotation_from_opk_deg,
    terrain_height,
)
from acx4sim.optics import Camera, bent, project
from acx4sim.plan import BlockPlan, Noise, Options, Plan, Strip, grid_from_field

_TURN_S = 240.0
_SCATTER_M = np.array([6.0, 8.0, 5.0])  # forward, left, up
_IN_TURN = 0.4  # of the base, by which an exposure is early or late at most
_MOTION_DEG = np.array([1.1, 0.9, 0.8])  # roll, pitch, yaw
_CRAB_DEG = 4.0
_COMPASS_ROUNDS = 30  # of a few degrees, each leaves less than a tenth


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """The body frame at the exposures of a block.

    Attributes
    ----------
    exposure, strip : list of str
        Names.
    time_s : ndarray, shape (n,)
        Seconds of the week.
    x_g : ndarray, shape (n, 3)
        East, north, height, m.
    R_enu_b : Rotation
        Attitudes, body to local east, north, up.
    """

    exposure: list[str]
    strip: list[str]
    time_s: Array
    x_g: Array
    R_enu_b: Rotation


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """Return a generator of random numbers for one purpose, independent of all others."""
    return np.random.default_rng([seed, *"/".join(purpose).encode()])


def fly(plan: Plan, block: BlockPlan, rng: np.random.Generator) -> Track:
    """Fly a block as planned, with the effects of wind and turbulence.

    The ground speed of a strip is constant. An exposure that lies ahead of its place is therefore
    late by as much, so that velocities are those of the positions.
    """
    grid = Grid(crs=plan.crs)
    places, rph_deg, late_s = scattered(block, rng)
    rph = np.radians(rph_deg)
    en = grid_from_field(block, places[:, :2])
    x_g = np.column_stack([en, places[:, 2] + plan.ground_m])
    rph[:, 2] += np.radians(block.azimuth_deg) + grid.convergence(grid.geodetic_from_grid(x_g))
    return Track(
        exposure=[
            f"{block.letter}{number}-{i + 1:02d}"
            for number, strip in enumerate(block.strips, 1)
            for i in range(strip.n)
        ],
        strip=[
            strip.name or str(number)
            for number, strip in enumerate(block.strips, 1)
            for _ in range(strip.n)
        ],
        time_s=_times(block) + late_s,
        x_g=x_g,
        R_enu_b=attitude_from_rph(rph),
    )


def scattered(block: BlockPlan, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return where the exposures of a block are: as planned, but for wind and turbulence.

    Returns
    -------
    places, rph_deg : ndarray, shape (n, 3)
        Forward, left and up in the block's axes, m; roll, pitch, and heading from its azimuth.
    late_s : ndarray, shape (n,)
        Delays of the exposures.
    """
    if block.motion is None:
        motions = [_drawn(strip.n, rng) for strip in block.strips]
    else:
        motions = np.split(block.motion, np.cumsum([strip.n for strip in block.strips])[:-1])
    parts = [_fly_strip(strip, m) for strip, m in zip(block.strips, motions, strict=True)]
    places, rph_deg, late_s = (np.concatenate(part) for part in zip(*parts, strict=True))
    return places, rph_deg, late_s


def _drawn(n: int, rng: np.random.Generator) -> Array:
    """Draw the motion of a strip, as `BlockPlan.motion` has it."""
    scatter, turn = rng.standard_normal((n, 3)), rng.standard_normal((n, 3))
    return np.column_stack([scatter, turn, np.full(n, rng.uniform(-1.0, 1.0))])


def _fly_strip(strip: Strip, motion: Array) -> tuple[Array, Array, Array]:
    """Return positions (forward, left, up, m), roll, pitch, azimuth (deg), delays of exposures (s).

    Positions are in the block's axes. Exposures keep their order, however short the base.
    """
    turn = np.radians(strip.turn_deg)
    ahead, aside = np.array([np.cos(turn), -np.sin(turn)]), np.array([np.sin(turn), np.cos(turn)])
    along = (np.arange(strip.n) - (strip.n - 1) / 2) * strip.base_m
    scatter = _SCATTER_M * np.clip(motion[:, :3], -2, 2)
    scatter[:, 0] = np.clip(scatter[:, 0], -_IN_TURN * strip.base_m, _IN_TURN * strip.base_m)
    places = np.empty((strip.n, 3))
    places[:, :2] = (
        np.array([strip.forward_m, strip.left_m])
        + (along + scatter[:, 0])[:, None] * ahead
        + scatter[:, 1:2] * aside
    )
    places[:, 2] = strip.height_m + scatter[:, 2]
    rph = _MOTION_DEG * np.clip(motion[:, 3:6], -2, 2)
    rph[:, 2] += strip.turn_deg + _CRAB_DEG * motion[:, 6]
    return places, rph, scatter[:, 0] / strip.speed_m_s


def _times(block: BlockPlan) -> Array:
    steps = np.concatenate(
        [
            np.r_[_TURN_S, np.full(strip.n - 1, strip.base_m / strip.speed_m_s)]
            for strip in block.strips
        ]
    )
    return np.asarray(block.start_s - _TURN_S + np.cumsum(steps))


def record(
    track: Track,
    noise: Noise,
    options: Options,
    *,
    white: np.random.Generator,
    slow: np.random.Generator,
) -> Track:
    """Add the errors of the GNSS/INS: position in the grid, attitude about the body's axes."""
    sigma_m = options.gnss_noise * np.array(
        [noise.gnss_horizontal_m, noise.gnss_horizontal_m, noise.gnss_vertical_m]
    )
    sigma_deg = options.attitude_noise * np.array(
        [noise.roll_pitch_deg, noise.roll_pitch_deg, noise.heading_deg]
    )
    n, time_s = len(track.time_s), track.time_s
    random_m, random_deg = white.standard_normal((n, 3)), white.standard_normal((n, 3))
    if options.slow_errors is not None:
        slow_errors = options.slow_errors
        constants = np.repeat([slow_errors.gnss_constant_s, slow_errors.attitude_constant_s], 3)
        walks = gauss_markov(time_s, constants, slow)
        random_m = slow_errors.gnss * walks[:, :3] + np.sqrt(1 - slow_errors.gnss**2) * random_m
        random_deg = (
            slow_errors.attitude * walks[:, 3:] + np.sqrt(1 - slow_errors.attitude**2) * random_deg
        )
    minutes = (time_s - time_s[0])[:, None] / 60
    error = sigma_m * random_m + options.gnss_shift_m + minutes * options.gnss_drift_m_per_min
    if any(options.gnss_strip_drift_m_per_min):
        error += _strip_drift(track, np.array(options.gnss_strip_drift_m_per_min), slow)
    turn = Rotation.from_rotvec(sigma_deg * random_deg, degrees=True)
    delayed = _later(track, options.gnss_delay_s, options.attitude_delay_s)
    shown = _by_compass(delayed.R_enu_b, options.compass_deg)
    return replace(track, x_g=delayed.x_g + error, R_enu_b=shown * turn)


def _by_compass(R_enu_b: Rotation, compass_deg: tuple[float, float]) -> Rotation:
    """Return attitudes with the headings that a compass of these coefficients shows."""
    if not any(compass_deg):
        return R_enu_b
    forward = R_enu_b.apply([1.0, 0.0, 0.0])
    true_deg = np.degrees(np.arctan2(forward[:, 0], forward[:, 1]))
    more_deg = np.zeros(len(true_deg))
    for _ in range(_COMPASS_ROUNDS):
        shown = np.radians(true_deg + more_deg)
        more_deg = compass_deg[0] * np.sin(shown) + compass_deg[1] * np.cos(shown)
    return Rotation.from_rotvec(np.outer(-more_deg, [0.0, 0.0, 1.0]), degrees=True) * R_enu_b


def _later(track: Track, position_s: float, attitude_s: float) -> Track:
    """Return a track with positions and attitudes of later times than its exposures.

    Between three exposures of a strip the aircraft is on the parabola through them, at either end
    on the line through two.
    """
    if not position_s and not attitude_s:
        return track
    x_g, turns = track.x_g.copy(), np.zeros_like(track.x_g)
    strips = np.array(track.strip)
    for i, strip in enumerate(track.strip):
        near = [j for j in (i - 1, i, i + 1) if 0 <= j < len(strips) and strips[j] == strip]
        since = track.time_s[near] - track.time_s[i]
        x_g[i] = _through(since, position_s) @ track.x_g[near]
        away = (track.R_enu_b[i].inv() * track.R_enu_b[near]).as_rotvec()
        turns[i] = _through(since, attitude_s) @ away
    return replace(track, x_g=x_g, R_enu_b=track.R_enu_b * Rotation.from_rotvec(turns))


def _through(times: Array, time: float) -> Array:
    """Return Lagrange's weights that interpolate values at some times to another time."""
    others = [np.delete(times, k) for k in range(len(times))]
    return np.array([np.prod((time - o) / (t - o)) for t, o in zip(times, others, strict=True)])


def gauss_markov(time_s: Array, time_constant_s: Array, rng: np.random.Generator) -> Array:
    """Draw processes of unit variance with a correlation that decreases exponentially with time.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
        Ascending.
    time_constant_s : ndarray, shape (n_walks,)
        For every process, the time after which the correlation is 1/e.
    rng : Generator
        Random numbers.

    Returns
    -------
    ndarray, shape (n, n_walks)
    """
    walks = rng.standard_normal((len(time_s), len(time_constant_s)))
    kept = np.exp(-np.diff(time_s)[:, None] / time_constant_s)
    for i, share in enumerate(kept, 1):
        walks[i] = share * walks[i - 1] + np.sqrt(1 - share**2) * walks[i]
    return walks


def _strip_drift(track: Track, sigma_m_per_min: Array, rng: np.random.Generator) -> Array:
    """Draw a rate of drift for every strip and return the errors, m."""
    error = np.zeros((len(track.strip), 3))
    strips = np.array(track.strip)
    for strip in dict.fromkeys(track.strip):
        here = strips == strip
        minutes = (track.time_s[here] - track.time_s[here].mean()) / 60
        error[here] = minutes[:, None] * sigma_m_per_min * rng.standard_normal(3)
    return error


def poses_in_ecef(
    grid: Grid, track: Track, boresight_deg: tuple[float, float, float], lever_m: Array
) -> tuple[Array, Array]:
    """Compute a camera's centres (n, 3) and its rotations to ECEF (n, 3, 3)."""
    llh = grid.geodetic_from_grid(track.x_g)
    R_e_b = Rotation.from_matrix(axes_of_enu_in_ecef(llh)) * track.R_enu_b
    R_e_c = R_e_b * rotation_from_opk_deg(boresight_deg)
    return grid.ecef_from_geodetic(llh) + R_e_b.apply(lever_m), R_e_c.as_matrix()


# --- Exact image coordinates of points, their visibility, and the measured tie points


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


def look(plan: Plan, cameras: Sequence[str], track: Track, x_g: Array) -> Visibility:
    """Project points, east, north, height, into cameras at all exposures of a track."""
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
    surveyed = look(plan, deciding, track, surveyed_g)
    if block.tie_places is None:
        ties_g, ties = _strew_tie_points(plan, block, deciding, track, rng)
    else:
        ties_g, ties = _placed_tie_points(plan, block, block.tie_places, deciding, track)
    seen = np.concatenate([surveyed.seen, ties.seen], axis=2)
    if block.frame:
        sight = look(plan, block.cameras, track, np.concatenate([surveyed_g, ties_g]))
        return replace(sight, seen=sight.seen & seen)
    return Visibility(colrow=np.concatenate([surveyed.colrow, ties.colrow], axis=2), seen=seen)


def _placed_tie_points(
    plan: Plan, block: BlockPlan, places: Array, cameras: Sequence[str], track: Track
) -> tuple[Array, Visibility]:
    """Measure tie points at given places in every image; drop those with fewer than three rays.

    Returns as `_strew_tie_points`.
    """
    x_g = ground_points(plan, block, places)
    sight = look(plan, cameras, track, x_g)
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
        sight = look(plan, cameras, track, x_g)
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
        return x_g, look(plan, cameras, track, x_g)
    return np.concatenate(grounds), Visibility(
        colrow=np.concatenate([sight.colrow for sight in sights], axis=2),
        seen=np.concatenate([sight.seen for sight in sights], axis=2),
    )
