"""What errors of the trajectory do to the calibrations of many simulated flights."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from acx4book.notebooks.simulated import flown as flights
from acx4book.notebooks.simulated.flown import Flown, fly
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import Mounting, single_step
from acx4lib.flight.block import Block
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import SHOWN
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from acx4sim.plan import Options, SlowErrors

TIES = MappingProxyType({"calibration": 150})
"""Tie points of the simulated blocks: enough for what the trajectory does, and quick."""

SLOWLY_BY_DEFAULT = SlowErrors()
WHITE = Options(tie_points=TIES)
SLOW = Options(tie_points=TIES, slow_errors=SLOWLY_BY_DEFAULT)
EXACT = replace(flights.EXACT, tie_points=TIES)
"""Errors of a flight: independent ones, as large ones that change slowly, and none."""

SHIFT_M = (0.30, -0.20, 0.15)
"""East, north and height of the shift: what another reference station may make of GNSS."""

SHIFTED = Options(tie_points=TIES, gnss_shift_m=SHIFT_M)

MODELLED = "modelled"
"""Kind of the calibrations of slow flights by weights that know the errors to be correlated."""

DESIGN = "acx4-ideal"


def adjusted(flown: Flown, block: Block | None = None, **how: object) -> Mounting:
    """Return the single step of a simulated flight, without a search for gross errors.

    Parameters
    ----------
    flown : Flown
    block : Block, optional
        In the place of the one that was flown.
    **how
        Further arguments of `single_step`.
    """
    arguments: dict[str, object] = {"free": flown.flight.estimate_mounting, "snooping": False}
    call: Callable[..., Mounting] = single_step
    return call(flown.block if block is None else block, **(arguments | how))


def errors(flown: Flown, mounting: Mounting) -> pd.DataFrame:
    """Return the errors of a calibration beside their standard deviations.

    Parameters
    ----------
    flown : Flown
        Whose truth is known.
    mounting : Mounting
        Its calibration.

    Returns
    -------
    DataFrame
        By ``parameter`` and ``unit``, as `Mounting.table` has them: the error as ``value``, its
        ``sigma``, and ``error / σ``.
    """
    found = parameters(mounting.calibration)
    error = [p.value - flown.truth[p.name] for p in found]
    names = [SHOWN[p.key] for p in found]
    index = pd.MultiIndex.from_tuples(names, names=["parameter", "unit"])
    table = pd.DataFrame({"value": error, "sigma": [p.sigma for p in found]}, index=index)
    table["error / σ"] = table["value"] / table["sigma"]
    table.attrs["formats"] = {"error / σ": "+.1f"}
    return table


def modelled(block: Block, slow: SlowErrors = SLOWLY_BY_DEFAULT) -> Block:
    """Return the block with the correlation in time that its trajectory's errors have."""
    positions = GaussMarkov(share=slow.gnss, time_constant_s=slow.gnss_constant_s)
    attitudes = GaussMarkov(share=slow.attitude, time_constant_s=slow.attitude_constant_s)
    trajectory = replace(block.trajectory, slow_positions=positions, slow_attitudes=attitudes)
    return replace(block, trajectory=trajectory)


def with_height_noise(block: Block, sigma_m: float) -> Block:
    """Return the block with another standard deviation of the GNSS heights."""
    trajectory = block.trajectory
    sigma = trajectory.sigma_position * [1, 1, 0] + np.array([0.0, 0.0, sigma_m])
    return replace(block, trajectory=replace(trajectory, sigma_position=sigma))


def surveyed(flown: Flown) -> Block:
    """Return the block of a flight with its lever arm declared as it is."""
    (camera,) = flown.block.cameras
    lever = np.array([flown.truth[f"lever_{axis}_m"] for axis in "xyz"])
    return replace(flown.block, cameras=(replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=lever)),))


# --- many flights ----------------------------------------------------------------------------

Case = Callable[[Flown], Mounting]

