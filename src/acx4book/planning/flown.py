"""A plan in the simulator: flown with errors as a flight, or without any to see what it determines.

The simulator takes plain numbers and imports nothing of the library, so what it flies of a plan is
a test of both.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np
import pandas as pd

from acx4book.planning import plan as plans
from acx4book.planning.plan import TURN_S, Plan, PlannedBlock, image_length_m
from acx4files.flight import reader
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.geometry import camera as cameras
from acx4lib.geometry.frames import opk_from_rotation
from acx4sim import plan as designs
from acx4sim.earth import RELIEF_M, Array
from acx4sim.files import SimulatedFlight, simulate_plan
from acx4sim.fly import fly, ground_points, look, scattered
from acx4sim.optics import Camera
from acx4sim.plan import BlockPlan, Noise, Options, SlowErrors

START_S = {"heads": 221_400.0, "calibration": 224_700.0, "validation": 307_800.0}
"""Time of the first exposure, seconds of the week."""

AFFINITY = ("b1", "b2")

EXACT = Options(image_noise=0.0, control_noise=0.0, gnss_noise=0.0, attitude_noise=0.0)
"""A flight whose measurements have no noise, but the usual standard deviations."""


def flying_time_s(strips: Sequence[plans.Strip]) -> float:
    """Return the time from the first exposure to the last, turns included."""
    on_strips = sum((strip.n_exposures - 1) * strip.base_m / strip.speed_m_s for strip in strips)
    return on_strips + TURN_S * max(len(strips) - 1, 0)


def simulate(plan: Plan, *, seed: int, options: Options) -> SimulatedFlight:
    """Fly a plan.

    Parameters
    ----------
    plan : Plan
    seed : int
    options : Options
        Its refraction is replaced by the plan's, as are its slow errors where the plan has any.

    Raises
    ------
    FlightError
        Where the simulator does not have what the plan asks for.
    """
    problems = [*_beyond(plan)]
    if problems:
        raise FlightError(problems)
    slow = _slow(plan.values) or options.slow_errors
    options = replace(options, refraction=plan.setup.refraction, slow_errors=slow)
    flight = simulate_plan(simulated(plan, tie_places(plan)), seed, options)
    return replace(flight, toml=plans.written({"simulated": True, **plans.settings(plan.values)}))


def _beyond(plan: Plan) -> Iterator[str]:
    """Yield the features of a plan that the simulator does not have."""
    if plan.setup.grid.heights != "ellipsoidal":
        yield "heights: a simulated flight has ellipsoidal heights; plan it with those"
    for name, camera in {**plan.setup.cameras, **plan.truth}.items():
        for key in AFFINITY:
            if getattr(camera.interior, key) != 0:
                yield f"cameras.{name}.{key}: the simulator has no {key}; leave it out, or zero"


def _slow(values: Mapping[str, Any]) -> SlowErrors | None:
    """Return the slowly changing errors of a plan; None where all are white."""
    apriori, errors = values.get("apriori", {}), {}
    for sensor in ("gnss", "attitude"):
        errors[sensor] = float(apriori.get(f"{sensor}_correlated_share", 0.0))
        if errors[sensor] > 0:
            errors[f"{sensor}_constant_s"] = float(apriori[f"{sensor}_correlation_s"])
    return SlowErrors(**errors) if any(errors.values()) else None


# --- A flight without errors, in one wind
#
# An aircraft is never quite on its line, nor level, and that helps to tell lever arm and boresight
# apart. The simulator moves it by chance. Here the wind 0 moves it evenly, and every other wind by
# chance with its own number: both are the same in every run.


def exact(plan: Plan, places: Mapping[str, Array], *, wind: int = 0) -> dict[str, Block]:
    """Return the blocks of a plan, flown without errors.

    Parameters
    ----------
    plan : Plan
        Its true cameras are not used.
    places : dict of str to ndarray
        Of its tie points, as `tie_places` returns them.
    wind : int
        Number of the wind that moves the aircraft.

    Raises
    ------
    FlightError
        Where the images of a block show no point.
    """
    of_plan = simulated(replace(plan, truth={}), places, wind=wind)
    tables = simulate_plan(of_plan, 0, replace(EXACT, refraction=plan.setup.refraction)).tables
    by_block: dict[str, dict[str, pd.DataFrame]] = {name: {} for name in plan.blocks}
    for path, table in tables.items():
        block, _, file = path.rpartition("/")
        if block:
            by_block[block][file.removesuffix(".csv")] = table
    for name, of_block in by_block.items():
        points, sigma_px = of_block["image_points"], plan.blocks[name].points.sigma_px
        if points.empty:
            reason = "lie apart from the strips"
            raise FlightError([f"{name}: no image shows a point; there are none, or they {reason}"])
        if sigma_px is not None and name != "validation":
            surveyed = points["point"].str.startswith("P")
            points["sigma_px"] = np.where(surveyed, sigma_px, plan.setup.apriori.image_point_px)
    values = {**plans.settings(plan.values), "heights": "ellipsoidal"}
    control = tables.get("control_points.csv")
    return dict(reader.from_tables(values, control_points=control, **by_block).blocks)


def _motion(strips: Sequence[plans.Strip], wind: int) -> Array:
    """Return how a wind moves every exposure, as `BlockPlan.motion` has it, shape (n, 7)."""
    counts = [strip.n_exposures for strip in strips]
    n = sum(counts)
    if wind:
        rng = np.random.default_rng(wind)
        moved, crab = rng.standard_normal((n, 6)), rng.uniform(-1.0, 1.0, len(counts))
    else:
        normal = NormalDist()
        moved = np.array([normal.inv_cdf(max(x, 1e-9)) for x in _spread(n).ravel().tolist()])
        crab = _spread(len(counts))[:, 0] * 2 - 1
    return np.column_stack([moved.reshape(n, 6), np.repeat(crab, counts)])


def _spread(n: int) -> Array:
    """Return numbers from 0 to 1 that are spread evenly in every column, shape (n, 6)."""
    steps = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]))
    spread: Array = (np.arange(1, n + 1)[:, None] * steps) % 1
    return spread


# --- Tie points of a plan
#
# They fill their area evenly, one after the other, until every camera has as many as are asked for
# in three images or more; those that no camera has in three images do not count.


LEAST_RAYS = 3
"""Number of images of one camera in which a tie point must be."""

MOST_BATCHES = 30
"""Largest number of batches of tried points, each as many as are asked for."""


def tie_places(plan: Plan) -> dict[str, Array]:
    """Return by block where tie points are tried, forward and left of its middle, m, (n, 2).

    Raises
    ------
    FlightError
        Where the images show less than are asked for.
    """
    of_plan = simulated(replace(plan, truth={}), {}, wind=0)
    return {
        name: _tie_places(plan, of_plan, name)
        for name, block in plan.blocks.items()
        if block.tie_points
    }


def _tie_places(plan: Plan, flown_plan: designs.Plan, name: str) -> Array:
    block, wanted = flown_plan.blocks[name], plan.blocks[name].tie_points
    deciding = (block.frame,) if block.frame else block.cameras
    rng = np.random.default_rng(0)  # of no use in an even wind
    track = fly(flown_plan, block, rng)
    low, high = _tie_area(plan, name, scattered(block, rng)[0])
    n_good = np.zeros(len(deciding), dtype=int)
    for batch in range(MOST_BATCHES):
        places = low + (high - low) * plans.evenly(wanted, first=1 + batch * wanted)
        x_g = ground_points(flown_plan, block, places)
        good = look(flown_plan, deciding, track, x_g).seen.sum(axis=1) >= LEAST_RAYS
        so_far = n_good[:, None] + np.cumsum(good, axis=1)
        enough = np.all(so_far >= wanted, axis=0)
        if enough.any():
            n = batch * wanted + int(np.argmax(enough)) + 1
            return low + (high - low) * plans.evenly(n)
        n_good = so_far[:, -1]
    reason = f"{name}.tie_points: of {wanted}, three images of every camera show only"
    raise FlightError([f"{reason} {n_good.min()}; ask for less, or for a larger overlap"])


def _tie_area(plan: Plan, name: str, exposed: Array) -> tuple[Array, Array]:
    """Return the least and the largest forward and left of the area with tie points."""
    block = plan.blocks[name]
    if block.tie_area_m is not None:
        half = 0.5 * np.array(block.tie_area_m)
        return -half, half
    camera = plan.frame(name) or plan.cameras(name)[0]
    local, height = exposed[:, :2], exposed[:, 2]
    counts = [strip.n_exposures for strip in block.strips.values()]
    courses = np.repeat([strip.course_deg for strip in block.strips.values()], counts)
    turn = np.radians(courses - block.area.course_deg)
    along = image_length_m(camera, 1.0) * height
    across = image_length_m(camera, 1.0, across=True) * height
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half = 0.5 * np.column_stack([c * along + s * across, s * along + c * across])
    return (local - half).min(axis=0), (local + half).max(axis=0)


# --- A plan as the simulator takes it


def simulated(plan: Plan, places: Mapping[str, Array], *, wind: int | None = None) -> designs.Plan:
    """Return the simulator's plan of a plan, with given places of tie points.

    Parameters
    ----------
    plan : Plan
    places : mapping of str to ndarray
    wind : int, optional
        As `exact` takes it; by default every seed has its own.
    """
    setup, synthetic = plan.setup, plan.setup.synthetic
    apriori = setup.apriori
    return designs.Plan(
        name=setup.name,
        draws="plan",
        title=setup.name,
        crs=setup.grid.crs,
        ground_m=plan.height_m,
        relief=plan.relief_m / RELIEF_M,
        cameras={name: _camera(plan.truth.get(name, c)) for name, c in setup.cameras.items()},
        approximate={name: _approximate(plan.values, name) for name in setup.cameras},
        noise=Noise(
            image_px=apriori.image_point_px,
            gnss_horizontal_m=apriori.gnss_horizontal_m,
            gnss_vertical_m=apriori.gnss_vertical_m,
            roll_pitch_deg=apriori.roll_pitch_deg,
            heading_deg=apriori.heading_deg,
            control_m=plan.control.sigma_m,
        ),
        angles="geodetic",
        control=plans.places(plan.control).astype(np.float64),
        blocks={
            name: _block(plan, block, places.get(name), wind) for name, block in plan.blocks.items()
        },
        synthetic=synthetic.camera if synthetic else "",
        heads=synthetic.heads if synthetic else (),
        head_angles_deg=_head_angles(plan),
    )


def _camera(camera: cameras.Camera) -> Camera:
    interior = {
        f"{name}_mm" if name in ("f", "xp", "yp") else name: getattr(camera.interior, name)
        for name in cameras.INTERIOR
        if name not in AFFINITY
    }
    omega, phi, kappa = np.degrees(camera.T_b_c.opk).tolist()
    x, y, z = camera.T_b_c.r.tolist()
    return Camera(
        width_px=camera.width_px,
        height_px=camera.height_px,
        pixel_um=1000.0 * camera.pixel_mm,
        boresight_deg=(omega, phi, kappa),
        lever_m=(x, y, z),
        **interior,
    )


def _approximate(values: Mapping[str, Any], name: str) -> dict[str, float]:
    size = ("width_px", "height_px", "pixel_um")
    return {key: value for key, value in values["cameras"][name].items() if key not in size}


def _block(plan: Plan, block: PlannedBlock, places: Array | None, wind: int | None) -> BlockPlan:
    """Return a block; only a validation has points of its own."""
    points, frame, area = block.points, plan.frame(block.name), block.area
    target_px = points.sigma_px or plan.setup.apriori.image_point_px
    strips = tuple(block.strips.values())
    return BlockPlan(
        letter=block.name[0].upper(),
        cameras=tuple(camera.name for camera in plan.cameras(block.name)),
        frame=frame.name if frame else "",
        centre_m=(area.east_m, area.north_m),
        azimuth_deg=area.course_deg,
        strips=tuple(
            designs.Strip(
                n=strip.n_exposures,
                height_m=strip.flying_height_m,
                base_m=strip.base_m,
                turn_deg=strip.course_deg - area.course_deg,
                forward_m=strip.forward_m,
                left_m=strip.left_m,
                speed_m_s=strip.speed_m_s,
                name=name,
            )
            for name, strip in block.strips.items()
        ),
        start_s=START_S[block.name],
        tie_points=0,
        tie_area_m=(0.0, 0.0),
        tie_places=places,
        motion=None if wind is None else _motion(strips, wind),
        targets=(
            plans.places(points).astype(np.float64)
            if block.name == "validation"
            else np.empty((0, 2))
        ),
        target_m=points.sigma_m,
        target_px=(target_px, target_px),
    )


def _head_angles(plan: Plan) -> dict[str, tuple[float, float, float]]:
    """Return the angles of the heads in the synthetic frame, degrees; of one camera, none."""
    setup = plan.setup
    if setup.synthetic is None:
        return {}
    R_s_b = setup.cameras[setup.synthetic.camera].T_b_c.R.T
    out = {}
    for name in setup.synthetic.heads:
        head = plan.truth.get(name, setup.cameras[name])
        omega, phi, kappa = np.degrees(opk_from_rotation(R_s_b @ head.T_b_c.R)).tolist()
        out[name] = (omega, phi, kappa)
    return out
