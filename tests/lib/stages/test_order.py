"""The stages one after the other on a flight, without notebooks and without the book."""

import subprocess
import sys

import pytest

import acx4sim
from acx4lib import flight as flights
from acx4lib.errors import FlightError
from acx4lib.results import folder
from acx4lib.stages import mounting, order, validation

NEEDLESS = ("acx4book", "acx4sim", "matplotlib", "papermill", "nbformat")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)
    return path


@pytest.fixture(scope="module")
def flight(path):
    return flights.read(path)


def test_results_of_the_mounting_are_what_the_validation_takes(flight, tmp_path):
    calibrated = mounting.run(flight, tmp_path)
    assert calibrated.block is flight.calibration  # weights as given
    assert not calibrated.sigma_factors
    checked = validation.run(flight, tmp_path)
    assert set(checked.calibrations) == set(calibrated.mountings.methods)
    keys = {f"mounting/{m}" for m in calibrated.mountings.methods}
    keys |= {f"validation/{v.method}" for v in checked.validations}
    assert set(folder.read(tmp_path).summary) == keys


def test_a_validation_without_a_calibration_says_what_to_run(flight, tmp_path):
    with pytest.raises(FlightError, match="run stage mounting first"):
        validation.run(flight, tmp_path)


def test_what_a_flight_does_not_have_is_said(flight):
    reasons = {stage: order.missing(flight, stage) for stage in ("heads", "mounting", "rig")}
    assert reasons == {
        "heads": "the flight has no block heads",
        "mounting": "",
        "rig": order.NO_RIG,
    }
    assert order.missing(flight, "validation") == ""


def test_the_stages_need_neither_the_book_nor_plotting():
    code = (
        "import sys; from acx4lib.stages import heads, mounting, order, rig, synthetic, validation;"
        f"print(*sorted({set(NEEDLESS)!r} & set(sys.modules)))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == ""
