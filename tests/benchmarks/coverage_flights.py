"""Calibrate 200 simulated flights and note every error beside its sigma (``make coverage``).

The flights are those of the design `acx4-ideal` with its default options; their seeds, 1 to 200,
were fixed before any of them was flown. Each is written to disk and read as any other flight.
The results replace those in data/benchmarks when all are there. Needs PYTHONPATH=tests.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4lib.calibration import mounting
from acx4lib.georeferencing import validation
from benchmarks import machine
from support.flights import simulated

OUT = machine.ROOT / "data" / "benchmarks"
DESIGN = "acx4-ideal"
SEEDS = range(1, 201)
VALIDATED = ("two_step", "single_step")
"""Methods that recover the truth; two_step_gnss holds a lever arm that is not the true one."""

DIGITS = 5
"""Of the numbers written down."""

Row = dict[str, Any]


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=len(SEEDS), help="use seeds 1 to this (200)")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options = parser.parse_args()
    seeds = SEEDS[: options.seeds]
    parameters: list[Row] = []
    points: list[Row] = []
    with ProcessPoolExecutor(options.processes) as pool:
        for seed, found in zip(seeds, pool.map(errors, seeds), strict=True):
            parameters += found[0]
            points += found[1]
            sys.stderr.write(f"\r{seed} of {len(seeds)} flights")
    about = {key: value for key, value in machine.described(None).items() if "ceres" not in key}
    about |= {"design": DESIGN, "first_seed": seeds[0], "last_seed": seeds[-1]}
    write(options.out, parameters, points, about)


def errors(seed: int) -> tuple[list[Row], list[Row]]:
    """Return the errors of one flight: of parameters, and at validation points."""
    flown = simulated.fly(DESIGN, seed=seed).flight
    found = mounting.calibrate(flown.calibration, free=flown.estimate_mounting)
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
    return parameters, points


def of_parameters(calibration: Any, method: str, seed: int) -> list[Row]:
    """Return error, sigma, and the errors made independent, of every parameter.

    Errors are against the truth; those of a method that cannot meet it against what the method
    gives on exact data of the same flight. Sigma is a priori. The decorrelated errors are those
    left-multiplied by the inverse of the Cholesky root of the joint covariance matrix.
    """
    found = simulated.of_calibration(calibration)
    if method in VALIDATED:
        true = dict(zip(simulated.MOUNTING_NAMES, simulated.true_mounting(DESIGN), strict=True))
        expected = np.array([true[name.split()[1]] for name in found.names])
    else:
        exact = simulated.exact_calibration(DESIGN, method, seed=seed)
        expected = simulated.of_calibration(exact).values  # noqa: PD011 no table
    error = found.values - expected  # noqa: PD011 no table
    sigma = np.sqrt(np.diag(found.cov))
    root = np.linalg.cholesky(found.cov / sigma[:, None] / sigma)
    decorrelated = np.linalg.solve(root, error / sigma)
    columns = zip(found.names, error, sigma, decorrelated, strict=True)
    return [
        {"parameter": name.split()[1], "error": e, "sigma": s, "decorrelated": d}
        for name, e, s, d in columns
    ]


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


def write(folder: Path, parameters: list[Row], points: list[Row], about: dict[str, Any]) -> None:
    """Write the three files, and only then put them in the place of older ones."""
    folder.mkdir(parents=True, exist_ok=True)
    about = {"date": datetime.now(UTC).date().isoformat(), **about}
    with tempfile.TemporaryDirectory(dir=folder) as fresh:
        for name, rows in (("parameters", parameters), ("points", points)):
            pd.DataFrame(rows).to_csv(
                Path(fresh, f"coverage_{name}.csv"), index=False, float_format=f"%.{DIGITS}g"
            )
        text = json.dumps(about, indent=2) + "\n"
        Path(fresh, "coverage.json").write_text(text, encoding="utf-8")
        for made in sorted(Path(fresh).iterdir()):
            made.replace(folder / made.name)
    sys.stderr.write(f"\n{folder / 'coverage.json'}\n")


if __name__ == "__main__":
    main()
