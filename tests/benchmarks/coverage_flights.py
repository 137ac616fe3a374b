"""Calibrate simulated flights and note every error beside its sigma (``make coverage``).

Mountings and heads of 200 flights, and what is left of the mounting's errors in 250 pairs of
flights, of noise and its negative; mountings of 200 flights with slow errors. The flights are
those of the designs with default options; the seeds, from 1 on, were fixed before any of them was
flown. Each is written to disk and read as any other flight. The results replace those in
data/benchmarks when all are there. Needs PYTHONPATH=tests.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import acx4sim
from acx4book.chapters import weights
from acx4book.command.runs import executor
from acx4book.notebooks.simulated import fly_and_read
from acx4files.flight.reader import Flight
from acx4files.results.folder import RELATIVE
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.calibration import estimates, mounting
from acx4lib.expected import Array
from acx4lib.geometry.collinearity import DISTORTION_AT
from acx4lib.georeferencing import validation
from acx4lib.least_squares.processors import as_finished
from acx4lib.model import Model
from acx4sim.plan import SlowErrors
from benchmarks import harness
from support.flights import simulated

OUT = harness.OUT
DESIGN = "acx4-ideal"
HEADS_DESIGN = "acx4"
N_FLIGHTS, N_PAIRS = 200, 250
VALIDATED = ("two_step", "single_step")
"""Methods that recover the truth; two_step_gnss holds a lever arm that is not the true one."""

DIGITS = 4
"""Of the numbers written down."""

Row = dict[str, Any]
Tables = dict[str, list[Row]]


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=N_FLIGHTS, help=f"seeds 1 to {N_FLIGHTS}")
    parser.add_argument("--pairs", type=int, default=N_PAIRS, help=f"seeds 1 to {N_PAIRS}")
    parser.add_argument("--jobs", type=int, default=2, help="seeds at a time")
    parser.add_argument(
        "--only", choices=("coverage", "slow_errors"), help="one of the files alone"
    )
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options = parser.parse_args()
    harness.refuse_changes(options.out)
    about = harness.about()
    about |= {"design": DESIGN, "heads_design": HEADS_DESIGN}
    n, m = options.flights, options.pairs
    files = {"coverage": ((mountings, n), (heads, n), (pair, m)), "slow_errors": ((slowly, n),)}
    with executor(options.jobs, None) as pool:
        for file in [options.only] if options.only else files:
            tables: Tables = {}
            for study, number in files[file]:
                for found in flown(pool, study, number):
                    for name, rows in found.items():
                        tables.setdefault(name, []).extend(rows)
            write(options.out, file, tables, about)


def flown(pool: Executor, study: Callable[[int], Tables], n: int) -> list[Tables]:
    """Return what a study finds with the seeds 1 to n, in their order.

    Raises
    ------
    RuntimeError
        Seeds failed: it names all of them.
    """
    found: dict[int, Tables] = {}
    failed: dict[int, BaseException] = {}
    for seed, call in as_finished(pool, study, range(1, n + 1)):
        error = call.exception()
        if error is None:
            found[seed] = call.result()
        else:
            failed[seed] = error
        sys.stderr.write(f"\r{study.__name__}: {len(found)} of {n}" + "\n" * (len(found) == n))
    if failed:
        msg = "; ".join(f"seed {seed}: {failed[seed]}" for seed in sorted(failed))
        raise RuntimeError(msg)
    return [found[seed] for seed in sorted(found)]


# --- mountings -------------------------------------------------------------------------------


def mountings(seed: int) -> Tables:
    """Return the errors of one flight: of the mounting's parameters, and at validation points."""
    flown = simulated.fly(DESIGN, seed=seed).flight
    found = mounting.calibrate(flown.calibration, Model(free=flown.estimate_mounting))
    if found.failures:
        msg = f"seed {seed}: {found.failures}"
        raise RuntimeError(msg)
    parameters: list[Row] = []
    points: list[Row] = []
    for method, outcome in found.methods.items():
        named = {"seed": seed, "method": method}
        parameters += [named | row for row in of_parameters(outcome.calibration, method, seed)]
        if method in VALIDATED:
            checked = validation.validate(flown.validation, outcome.calibration, method=method)
            points += [named | row for row in of_points(checked)]
    return {"parameters": parameters, "points": points}


def of_parameters(calibration: estimates.Calibration, method: str, seed: int) -> list[Row]:
    """Return error, a priori sigma and independent error of every parameter of the mounting.

    Errors are against the truth; those of a method that cannot meet it against what the method
    gives on exact data of the same flight.
    """
    found = simulated.of_calibration(calibration)
    names = [name.split()[1] for name in found.names]
    if method in VALIDATED:
        true = dict(zip(simulated.MOUNTING_NAMES, simulated.true_mounting(DESIGN), strict=True))
        expected = np.array([true[name] for name in names])
    else:
        exact = simulated.exact_calibration(DESIGN, method, seed=seed)
        expected = simulated.of_calibration(exact).values  # noqa: PD011 no table
    error = found.values - expected  # noqa: PD011 no table
    return normalised(names, error, found.cov)


