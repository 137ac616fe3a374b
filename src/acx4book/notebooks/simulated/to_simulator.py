"""A plan as the simulator takes it: plain numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.camera import Camera as PlannedCamera
from acx4lib.geometry.frames import opk_from_rotation
from acx4lib.planning import flown, ground, text
from acx4lib.planning.checks import settings
from acx4lib.planning.plan import Plan as FlightPlan
from acx4lib.planning.plan import PlannedBlock
from acx4sim.files.flights import SimulatedFlight, simulate_plan
from acx4sim.optics.lens import Camera
from acx4sim.plan import BlockPlan, Noise, Options, Plan, SlowErrors, Strip

START_S = {"heads": 221_400.0, "calibration": 224_700.0, "validation": 307_800.0}
"""Time of the first exposure, seconds of the week."""


def simulate(plan: FlightPlan, *, seed: int, options: Options) -> SimulatedFlight:
    """Fly a plan.

    Parameters
    ----------
    plan : planning.plan.Plan
    seed : int
    options : Options
        Its refraction is replaced by the plan's, as are its slow errors where the plan has any.

    Raises
    ------
    FlightError
        Where the simulator does not have what the plan asks for.
    """
    slow = _slow(plan.values.get("apriori", {})) or options.slow_errors
    options = replace(options, refraction=plan.setup.refraction, slow_errors=slow)
    flight = simulate_plan(simulated(plan), seed, options)
    return replace(flight, toml=text.written(settings(plan.values)))


def simulated(plan: FlightPlan) -> Plan:
    """Return the simulator's plan of a plan."""
    setup = plan.setup
    problems = [*_beyond(plan)]
    if problems:
        raise FlightError(problems)
    apriori = setup.apriori
    synthetic = setup.synthetic
    return Plan(
        name=setup.name,
        draws="plan",
        title=setup.name,
        crs=setup.grid.crs,
        ground_m=plan.terrain.height_m,
        relief=plan.terrain.relief_m / ground.RELIEF_M,
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
        control=_doubles(ground.places(plan.control)),
        blocks={name: _block(plan, block) for name, block in plan.blocks.items()},
        synthetic=synthetic.camera if synthetic else "",
        heads=synthetic.heads if synthetic else (),
        head_angles_deg=_head_angles(plan),
    )


def _beyond(plan: FlightPlan) -> list[str]:
    """Return what a plan asks for and the simulator does not have, a line each."""
    out = []
    if plan.setup.grid.heights != "ellipsoidal":
        out.append("heights: a simulated flight has ellipsoidal heights; plan it with those")
    flown_with = {**plan.setup.cameras, **plan.truth}
    out += [
        f"cameras.{name}.b1: the simulator has no b1; leave it out, or zero"
        for name, camera in flown_with.items()
        if camera.interior.b1 != 0
    ]
    return out


def _slow(apriori: Mapping[str, float]) -> SlowErrors | None:
    """Return the errors that change slowly, as a plan has them; None where all are white."""
    given = {}
    for of in ("gnss", "attitude"):
        given[of] = float(apriori.get(f"{of}_correlated_share", 0.0))
        if given[of] > 0:
            given[f"{of}_constant_s"] = float(apriori[f"{of}_correlation_s"])
    return SlowErrors(**given) if any(given.values()) else None


def _camera(camera: PlannedCamera) -> Camera:
    interior = {
        f"{name}_mm" if name in ("f", "xp", "yp") else name: getattr(camera.interior, name)
        for name in INTERIOR
        if name != "b1"
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


def _block(plan: FlightPlan, block: PlannedBlock) -> BlockPlan:
    """Return a block; only a validation has points of its own."""
    own = block.name == "validation"
    points, frame = block.points, plan.frame(block.name)
    target_px = points.sigma_px or plan.setup.apriori.image_point_px
    area = block.area
    return BlockPlan(
        letter=block.name[0].upper(),
        cameras=tuple(camera.name for camera in plan.cameras(block.name)),
        frame=frame.name if frame else "",
        centre_m=(area.east_m, area.north_m),
        azimuth_deg=area.course_deg,
        strips=tuple(
            Strip(
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
        tie_places=_doubles(flown.over(plan, block.name).tie_places())
        if block.tie_points
        else None,
        targets=_doubles(ground.places(points)) if own else np.empty((0, 2)),
        target_m=points.sigma_m,
        target_px=(target_px, target_px),
    )


def _doubles(places: Array) -> NDArray[np.float64]:
    return places.astype(np.float64)


def _head_angles(plan: FlightPlan) -> dict[str, tuple[float, float, float]]:
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
