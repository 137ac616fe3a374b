"""What a shift of the trajectory does to a calibration, with and without unknowns for it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pandas as pd

import acx4sim
from acx4book.chapters.beyond.weights.simulated import TIES, Flown, SetUp, fly, single
from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import BORESIGHT
from acx4sim.plan import SlowErrors

SHIFT_M = (0.30, -0.20, 0.15)
"""East, north and height of the shift: what another reference station may make of GNSS."""

SHIFTED = acx4sim.Options(tie_points=TIES, gnss_shift_m=SHIFT_M)
SLOW = acx4sim.Options(tie_points=TIES, slow_errors=SlowErrors())


def _with_shift(block: Block, free: Sequence[str]) -> Network:
    return mounted_orientation(block, free=free, gnss=("shift",))


def _with_lever_arm_held(block: Block, free: Sequence[str]) -> Network:
    return mounted_orientation(block, free=free, free_mount=BORESIGHT, gnss=("shift",))


def _with_drift(block: Block, free: Sequence[str]) -> Network:
    return mounted_orientation(block, free=free, gnss=("shift", "drift"))


KINDS: Mapping[str, tuple[acx4sim.Options, SetUp]] = MappingProxyType(
    {
        "shifted, none": (SHIFTED, single),
        "shifted, shift": (SHIFTED, _with_shift),
        "shifted, shift with lever arm held": (SHIFTED, _with_lever_arm_held),
        "slow, none": (SLOW, single),
        "slow, shift and drift": (SLOW, _with_drift),
    }
)
"""The errors that a flight has, and what of them is unknown."""


def shifted_trajectories(seeds: Iterable[int], *, design: str = "acx4-ideal") -> pd.DataFrame:
    """Compare calibrations with and without a GNSS shift as an unknown, on flights that need it.

    Lever arms that are held are so at their true values.

    Parameters
    ----------
    seeds : iterable of int
        One flight each, and for every kind of error.
    design : str
        Of `acx4sim.DESIGNS`.

    Returns
    -------
    DataFrame
        One row per kind, seed and parameter, as `trajectory_errors` returns it.
    """
    rows = []
    for seed in seeds:
        for kind, (options, set_up) in KINDS.items():
            flown = _at_true_lever_arm(fly(design, seed, options))
            bundle = adjust(set_up(flown.block, flown.flight.estimate_mounting))
            sigma0_sq = bundle.solution.sigma0_sq
            rows += [
                (kind, seed, p.name, p.value - flown.truth[p.name], p.sigma, sigma0_sq)
                for p in parameters(from_bundle(bundle))
            ]
    columns = ["kind", "seed", "parameter", "error", "sigma", "sigma0_squared"]
    return pd.DataFrame(rows, columns=columns)


def _at_true_lever_arm(flown: Flown) -> Flown:
    """Return the flight with its lever arm declared as it is."""
    (camera,) = flown.block.cameras
    lever = np.array([flown.truth[f"lever_{axis}_m"] for axis in "xyz"])
    surveyed = replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=lever))
    return replace(flown, block=replace(flown.block, cameras=(surveyed,)))
