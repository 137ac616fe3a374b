"""Find the true heads of the simulated system (run by hand).

Table 1 prints what a self-calibration with f held at 74 mm gives; Table 3 what a single step makes
of synthetic images. Starting from the constants in `acx4sim.optics`, this script changes
the heads until exact data of seed 1 give Table 1's omega, phi, kappa, x_p, y_p, k1, p1, p2 and Zc
and, measured in the heads, transferred into the synthetic image and adjusted in a single step,
Table 3's f. It prints the new constants:

    PYTHONPATH=src:tests python -m benchmarks.find_head_truth
"""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

import acx4sim
from acx4book.paper import printed
from acx4files.flight.reader import Flight
from acx4files.stages.synthetic import refine
from acx4lib.block import Block
from acx4lib.calibration import mounting
from acx4lib.calibration.heads import RelativeOrientation, calibrate_heads, relative_orientation
from acx4lib.model import Model
from acx4lib.synthetic_image.transferred_points import synthetic_block, transfer
from acx4sim import optics
from acx4sim.optics import Camera
from support.flights.simulated import EXACT, HEADS, read_back

LENS = ("xp_mm", "yp_mm", "k1", "p1", "p2")
ANGLES = ("omega_deg", "phi_deg", "kappa_deg")
SEEN = np.array([1, 1, 1e-6, 1e-6, 1e-6, 1, 0.01, 0.01, 0.01])
"""Units in which changes count: mm, 1e-6, degrees by what they move at the corner."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """What exact data of the closed chain give: Table 1's orientation, and the single step."""

    orientation: RelativeOrientation
    single_step: mounting.Mounting


def calibrated_heads(flight: Flight) -> RelativeOrientation:
    """Return the relative orientation of a flight's heads."""
    heads = calibrate_heads(flight.heads, HEADS, Model(free=flight.estimate_heads))
    return relative_orientation(heads, flight.cameras["SYN"])


def chain(flight: Flight) -> Chain:
    """Calibrate the heads, carry the calibration block through them, and adjust it."""
    orientation = calibrated_heads(flight)
    refined = refine(flight, orientation, None).orientation
    return Chain(orientation=orientation, single_step=single_step(flight, refined))


def single_step(flight: Flight, heads: RelativeOrientation) -> mounting.Mounting:
    """Carry the calibration block through the heads, and adjust it."""
    return mounting.single_step(transferred(flight, heads), Model(free=flight.estimate_mounting))


def mountings(flight: Flight, heads: RelativeOrientation) -> mounting.Mountings:
    """Do what `single_step` does by all methods."""
    return mounting.calibrate(transferred(flight, heads), Model(free=flight.estimate_mounting))


def transferred(flight: Flight, heads: RelativeOrientation) -> Block:
    """Return the calibration block as its synthetic images have it."""
    block, synthetic = flight.calibration, flight.cameras["SYN"]
    return synthetic_block(block, transfer(block, heads, synthetic), synthetic)


def exact_chain(heads: Mapping[str, Camera] = optics.HEADS) -> Chain:
    """Return the chain of exact data of seed 1, measured by heads of any truth."""
    return chain(exact_flight(heads))


def exact_flight(
    heads: Mapping[str, Camera], blocks: tuple[str, ...] = ("heads", "calibration")
) -> Flight:
    """Return a flight of exact data of seed 1, measured by heads of any truth."""
    with true_heads(heads):
        simulated = acx4sim.acx4(seed=1, options=acx4sim.Options(blocks=blocks, **EXACT))
    return read_back(simulated).flight


@contextmanager
def true_heads(heads: Mapping[str, Camera]) -> Iterator[None]:
    """Simulate with other heads for a while."""
    before = optics.HEADS
    optics.HEADS = MappingProxyType(dict(heads))
    try:
        yield
    finally:
        optics.HEADS = before


def missing_to_table_1(of: RelativeOrientation) -> dict[str, np.ndarray]:
    """Return Table 1 less what was found: xp, yp, k1, p1, p2, Zc, omega, phi, kappa of every head.

    Units are those of the table.
    """
    missing = {}
    for k, name in enumerate(HEADS):
        interior = of.heads[k].interior
        lens = [interior.xp, interior.yp, interior.k1, interior.p1, interior.p2]
        values = np.r_[lens, of.xyz_mm[k, 2], np.degrees(of.opk[k])]
        target = [printed.value(1, key, name) for key in (*LENS, "Zc_mm", *ANGLES)]
        missing[name] = target - values
    return missing


def moved(head: Camera, change: np.ndarray, *, f_mm: float) -> Camera:
    """Return a head changed by what Table 1 misses; `f_mm` is added to its focal length.

    With f held, a head rises in proportion to 1 / f.
    """
    return replace(
        head,
        f_mm=float(head.f_mm * (1 - change[5] / 74.0) + f_mm),
        boresight_deg=tuple(map(float, head.boresight_deg + change[6:])),
        **{key: float(getattr(head, key) + d) for key, d in zip(LENS, change, strict=False)},
    )


def find(f_mm: float) -> dict[str, Camera]:
    """Return the heads that give Table 1 and a single step with focal length `f_mm`."""
    heads = dict(optics.HEADS)
    for _ in range(12):
        found = exact_chain(heads)
        missing = missing_to_table_1(found.orientation)
        missing_f = f_mm - found.single_step.calibration.cameras[0].interior.f
        sys.stdout.write(f"largest change {largest(missing):.1e}, of f {missing_f:.1e} mm\n")
        if largest(missing) < 2e-6 and abs(missing_f) < 1e-6:  # files hold pixels to a millionth
            break
        heads = {name: moved(heads[name], missing[name], f_mm=missing_f) for name in HEADS}
    return heads


def largest(missing: Mapping[str, np.ndarray]) -> float:
    """Return the largest change that Table 1 asks for, in units of `SEEN`."""
    return max(np.abs(change / SEEN).max() for change in missing.values())


def main() -> None:
    """Find the heads and print their constants."""
    for name, head in find(printed.value(3, "f_mm", "single_step")).items():
        constants = {key: getattr(head, key) for key in ("f_mm", *LENS)}
        told = ", ".join(f"{key}={value:.10g}" for key, value in constants.items())
        angles = ", ".join(f"{angle:.9f}" for angle in head.boresight_deg)
        sys.stdout.write(f"{name}: {told}, boresight_deg=({angles})\n")


if __name__ == "__main__":
    main()
