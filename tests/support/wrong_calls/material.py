"""What wrong calls are made of."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

import acx4sim
from acx4book.chapters.image_quality import deviations
from acx4files.results import folder as results
from acx4lib.bundle import adjust
from acx4lib.calibration import estimates, mounting
from acx4lib.georeferencing import accuracy, direct
from acx4lib.tie_points import ties as tie_points
from acx4sim.files import SimulatedFlight
from support import blocks
from support.pictures import taken

FREE = ("f", "xp", "yp", "k1")
BLOCK = blocks.standard()
RIG = blocks.standard(cameras=(blocks.CAMERA, replace(blocks.CAMERA, name="SIDE")))
CAMERA, FRAME = blocks.CAMERA, blocks.FRAME
POINTS, IMAGES, CONTROL, TRAJECTORY = (
    BLOCK.image_points,
    BLOCK.images,
    BLOCK.control,
    BLOCK.trajectory,
)
HEADS, SYNTHETIC = taken.printed_heads(), taken.printed_synthetic()
POSES = TRAJECTORY.T_m_b
PICTURE = np.zeros((60, 80, 3), np.uint8)
GREY = np.zeros((60, 80), np.float32)
FOUND = accuracy.from_differences(np.random.default_rng(1).normal(size=(30, 3)))


@cache
def calibrated() -> mounting.Mountings:
    return mounting.calibrate(BLOCK, free=FREE)


def fit() -> adjust.Bundle:
    return calibrated()["single_step"].bundle


def said() -> estimates.Calibration:
    return calibrated()["single_step"].calibration


@cache
def georeferenced() -> direct.Georeferenced:
    return direct.georeference(BLOCK, said())


@cache
def ties() -> tie_points.TiePoints:
    rng = np.random.default_rng(1)
    return deviations.simulated_ties(HEADS, SYNTHETIC, rng=rng, per_overlap=20)


@cache
def flown() -> SimulatedFlight:
    return acx4sim.DESIGNS["single-head"](options=acx4sim.Options(tie_points={"calibration": 10}))


@cache
def no_results() -> results.Results:
    with tempfile.TemporaryDirectory() as folder:
        return results.read(folder)


def spoilt(values: np.ndarray, value: float, row: int = 3) -> np.ndarray:
    """Return values with one of them replaced."""
    out = values.astype(np.result_type(values, value)).copy()
    out[row] = value
    return out


@dataclass(frozen=True)
class Wrong:
    """A wrong call and the answer to it."""

    call: Callable[[], object]
    says: str
    error: type[Exception] = ValueError


# --- answers that many calls get ---------------------------------------------------------------


def expected(what: str) -> Callable[[str, object], str]:
    """Return what makes the answer to an argument of a name that is something else."""
    return lambda name, got: f"{name}: expected {what}, got {got}"


def shape(name: str, wanted: str, got: str) -> str:
    """Return the answer to an array of another shape, as a pattern."""
    return re.sub(r"([()])", r"\\\1", f"{name}: expected shape {wanted}, got {got}")


a_block = expected("a Block")
count = expected("a whole number of 1 or more")
finite = expected("finite numbers")
names = expected("a sequence of names")
not_negative = expected("zero or a positive number")
positive = expected("a positive number")
probability = expected("a probability between 0 and 1")