def normalised(
    names: Sequence[str], error: Array, cov: Array, *, follow: Sequence[str] = ()
) -> list[Row]:
    """Return error, sigma, and the errors made independent, of every parameter.

    The independent ones are left-multiplied by the inverse of the Cholesky root of the joint
    covariance matrix. Those named in `follow` follow from the others and have none.
    """
    sigma = np.sqrt(np.diag(cov))
    own = ~np.isin(names, follow)
    root = np.linalg.cholesky((cov / sigma[:, None] / sigma)[np.ix_(own, own)])
    decorrelated = np.full(len(names), np.nan)
    decorrelated[own] = np.linalg.solve(root, (error / sigma)[own])
    columns = zip(names, error, sigma, decorrelated, strict=True)
    return [{"parameter": n, "error": e, "sigma": s, "decorrelated": d} for n, e, s, d in columns]


def of_points(checked: validation.Validation) -> list[Row]:
    """Return differences and sigma of the validation points, one of each from all its rays."""
    block, points = checked.block, checked.points
    names = [block.points[i] for i in block.check.point_idx[points.point_idx]]
    axes = ("east_m", "north_m", "height_m")
    keys = [f"{what}_{axis}" for what in ("d", "sigma") for axis in axes]
    rows = np.hstack([points.d, points.sigma])
    return [
        {"point": name, **dict(zip(keys, row, strict=True))}
        for name, row in zip(names, rows, strict=True)
    ]


# --- errors that change slowly ---------------------------------------------------------------


def slowly(seed: int) -> Tables:
    """Return the errors of the single step of a flight whose trajectory's errors change slowly.

    Once it takes them for independent, and once with the weights of their correlation.
    """
    flown = fly_and_read(DESIGN, seed, weights.SLOW)
    blocks = {"white": flown.block, "correlated": weights.modelled(flown.block, SlowErrors())}
    rows: list[Row] = []
    for kind, block in blocks.items():
        bundle = adjust(mounted_orientation(block, Model(free=flown.flight.estimate_mounting)))
        found = simulated.of_calibration(estimates.from_bundle(bundle))
        error = found.values - simulated.true_mounting(DESIGN)  # noqa: PD011 no table
        named = {"seed": seed, "weights": kind}
        rows += [named | row for row in normalised(simulated.MOUNTING_NAMES, error, found.cov)]
    return {"": rows}


# --- heads -----------------------------------------------------------------------------------


def heads(seed: int) -> Tables:
    """Return the errors of the heads' relative orientation of one flight.

    Errors are against what exact data of the same flight give, with f held at the same wrong
    value. Sigma is a posteriori, as reported. The first head's Zc is held with its f.
    """
    method = "relative_orientation"
    found = simulated.head_estimates(seed=seed)[method]
    names = [f"{head} {name}" for head in simulated.HEADS for name in RELATIVE]
    to_reported = np.tile([1.0, 1.0, 1.0, *np.degrees([1.0, 1.0, 1.0])], len(simulated.HEADS))
    free = found.sigma > 0
    rows = normalised(
        np.array(names)[free],
        (to_reported * simulated.head_errors(method, seed=seed))[free],
        (to_reported[:, None] * found.cov * to_reported)[np.ix_(free, free)],
        # Xc and Yc are counted from the mean of all heads
        follow=[f"{simulated.HEADS[-1]} {name}" for name in RELATIVE[:2]],
    )
    return {"heads": [{"seed": seed, "method": method} | row for row in rows]}


# --- pairs -----------------------------------------------------------------------------------


def pair(seed: int) -> Tables:
    """Return what is left of the single step's errors in the mean of noise and its negative.

    In it every error in proportion to the noise cancels; a bias grows with its square, and stays.
    """
    flown = [of_sign(sign, seed) for sign in (1.0, -1.0)]
    rows: list[Row] = []
    for where in DISTORTION_AT:
        found = [simulated.of_calibration(single_step(f, distortion_at=where)) for f in flown]
        error = np.mean([of_one.values for of_one in found], axis=0)  # noqa: PD011 no table
        error -= simulated.true_mounting(DESIGN)
        sigma = np.mean([np.sqrt(np.diag(of_one.cov)) for of_one in found], axis=0)
        named = {"seed": seed, "distortion_at": where}
        rows += [
            named | {"parameter": n, "error": e, "sigma": s}
            for n, e, s in zip(simulated.MOUNTING_NAMES, error, sigma, strict=True)
        ]
    return {"bias": rows}


def of_sign(sign: float, seed: int) -> Flight:
    """Return the flight of a seed with all its noise times a sign."""
    noise = dict.fromkeys(simulated.EXACT, sign)
    options = acx4sim.Options(blocks=("calibration",), **noise)
    return simulated.read_back(acx4sim.DESIGNS[DESIGN](seed=seed, options=options)).flight


def single_step(flown: Flight, *, distortion_at: str) -> estimates.Calibration:
    """Calibrate as `mounting.single_step`, distortion at adjusted or measured image points."""
    bundle = adjust_rejecting(
        flown.calibration,
        lambda b: replace(
            mounted_orientation(b, Model(free=flown.estimate_mounting)), distortion_at=distortion_at
        ),
    )
    return estimates.from_bundle(bundle)


# --- files -----------------------------------------------------------------------------------


def write(folder: Path, name: str, tables: Tables, about: dict[str, Any]) -> None:
    """Write a file for every table and one about them, and only then replace older ones."""
    frames = {part: pd.DataFrame(rows) for part, rows in tables.items()}
    harness.write(folder, name, frames, about, digits=DIGITS)


if __name__ == "__main__":
    main()
