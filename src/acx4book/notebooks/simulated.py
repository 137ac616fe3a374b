"""Plans of a flight, translated to plans of the simulator and back.

Functions to check and fly a plan, and to write the plan of a design.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4book.planning import flown
from acx4book.planning import plan as plans
from acx4book.planning.plan import Plan as FlightPlan
from acx4book.planning.plan import PlannedBlock, settings
from acx4files.flight import reader
from acx4files.flight.reader import Flight
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.camera import Camera as PlannedCamera
from acx4lib.geometry.frames import opk_from_rotation
from acx4sim import files
from acx4sim.designs import DESIGNS
from acx4sim.files import SimulatedFlight, simulate_plan
from acx4sim.optics import Camera
from acx4sim.plan import BlockPlan, Noise, Options, Plan, SlowErrors, Strip

# --- Simulated flights by the name of a design, or by the file of a plan


def is_plan(name: str) -> bool:
    """Tell whether a name is a plan's file."""
    return Path(name).suffix == ".toml"


def check(name: str) -> None:
    """Check that a name is of a design, or of a plan without faults.

    Raises
    ------
    FlightError
        Where a plan is not there or has faults, a line each.
    ValueError
        Where there is no such design.
    """
    if is_plan(name):
        plans.read(name)
    elif name not in DESIGNS:
        msg = f"unknown flight {name!r}; known: {', '.join(DESIGNS)}; a plan's name ends in .toml"
        raise ValueError(msg)


def fly(name: str, *, seed: int, options: Options | None = None) -> SimulatedFlight:
    """Return the flight of a design, or of the plan in a file.

    Parameters
    ----------
    name : str
        Of a design of the simulator, or a path that ends in ``.toml``.
    seed : int
    options : Options, optional
        As `simulate` takes them.

    Raises
    ------
    FlightError
        Where a plan has faults, a line each.
    ValueError
        For an unknown name, for refraction by an option where a plan has none, or where the
        simulator cannot do what a plan asks for.
    """
    options = options or Options()
    if not is_plan(name):
        check(name)
        return DESIGNS[name](seed=seed, options=options)
    plan = plans.read(name)
    if options.refraction == "standard" and plan.setup.refraction == "none":
        msg = 'refraction by an option is for designs; in a plan write refraction = "standard"'
        raise ValueError(msg)
    return simulate(plan, seed=seed, options=options)


# --- The plan of a design of the simulator, with the keys of a plan's file


SIZE = ("width_px", "height_px", "pixel_um")
LENS = ("xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2")
FREE = ("f_mm", *LENS)
AFFINITY = ("b1", "b2")

HEADS_FREE = ("xp_mm", "yp_mm", "k1", "p1", "p2")


def values(plan: Plan) -> dict[str, Any]:
    """Return the plan of a design: what `plan.written` takes.

    Tie points, which the design strews by chance, have their number and their area; strips have
    their names.
    """
    centre = next(iter(plan.blocks.values()))
    return {
        "name": plan.title,
        "crs": plan.crs,
        "heights": "ellipsoidal",
        "cameras": {
            name: {**_size(camera), **plan.approximate[name]}
            for name, camera in plan.cameras.items()
        },
        **_synthetic(plan),
        "apriori": {
            "image_point_px": plan.noise.image_px,
            "gnss_horizontal_m": plan.noise.gnss_horizontal_m,
            "gnss_vertical_m": plan.noise.gnss_vertical_m,
            "roll_pitch_deg": plan.noise.roll_pitch_deg,
            "heading_deg": plan.noise.heading_deg,
        },
        "stages": {
            **({"heads": {"estimate": list(HEADS_FREE)}} if plan.heads else {}),
            "mounting": {"estimate": list(FREE), "fix": []},
        },
        "field": {
            **_area(centre),
            "height_m": plan.ground_m,
            "relief_m": round(plan.relief * plans.RELIEF_M, 1),
        },
        "control": {
            "layout": "at",
            "at_m": _places(plan.control),
            "sigma_m": [*plan.noise.control_m],
        },
        **{name: _block(block) for name, block in plan.blocks.items()},
        "truth": {
            name: _truth(camera) for name, camera in plan.cameras.items() if _is_real(plan, name)
        },
    }


def _size(camera: Camera) -> dict[str, float]:
    return {key: getattr(camera, key) for key in SIZE}


def _synthetic(plan: Plan) -> dict[str, Any]:
    if not plan.heads:
        return {}
    measured_in = {"measured_in": "heads"} if plan.measured_in_heads else {}
    return {"synthetic": {"camera": plan.synthetic, "heads": [*plan.heads], **measured_in}}


def _is_real(plan: Plan, name: str) -> bool:
    """Tell whether a camera has true parameters; a synthetic camera made of heads has none."""
    return not (plan.measured_in_heads and name == plan.synthetic)


def _area(block: BlockPlan) -> dict[str, float]:
    east, north = block.centre_m
    return {"east_m": east, "north_m": north, "course_deg": block.azimuth_deg}


def _places(places: Array) -> list[list[float]]:
    rounded: list[list[float]] = np.round(places, 1).tolist()
    return rounded


