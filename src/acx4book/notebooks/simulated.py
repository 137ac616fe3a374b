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

from acx4book.planning import flown
from acx4book.planning import plan as plans
from acx4files.flight import reader
from acx4files.flight.reader import Flight
from acx4lib.block import Block
from acx4lib.expected import Array
from acx4sim import files
from acx4sim.designs import DESIGNS
from acx4sim.earth import RELIEF_M
from acx4sim.files import SimulatedFlight
from acx4sim.optics import Camera
from acx4sim.plan import BlockPlan, Options, Plan

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
        As `planning.flown.simulate` takes them.

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
    return flown.simulate(plan, seed=seed, options=options)


# --- The plan of a design of the simulator, with the keys of a plan's file


SIZE = ("width_px", "height_px", "pixel_um")
LENS = ("xp_mm", "yp_mm", "k1", "k2", "k3", "p1", "p2")
FREE = ("f_mm", *LENS)
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
            "relief_m": round(plan.relief * RELIEF_M, 1),
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

EXACT = flown.EXACT


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