SHIFTS: Mapping[str, tuple[Options, Case]] = MappingProxyType(
    {
        "shifted, none": (SHIFTED, adjusted),
        "shifted, shift": (SHIFTED, lambda flown: adjusted(flown, gnss=("shift",))),
        "shifted, shift with lever arm held": (
            SHIFTED,
            lambda flown: adjusted(flown, surveyed(flown), fix=("lever_arm",), gnss=("shift",)),
        ),
        "slow, none": (SLOW, adjusted),
        "slow, shift and drift": (SLOW, lambda flown: adjusted(flown, gnss=("shift", "drift"))),
    }
)
"""The errors that a flight has, and what of them is unknown."""

SLOWLY: Mapping[str, tuple[Options, Case]] = MappingProxyType(
    {
        "white": (WHITE, adjusted),
        "slow": (SLOW, adjusted),
        MODELLED: (SLOW, lambda flown: adjusted(flown, modelled(flown.block))),
    }
)
"""Errors of the same size, and whether the weights know how they change."""


def calibrated(seeds: Iterable[int], cases: Mapping[str, tuple[Options, Case]]) -> pd.DataFrame:
    """Compare the errors of calibrations with their sigma, over flights.

    Parameters
    ----------
    seeds : iterable of int
        One flight each, and for every case.
    cases : mapping of str to (Options, callable)
        By kind: the errors of a flight, and what calibrates it.

    Returns
    -------
    DataFrame
        One row per kind, seed and parameter: error and a posteriori sigma in the parameter's
        unit, and the variance factor of the adjustment.
    """
    rows = []
    for seed in seeds:
        for kind, (options, case) in cases.items():
            flown = fly(DESIGN, seed, options)
            mounting = case(flown)
            sigma0_sq = mounting.bundle.solution.sigma0_sq
            rows += [
                (kind, seed, p.name, p.value - flown.truth[p.name], p.sigma, sigma0_sq)
                for p in parameters(mounting.calibration)
            ]
    columns = ["kind", "seed", "parameter", "error", "sigma", "sigma0_squared"]
    return pd.DataFrame(rows, columns=columns)


def scatter(found: pd.DataFrame) -> pd.DataFrame:
    """Return how large errors are against their sigma, by kind and parameter.

    Parameters
    ----------
    found : DataFrame
        As `calibrated` returns it.

    Returns
    -------
    DataFrame
        Columns kind, parameter, rms, sigma (root mean square), ratio and the ratio's own
        standard deviation, 1/sqrt(2 n).
    """
    squared = found.assign(error=found["error"] ** 2, sigma=found["sigma"] ** 2)
    grouped = squared.groupby(["kind", "parameter"], sort=False)
    table = grouped[["error", "sigma"]].mean().pow(0.5).rename(columns={"error": "rms"})
    table["ratio"] = table["rms"] / table["sigma"]
    table["sigma_ratio"] = table["ratio"] / np.sqrt(2 * grouped.size())
    return table.reset_index()


def spans(ratios: pd.DataFrame, kind: str) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest ratio of boresight and lever arm.

    Parameters
    ----------
    ratios : DataFrame
        As `scatter` returns it.
    kind : str
    """
    own = ratios[ratios["kind"] == kind]
    found = {}
    for what in ("boresight", "lever"):
        ratio = own["ratio"][own["parameter"].str.startswith(what)]
        found[what] = (float(ratio.min()), float(ratio.max()))
    return found


def height_errors(seed: int) -> pd.DataFrame:
    """Return the height error of every exposure of one flight, for white and for slow noise.

    Parameters
    ----------
    seed : int

    Returns
    -------
    DataFrame
        Columns kind, exposure (number), strip and error_m.
    """
    true, white, slow = (_heights(fly(DESIGN, seed, how)) for how in (EXACT, WHITE, SLOW))
    parts = [
        true.assign(kind=kind, error_m=found["height_m"] - true["height_m"])
        for kind, found in (("white", white), ("slow", slow))
    ]
    return pd.concat(parts, ignore_index=True)[["kind", "exposure", "strip", "error_m"]]


def _heights(flown: Flown) -> pd.DataFrame:
    block = flown.block
    strips = dict(zip(block.images.exposure_idx, block.images.strips, strict=True))
    height = block.frame.to_grid(block.trajectory.T_m_b.r)[:, 2]
    numbers = np.arange(len(height))
    return pd.DataFrame(
        {"exposure": numbers + 1, "strip": [strips[i] for i in numbers], "height_m": height}
    )
