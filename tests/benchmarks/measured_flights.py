"""Measure simulated pictures of several flights, and note every error beside its sigma.

The flights are those of the chapter on pictures, seeds from 1 on; ``make coverage`` runs this.
Needs PYTHONPATH=tests.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import pandas as pd

from acx4book.chapters import from_pictures
from acx4lib.calibration.estimates import parameters
from benchmarks import harness

OUT = harness.OUT
SEEDS = 6
DIGITS = 6
"""Of the numbers written down."""


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=SEEDS, help=f"seeds 1 to this ({SEEDS})")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options = parser.parse_args()
    harness.refuse_changes(options.out)
    rows: list[dict[str, Any]] = []
    for seed in range(1, options.flights + 1):
        rows += of_seed(seed)
        sys.stderr.write(f"\r{seed} of {options.flights} flights")
    about = harness.about()
    about |= {"reduce": from_pictures.REDUCE, "pictures": len(from_pictures.EXPOSURES)}
    harness.write(options.out, "measured_flights", {"": pd.DataFrame(rows)}, about, digits=DIGITS)


def of_seed(seed: int) -> list[dict[str, Any]]:
    """Return error and sigma of every parameter of a flight that is measured in its pictures."""
    found, mounting = from_pictures.measured(seed)
    factor = mounting.bundle.solution.sigma0_sq
    return [
        {
            "seed": seed,
            "parameter": p.name,
            "error": p.value - true,
            "sigma": p.sigma,
            "sigma0_squared": factor,
        }
        for p, true in zip(parameters(mounting.calibration), found.truth(mounting), strict=True)
    ]


if __name__ == "__main__":
    main()
