"""The flights of the chapter: four cameras, one of them made of four heads."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from acx4lib.calibration.heads import calibrate_heads, relative_orientation
from acx4lib.expected import Array
from acx4lib.flight import reader
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import Camera, Interior, xy_from_colrow
from acx4lib.stages.synthetic import refine
from acx4lib.synthetic_image.carried import carry, synthetic_block
from acx4sim.designs import acx4_plan, single_head_plan
from acx4sim.files import writer
from acx4sim.files.flights import simulate_plan
from acx4sim.plan import Options, Plan

SYMMETRIC, DECENTRED, DENTED, SYNTHETIC = "symmetric", "decentred", "dented", "synthetic"

DENT_UM = 25.0
"""Depth of the dent of the sensor."""

DENT_AT, DENT_SIZE = (0.4, -0.3), 0.35
"""Its middle and its standard deviation, in halves of the sides of the image."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A flight of one camera.

    Attributes
    ----------
    calibration, validation : Block
        Measured by one camera; the control of `validation` is not used.
    """

    calibration: Block
    validation: Block


def read_back(plan: Plan, seed: int, blocks: tuple[str, ...]) -> Flight:
    """Fly a plan and read it as a user's flight."""
    simulated = simulate_plan(plan, seed, Options(blocks=blocks))
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "flight"
        writer.write(simulated, path)
        return reader.read(path)


def symmetric(seed: int) -> Case:
    """Fly a lens with radial distortion alone."""
    plan = single_head_plan()
    cameras = {name: replace(own, p1=0.0, p2=0.0) for name, own in plan.cameras.items()}
    return _single(replace(plan, cameras=cameras), seed)


def decentred(seed: int) -> Case:
    """Fly a lens with radial and decentring distortion."""
    return _single(single_head_plan(), seed)


def dented(seed: int) -> Case:
    """Fly the decentred lens before a sensor with a dent, which no model has."""
    return with_dent(decentred(seed), DENT_UM)


def with_dent(case: Case, depth_um: float) -> Case:
    """Return a case as a sensor with a dent of some depth would have measured it."""
    return Case(
        calibration=_dent(case.calibration, depth_um), validation=_dent(case.validation, depth_um)
    )


def _single(plan: Plan, seed: int) -> Case:
    flight = read_back(plan, seed, ("calibration", "validation"))
    return Case(calibration=flight.blocks["calibration"], validation=flight.blocks["validation"])


def _dent(block: Block, depth_um: float) -> Block:
    points = block.image_points
    shift = dent_px(block.cameras[0], points.colrow, depth_um)
    return replace(block, image_points=replace(points, colrow=points.colrow + shift))


def dent_px(camera: Camera, colrow: Array, depth_um: float) -> Array:
    """Return what a dent of the sensor shifts image points (n, 2), px.

    A ray that meets the sensor deeper by h, at (x, y) from the middle, is farther out by
    h (x, y) / f.
    """
    xy = xy_from_colrow(camera, colrow)
    half_mm = camera.pixel_mm / 2 * np.array([camera.width_px, camera.height_px])
    off = (xy / half_mm - DENT_AT) / DENT_SIZE
    depth_mm = depth_um / 1000 * np.exp(-np.sum(off**2, axis=1) / 2)
    outward: Array = depth_mm[:, None] * xy / camera.interior.f
    return outward / np.array([camera.pixel_mm, -camera.pixel_mm])


def synthetic(seed: int) -> Case:
    """Fly four heads and carry their measurements into one synthetic image."""
    flight = read_back(acx4_plan(), seed, ("heads", "calibration", "validation"))
    camera = flight.cameras["SYN"]
    heads = calibrate_heads(flight.blocks["heads"], flight.head_names, free=flight.estimate_heads)
    oriented = relative_orientation(heads, camera)
    refined = refine(flight, oriented, None).orientation

    def carried(name: str) -> Block:
        block = flight.blocks[name]
        return synthetic_block(block, carry(block, refined, camera), camera)

    return Case(calibration=carried("calibration"), validation=carried("validation"))


def synthetic_camera() -> Camera:
    """Return the synthetic camera as the flight declares it, with an approximate focal length."""
    plan = acx4_plan()
    frame = plan.cameras["SYN"]
    return Camera(
        name="SYN",
        width_px=frame.width_px,
        height_px=frame.height_px,
        pixel_mm=frame.pixel_um / 1000,
        interior=Interior(f=plan.approximate["SYN"]["focal_mm"]),
    )


CASES: Mapping[str, Callable[[int], Case]] = MappingProxyType(
    {SYMMETRIC: symmetric, DECENTRED: decentred, DENTED: dented, SYNTHETIC: synthetic}
)
