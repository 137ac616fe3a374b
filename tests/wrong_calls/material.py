"""What wrong calls are made of."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

import blocks
import printed_camera
from acx4lib import (
    accuracy,
    bundle,
    calibration,
    georeferencing,
    mounting,
    results,
    simulate,
    tie_points,
)
from acx4lib.experiments import synthetic as synthetic_experiments

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
HEADS, SYNTHETIC = printed_camera.heads(), printed_camera.synthetic()
POSES = TRAJECTORY.T_m_b
PICTURE = np.zeros((60, 80, 3), np.uint8)
GREY = np.zeros((60, 80), np.float32)
FOUND = accuracy.from_differences(np.random.default_rng(1).normal(size=(30, 3)))


@cache
def calibrated() -> mounting.Mountings:
    return mounting.calibrate(BLOCK, free=FREE)


def fit() -> bundle.Bundle:
    return calibrated()["single_step"].bundle


def said() -> calibration.Calibration:
    return calibrated()["single_step"].calibration


@cache
def georeferenced() -> georeferencing.Georeferenced:
    return georeferencing.georeference(BLOCK, said())


@cache
def ties() -> tie_points.TiePoints:
    rng = np.random.default_rng(1)
    return synthetic_experiments.simulated_ties(HEADS, SYNTHETIC, rng=rng, per_overlap=20)


@cache
def flown() -> simulate.SimulatedFlight:
    return simulate.single_head(options=simulate.Options(tie_points={"calibration": 10}))


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
