"""What trajectory errors, wrong sigma and refraction do to a calibration, on simulated flights."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pandas as pd

import acx4sim
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.bundle.variance_components import components
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.calibration.weights import scaled, weighted
from acx4lib.flight import reader as flights
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from acx4sim.plan import SlowErrors

TIES = MappingProxyType({"calibration": 150})
"""Tie points of the simulated blocks: enough for what the trajectory does, and quick."""

EXACT = acx4sim.Options(
    image_noise=0.0, control_noise=0.0, gnss_noise=0.0, attitude_noise=0.0, tie_points=TIES
)

KINDS: Mapping[str, SlowErrors | None] = MappingProxyType({"white": None, "slow": SlowErrors()})
"""Trajectory errors of the same size: independent, or changing slowly."""

MODELLED = "modelled"
"""Kind of the calibrations of slow flights by weights that know the errors to be correlated."""

SetUp = Callable[[Block, Sequence[str]], Network]


@dataclass(frozen=True, kw_only=True, eq=False)
class Flown:
    """A simulated calibration flight and the true values of its camera's parameters."""

    flight: Flight
    block: Block
    truth: Mapping[str, float]


def fly(
    design: str,
    seed: int,
    options: acx4sim.Options = acx4sim.Options(),  # noqa: B008 frozen
) -> Flown:
    """Return a simulated flight as it is read from its files, with its truth."""
    simulated = acx4sim.DESIGNS[design](
        seed=seed, options=replace(options, blocks=("calibration",))
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight"
        acx4sim.write(simulated, path)
        flight = flights.read(path)
    block = flight.blocks["calibration"]
    return Flown(
        flight=flight, block=block, truth=simulated.truth["cameras"][block.cameras[0].name]
    )


def single(block: Block, free: Sequence[str]) -> Network:
    """Set up the single step as it is by default."""
    return mounted_orientation(block, free=free)


def modelled(block: Block, errors: SlowErrors) -> Block:
    """Return the block with the correlation in time that its trajectory's errors have."""
    positions = GaussMarkov(share=errors.gnss, time_constant_s=errors.gnss_constant_s)
    attitudes = GaussMarkov(share=errors.attitude, time_constant_s=errors.attitude_constant_s)
    trajectory = replace(block.trajectory, slow_positions=positions, slow_attitudes=attitudes)
    return replace(block, trajectory=trajectory)


def trajectory_errors(
    seeds: Iterable[int], *, design: str = "acx4-ideal", set_up: SetUp = single
) -> pd.DataFrame:
    """Compare the errors of calibrations with their sigma, for white and for slow noise.

    The flights with slow noise are calibrated twice: as if it were white, and `modelled`.

    Parameters
    ----------
    seeds : iterable of int
        One flight each, and for every kind of noise.
    design : str
        Of `acx4sim.DESIGNS`.
    set_up : callable
        Makes the network of a block and its free interior parameters; by default `single`.

    Returns
    -------
    DataFrame
        One row per kind, seed and parameter: error and a posteriori sigma in the parameter's
        unit, and the variance factor of the adjustment.
    """
    rows = []
    for seed in seeds:
        for kind, slow in KINDS.items():
            flown = fly(design, seed, acx4sim.Options(tie_points=TIES, slow_errors=slow))
            cases = {kind: flown.block}
            if slow is not None:
                cases[MODELLED] = modelled(flown.block, slow)
            for case, block in cases.items():
                bundle = adjust(set_up(block, flown.flight.estimate_mounting))
                rows += _rows(case, seed, bundle, flown.truth)
    columns = ["kind", "seed", "parameter", "error", "sigma", "sigma0_squared"]
    return pd.DataFrame(rows, columns=columns)


def _rows(
    kind: str, seed: int, bundle: Bundle, truth: Mapping[str, float]
) -> list[tuple[str, int, str, float, float, float]]:
    sigma0_sq = bundle.solution.sigma0_sq
    return [
        (kind, seed, p.name, p.value - truth[p.name], p.sigma, sigma0_sq)
        for p in parameters(from_bundle(bundle))
    ]


def height_errors(seed: int, *, design: str = "acx4-ideal") -> pd.DataFrame:
    """Return the height error of every exposure of one flight, for white and for slow noise.

    Returns
    -------
    DataFrame
        Columns kind, exposure (number), strip and error_m.
    """
    height = {
        kind: _heights(fly(design, seed, options))
        for kind, options in {
            "true": EXACT,
            **{k: acx4sim.Options(tie_points=TIES, slow_errors=s) for k, s in KINDS.items()},
        }.items()
    }
    true = height.pop("true")
    parts = [
        true.assign(kind=kind, error_m=found["height_m"] - true["height_m"])
        for kind, found in height.items()
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


def scatter(errors: pd.DataFrame) -> pd.DataFrame:
    """Return how large errors are against their sigma, by kind and parameter.

    Parameters
    ----------
    errors : DataFrame
        As `trajectory_errors` returns it.

    Returns
    -------
    DataFrame
        Columns kind, parameter, rms, sigma (root mean square), ratio and the ratio's own
        standard deviation, 1/sqrt(2 n).
    """
    squared = errors.assign(error=errors["error"] ** 2, sigma=errors["sigma"] ** 2)
    grouped = squared.groupby(["kind", "parameter"], sort=False)
    table = grouped[["error", "sigma"]].mean().pow(0.5).rename(columns={"error": "rms"})
    table["ratio"] = table["rms"] / table["sigma"]
    table["sigma_ratio"] = table["ratio"] / np.sqrt(2 * grouped.size())
    return table.reset_index()


def height_noise(flown: Flown, sigmas_m: Sequence[float]) -> pd.DataFrame:
    """Return the sigma of f and of the lever arm's z for GNSS heights of different sigma.

    Parameters
    ----------
    flown : Flown
    sigmas_m : sequence of float
        Of white noise in height, m; plan keeps the sigma that it has.
    """
    rows = []
    for sigma_m in sigmas_m:
        trajectory = flown.block.trajectory
        sigma = trajectory.sigma_position * [1, 1, 0] + np.array([0.0, 0.0, sigma_m])
        block = replace(flown.block, trajectory=replace(trajectory, sigma_position=sigma))
        bundle = adjust(mounted_orientation(block, free=flown.flight.estimate_mounting))
        # a priori: what such noise would do, whatever the noise of this flight
        unit = np.sqrt(bundle.solution.sigma0_sq)
        found = {p.name: p.sigma / unit for p in parameters(from_bundle(bundle))}
        rows.append((sigma_m, found["f_mm"], found["lever_z_m"]))
    return pd.DataFrame(rows, columns=["gnss_height_m", "sigma_f_mm", "sigma_lever_z_m"])


def wrong_sigma(flown: Flown, wrong: Mapping[str, float]) -> pd.DataFrame:
    """Return what variance components say where the sigma given are wrong.

    Parameters
    ----------
    flown : Flown
        Its sigma are right.
    wrong : mapping of str to float
        By what the sigma of groups are multiplied before anything sees them.

    Returns
    -------
    DataFrame
        One row per group: redundancies, the true factor, the diagnosis of a plain adjustment
        with its sigma, and what iteration makes of it; NaN for a group that keeps its sigma.
    """
    free = flown.flight.estimate_mounting
    given = scaled(flown.block, wrong)
    _, factors = weighted(given, weights="estimated", free=free)
    rows = [
        (
            *(c.group, c.n, c.redundancy, c.effective, 1 / wrong.get(c.group, 1.0)),
            *((c.factor, c.sigma) if c.estimable else (np.nan, np.nan)),
            factors[c.group] if factors[c.group] != 1.0 else np.nan,
        )
        for c in components(adjust(mounted_orientation(given, free=free)))
    ]
    columns = ["group", "n", "redundancy", "effective", "true", "factor", "sigma", "estimated"]
    return pd.DataFrame(rows, columns=columns)


def refraction_effect(design: str = "acx4-ideal", seed: int = 1) -> pd.DataFrame:
    """Return what a flight through air gives when it is adjusted with and without refraction.

    The measurements have no noise, so that a difference is refraction's alone; sigma are those
    of the design's noise.

    Returns
    -------
    DataFrame
        One row per parameter: error with and without the model, and sigma, in its unit.
    """
    flown = fly(design, seed, replace(EXACT, refraction="standard"))
    fits: dict[str, Bundle] = {
        model: adjust(
            mounted_orientation(flown.block, free=flown.flight.estimate_mounting, refraction=model)
        )
        for model in ("standard", "none")
    }
    found = {model: parameters(from_bundle(fit)) for model, fit in fits.items()}
    unit = np.sqrt(fits["none"].solution.sigma0_sq)
    rows = [
        (
            with_model.name,
            with_model.value - flown.truth[with_model.name],
            without.value - flown.truth[without.name],
            without.sigma / unit,
        )
        for with_model, without in zip(found["standard"], found["none"], strict=True)
    ]
    return pd.DataFrame(rows, columns=["parameter", "with_model", "without_model", "sigma"])