def _block(block: BlockPlan) -> dict[str, Any]:
    forward, left = block.tie_area_m
    ties = {"tie_points": block.tie_points, "tie_area_m": [2 * forward, 2 * left]}
    check = {
        "layout": "at",
        "at_m": _places(block.targets),
        "sigma_m": [*block.target_m],
        "sigma_px": float(np.mean(block.target_px)),
    }
    return {
        **(_area(block) if len(block.targets) else {}),
        **(ties if block.tie_points else {}),
        **({"check": check} if len(block.targets) else {}),
        "strips": {
            f"{block.letter}{i}": _strip(block, i - 1) for i in range(1, len(block.strips) + 1)
        },
    }


def _strip(block: BlockPlan, i: int) -> dict[str, float]:
    strip = block.strips[i]
    place = {"forward_m": strip.forward_m, "left_m": strip.left_m}
    return {
        "flying_height_m": strip.height_m,
        "course_deg": (block.azimuth_deg + strip.turn_deg) % 360.0,
        "length_m": (strip.n - 1) * strip.base_m,
        "base_m": strip.base_m,
        **{key: value for key, value in place.items() if value},
    }


def _truth(camera: Camera) -> Mapping[str, float]:
    """Return true parameters with the names of flight.toml."""
    omega, phi, kappa = camera.boresight_deg
    x, y, z = camera.lever_m
    return {
        "focal_mm": camera.f_mm,
        **{key: getattr(camera, key) for key in LENS},
        "mount_omega_deg": omega,
        "mount_phi_deg": phi,
        "mount_kappa_deg": kappa,
        "lever_x_m": x,
        "lever_y_m": y,
        "lever_z_m": z,
    }


# --- A simulated flight in one call: as read from its files, with its true parameters


STANDARD = Options()

EXACT = Options(image_noise=0.0, control_noise=0.0, gnss_noise=0.0, attitude_noise=0.0)
"""A flight whose measurements have no noise, but the usual standard deviations."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Flown:
    """A simulated flight.

    Attributes
    ----------
    flight : Flight
        As its files say.
    truth : mapping of str to float
        True values of the camera of its calibration block, by the names of results.
    """

    flight: Flight
    truth: Mapping[str, float]

    @property
    def block(self) -> Block:
        """Its calibration block."""
        return self.flight.block("calibration")

    def __repr__(self) -> str:
        return f"simulated flight {self.flight.name!r}"


def fly_and_read(
    design: str,
    seed: int,
    options: Options = STANDARD,
    *,
    blocks: Sequence[str] = ("calibration",),
) -> Flown:
    """Fly a design of the simulator.

    Parameters
    ----------
    design : str
        Of `acx4sim.DESIGNS`.
    seed : int
    options : Options
        Whose blocks are replaced.
    blocks : sequence of str
        Blocks to fly.
    """
    simulated = DESIGNS[design](seed=seed, options=replace(options, blocks=tuple(blocks)))
    flight = read(simulated)
    camera = flight.block(blocks[0]).cameras[0].name
    return Flown(flight=flight, truth=simulated.truth["cameras"][camera])


def read(simulated: SimulatedFlight) -> Flight:
    """Return a simulated flight as its files say.

    Raises
    ------
    FlightError
        Where its tables were changed so that it is refused.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight"
        files.write(simulated, path)
        return reader.read(path)


# --- A plan as the simulator takes it: plain numbers


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
    flight = simulate_plan(_simulated(plan), seed, options)
    return replace(flight, toml=plans.written({"simulated": True, **settings(plan.values)}))


def _simulated(plan: FlightPlan) -> Plan:
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
        relief=plan.terrain.relief_m / plans.RELIEF_M,
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
        control=_doubles(plans.places(plan.control)),
        blocks={name: _to_simulator_block(plan, block) for name, block in plan.blocks.items()},
        synthetic=synthetic.camera if synthetic else "",
        heads=synthetic.heads if synthetic else (),
        head_angles_deg=_head_angles(plan),
    )


def _beyond(plan: FlightPlan) -> list[str]:
    """Return the features of a plan that the simulator does not have, a line each."""
    out = []
    if plan.setup.grid.heights != "ellipsoidal":
        out.append("heights: a simulated flight has ellipsoidal heights; plan it with those")
    flown_with = {**plan.setup.cameras, **plan.truth}
    out += [
        f"cameras.{name}.{key}: the simulator has no {key}; leave it out, or zero"
        for name, camera in flown_with.items()
        for key in AFFINITY
        if getattr(camera.interior, key) != 0
    ]
    return out


def _slow(apriori: Mapping[str, float]) -> SlowErrors | None:
    """Return the slowly changing errors of a plan; None where all are white."""
    errors = {}
    for sensor in ("gnss", "attitude"):
        errors[sensor] = float(apriori.get(f"{sensor}_correlated_share", 0.0))
        if errors[sensor] > 0:
            errors[f"{sensor}_constant_s"] = float(apriori[f"{sensor}_correlation_s"])
    return SlowErrors(**errors) if any(errors.values()) else None


def _camera(camera: PlannedCamera) -> Camera:
    interior = {
        f"{name}_mm" if name in ("f", "xp", "yp") else name: getattr(camera.interior, name)
        for name in INTERIOR
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


def _to_simulator_block(plan: FlightPlan, block: PlannedBlock) -> BlockPlan:
    """Return a block; only a validation has points of its own."""
    has_points = block.name == "validation"
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
        targets=_doubles(plans.places(points)) if has_points else np.empty((0, 2)),
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
