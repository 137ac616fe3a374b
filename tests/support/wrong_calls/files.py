"""Files, results and the simulator, which has words of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import acx4sim
from acx4files import flight
from acx4files.results import folder
from acx4lib.errors import FlightError
from acx4sim.files import photograph
from acx4sim.plan import GrossErrors, SlowErrors
from support.wrong_calls.material import Wrong, flown, names, no_results

NOWHERE = "/nowhere/at/all"


def files() -> list[Wrong]:
    here = Path(__file__)
    table = {"parameters": no_results().parameters}
    return [
        Wrong(
            lambda: folder.read(NOWHERE),
            "/nowhere/at/all: no such folder; expected the results of a run",
            FlightError,
        ),
        Wrong(
            lambda: folder.read(here),
            "files.py: not a folder; expected the results of a run",
            FlightError,
        ),
        Wrong(lambda: folder.read(""), "folder: expected a path, got ''"),
        Wrong(lambda: folder.read(None), "folder: expected a path, got None"),
        Wrong(lambda: flight.read(NOWHERE), "/nowhere/at/all", FlightError),
        Wrong(lambda: flight.read(here), "files.py", FlightError),
        Wrong(lambda: flight.read(None), "path: expected a path, got None"),
        Wrong(
            lambda: folder.rows(no_results(), "parameter", "mounting"),
            "table: expected one of parameters, .*, got 'parameter'",
        ),
        Wrong(
            lambda: folder.rows(no_results(), "parameters", "mountings"),
            "stage: expected one of heads, .*, got 'mountings'",
        ),
        Wrong(
            lambda: folder.rows(no_results(), "parameters", "mounting"),
            "no results of mounting; run stage mounting first",
            FlightError,
        ),
        Wrong(
            lambda: folder.has(no_results(), "single_step"),
            "stage: expected one of heads, .*, got 'single_step'",
        ),
        Wrong(
            lambda: folder.has(NOWHERE, "mounting"),
            "results: expected a Results, got '/nowhere/at/all'",
        ),
        Wrong(
            lambda: folder.replace(NOWHERE, "mounting", tables={}, summary={}),
            names("stage_methods", "the text 'mounting'"),
        ),
        Wrong(
            lambda: folder.replace(NOWHERE, ["mountings"], tables=table, summary={}), "mountings"
        ),
    ]


def invented() -> list[Wrong]:
    options = acx4sim.Options
    return [
        Wrong(
            lambda: acx4sim.simulate("acx5", NOWHERE),
            "name must be one of acx4, acx4-ideal, single-head, got 'acx5'",
        ),
        Wrong(lambda: acx4sim.acx4(seed=-1), "seed must be zero or positive, got -1"),
        Wrong(lambda: acx4sim.acx4(seed=1.5), "seed must be a whole number, got 1.5"),
        Wrong(lambda: acx4sim.acx4(seed="1"), "seed must be a whole number, got '1'"),
        Wrong(lambda: options(blocks="heads"), "blocks must be a tuple of names, got 'heads'"),
        Wrong(lambda: acx4sim.acx4(options=options(blocks=("head",))), "blocks .*head"),
        Wrong(lambda: options(image_noise=np.inf), "image_noise must be finite, got inf"),
        Wrong(lambda: options(image_noise="1"), "image_noise must be a number, got '1'"),
        Wrong(lambda: options(gnss_shift_m=0.5), "gnss_shift_m must be three numbers, got 0.5"),
        Wrong(
            lambda: options(gnss_shift_m=(0.5, 0.5)),
            r"gnss_shift_m must be three numbers, got \(0.5, 0.5\)",
        ),
        Wrong(
            lambda: options(gnss_drift_m_per_min=(0.0, np.nan, 0.0)),
            "gnss_drift_m_per_min must be three numbers",
        ),
        Wrong(lambda: options(tie_points={"heads": 10.5}), "tie_points"),
        Wrong(lambda: options(refraction="ICAO"), "refraction is 'none' or 'standard', got 'ICAO'"),
        Wrong(
            lambda: GrossErrors(image_points=5), "image_points must be a share from 0 to 1, got 5"
        ),
        Wrong(lambda: GrossErrors(gnss_m=np.nan), "gnss_m must be a finite number, got nan"),
        Wrong(lambda: SlowErrors(gnss=95), "gnss must be a share from 0 to 1, got 95"),
        Wrong(
            lambda: photograph(flown(), "C1-01"),
            "exposures must be a sequence of names, got 'C1-01'",
        ),
        Wrong(lambda: photograph(flown(), ["X1-01"]), "X1-01"),
        Wrong(lambda: photograph(flown(), ["C1-01"], reduce=0), "0"),
    ]
