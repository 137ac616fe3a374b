"""Results of one camera, of two years, that several rooms compare."""

import datetime as dt
from dataclasses import replace

import pytest

from acx4book.chapters import stability
from acx4book.chapters.stability import Flown
from acx4book.notebooks import runner
from acx4sim import files
from acx4sim.files import simulate_plan
from acx4sim.plan import Options

WARM = {2021: 8.0, 2024: 32.0}


@pytest.fixture(scope="session")
def folders(tmp_path_factory):
    """Results of two runs of flights with a session, each of another year."""
    at = tmp_path_factory.mktemp("campaigns")
    for year in (2021, 2024):
        flown = Flown(date=dt.date(year, 5, 1), temperature_c=WARM[year])
        options = Options(blocks=("calibration",), tie_points={"calibration": 120})
        flight = simulate_plan(stability.plan_of(flown), year, options)
        session = f"\n[session]\ndate = {flown.date}\ntemperature_c = {flown.temperature_c}\n"
        files.write(replace(flight, toml=flight.toml + session), at / f"flight{year}")
        runner.run(at / f"flight{year}", at / f"year{year}", stages=("mounting",))
    return [at / "year2021", at / "year2024"]
