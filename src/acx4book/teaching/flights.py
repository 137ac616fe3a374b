"""Small flights for lab sheets: one camera over a village, its parameters drawn anew."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4book.teaching import students
from acx4book.teaching.case import Case, Sheet
from acx4lib.flight.reader import read
from acx4lib.results.own_folder.whole_files import naming
from acx4sim.designs import single_head_plan
from acx4sim.files.flights import SimulatedFlight, simulate_plan
from acx4sim.files.writer import write_files
from acx4sim.optics.lens import Camera
from acx4sim.plan import Options, Plan, Strip, layout

LOW = Strip(n=5, height_m=300.0, base_m=60.0)
HIGH = Strip(n=5, height_m=500.0, base_m=100.0)

WHOLE = (
    LOW,
    replace(LOW, turn_deg=180.0),
    replace(HIGH, turn_deg=90.0),
    replace(HIGH, turn_deg=270.0),
)
"""Two strips at each of two heights, opposite in direction; those of the other height cross."""

PROOF = tuple(
    Strip(n=6, height_m=400.0, base_m=110.0, turn_deg=180.0 * (k % 2), left_m=200.0 * (1 - k))
    for k in range(3)
)
"""The independent block: three strips."""

ABOUT = {
    "boresight_deg": ((0.15, 0.25), (0.35, 0.5), (0.1, 0.3)),
    "lever_m": ((0.15, 0.25), (0.40, 0.50), (0.70, 0.90)),
}
"""Between which sizes parameters are drawn, either sign: apart, so that swapped axes are seen."""

APPROXIMATE = {"focal_mm": 50.0, "mount_kappa_deg": 90.0}
"""What flight.toml says of the camera where it is to be calibrated."""


def drawn_camera(seed: int) -> Camera:
    """Return the camera of one student: every parameter is drawn."""
    rng = np.random.default_rng([seed, *b"camera"])

    def either(low: float, high: float) -> float:
        return float(rng.choice([-1.0, 1.0]) * rng.uniform(low, high))

    angles, lever = (tuple(either(*size) for size in ABOUT[name]) for name in ABOUT)
    camera = single_head_plan().cameras["CAM"]
    drawn = {
        "f_mm": 50.0 + either(0.08, 0.2),
        "xp_mm": either(0.03, 0.06),
        "yp_mm": either(0.03, 0.06),
        "p1": either(2e-6, 4e-6),
        "p2": either(2e-6, 4e-6),
        "k1": float(rng.choice([-1.0, 1.0])) * camera.k1 * rng.uniform(0.8, 1.2),
    }
    inner: dict[str, Any] = {name: float(f"{value:.9g}") for name, value in drawn.items()}
    omega, phi, kappa = (round(angle, 7) for angle in angles)
    x, y, z = (round(value, 7) for value in lever)
    return replace(
        camera, **inner, boresight_deg=(omega, phi, round(90.0 + kappa, 7)), lever_m=(x, y, z)
    )


def certificate(camera: Camera) -> dict[str, float]:
    """Return everything of a camera as flight.toml has it, for a sheet on which it is known."""
    named = {name: getattr(camera, name) for name in ("xp_mm", "yp_mm")}
    named |= {name: getattr(camera, name) for name in ("k1", "k2", "k3", "p1", "p2")}
    axes = ("omega", "phi", "kappa")
    named |= {f"mount_{a}_deg": v for a, v in zip(axes, camera.boresight_deg, strict=True)}
    named |= {f"lever_{a}_m": v for a, v in zip("xyz", camera.lever_m, strict=True)}
    return {"focal_mm": camera.f_mm, **named}


def fly(
    seed: int,
    title: str,
    camera: Camera,
    strips: Sequence[Strip],
    *,
    known: Mapping[str, float] = APPROXIMATE,
    proof: Sequence[Strip] = (),
    options: Options = Options(),  # noqa: B008 frozen
) -> SimulatedFlight:
    """Simulate a small flight.

    Parameters
    ----------
    seed : int
        Of trajectory and errors.
    title : str
        Name of the flight.
    camera : Camera
        The true one.
    strips : sequence of Strip
        Of the calibration block.
    known : mapping of str to float
        What flight.toml says of the camera.
    proof : sequence of Strip
        Of the validation block; there is none without strips.
    options : Options
    """
    return simulate_plan(_plan(title, camera, strips, known, proof), seed, options)


def _plan(
    title: str,
    camera: Camera,
    strips: Sequence[Strip],
    known: Mapping[str, float],
    proof: Sequence[Strip],
) -> Plan:
    plan = single_head_plan()
    calibration = replace(
        plan.blocks["calibration"],
        strips=tuple(strips),
        tie_points=150,
        tie_area_m=(220.0, 220.0),
    )
    validation = replace(
        plan.blocks["validation"],
        strips=tuple(proof),
        targets=layout(5, 4, (220.0, 260.0), 30.0),
    )
    return replace(
        plan,
        name="lab",
        draws="lab",
        title=title,
        cameras={"CAM": camera},
        approximate={"CAM": dict(known)},
        control=layout(4, 3, (130.0, 115.0), 15.0),
        blocks={"calibration": calibration, **({"validation": validation} if proof else {})},
    )


def flight_of(sheet: Sheet, student: str, key: bytes) -> SimulatedFlight:
    """Return the flight of a student; the same name and key give the same bytes."""
    truth, errors = (
        students.seed(key, sheet=sheet.name, student=student, purpose=purpose)
        for purpose in ("truth", "errors")
    )
    return sheet.fly(truth, errors, students.title(sheet.name, students.shown_name(student)))


def case_of(flight: SimulatedFlight) -> Case:
    """Return a flight as its student has it, read from files, with its truth."""
    with tempfile.TemporaryDirectory(prefix="acx4-lab-") as temporary:
        folder = Path(temporary) / "flight"
        with naming(folder):
            write_files(flight, folder)
        return Case(read(folder), flight.truth)
