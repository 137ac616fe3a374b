"""A campaign as it is read from results, and as it was made; and folders that have none."""

import json
import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib import flight
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters, reported_covariance
from acx4lib.errors import FlightError
from acx4lib.flight.setup import Session
from acx4lib.results.campaigns import campaign
from acx4lib.results.own_folder.marks import MARK
from support.run_results import leave_results


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return leave_results(tmp_path_factory.mktemp("campaign"))


@pytest.fixture
def spoilt(made, tmp_path):
    shutil.copytree(made[1], tmp_path / "results")
    (tmp_path / "results" / MARK).unlink()  # else any change would be refused
    return tmp_path / "results"


def test_what_is_read_is_what_was_adjusted(made):
    found = campaign.read(made[1])
    flown = flight.read(made[0])
    again = campaign.of_mounting(
        mounting.single_step(flown.calibration, free=flown.estimate_mounting), name="again"
    )
    assert (found.name, found.method, found.redundancy) == (
        "results",
        "single_step",
        again.redundancy,
    )
    for one, other in zip(
        parameters(found.calibration), parameters(again.calibration), strict=True
    ):
        assert (one.name, one.unit) == (other.name, other.unit)
        assert_allclose([one.value, one.sigma], [other.value, other.sigma], rtol=1e-9)
    covs = (reported_covariance(c.calibration) for c in (found, again))
    assert_allclose(*covs, rtol=1e-6, atol=1e-30)
    assert_allclose(found.height_m, again.height_m)
    assert_allclose(found.chi_square_p, again.chi_square_p)
    assert found.session == again.session == Session() or np.isnan(found.session.temperature_c)
    assert len(found.control) == 20
    assert found.flight
    assert campaign.sensors(found) == {"CAM": (11608, 8708, 0.0046)}


def test_another_method_is_read_by_its_name(made):
    assert campaign.read(made[1], method="two_step", name="B").method == "two_step"
    with pytest.raises(ValueError, match="one of single_step"):
        campaign.read(made[1], method="three_step")


def problems(folder, **chosen):
    with pytest.raises(FlightError) as error:
        campaign.read(folder, **chosen)
    return error.value.problems


def test_a_covariance_that_lost_a_row_is_refused(spoilt):
    rows = (spoilt / "covariance.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    lost = next(k for k, row in enumerate(rows) if row.startswith("mounting,single_step")) + 1
    (spoilt / "covariance.csv").write_text("".join(rows[:lost] + rows[lost + 1 :]))
    (line,) = problems(spoilt)
    assert line.endswith("row: 'CAM/xp_mm'; must have a row with row and column exchanged")


def test_results_without_the_method_say_so(made, tmp_path):
    (line,) = problems(made[1], method="rig")
    assert line.endswith("no results of mounting/rig; acx4 run makes them")
    (line,) = problems(tmp_path)
    assert "no results of a run" in line


def test_results_that_contradict_themselves_are_no_campaign(spoilt):
    summary = json.loads((spoilt / "summary.json").read_text())
    summary["mounting/single_step"]["stopped"] = ["GNSS positions contradict"]
    (spoilt / "summary.json").write_text(json.dumps(summary))
    (line,) = problems(spoilt)
    assert line.endswith("no calibration to compare: GNSS positions contradict")


def test_changed_results_are_refused(made, tmp_path):
    folder = tmp_path / "changed"
    shutil.copytree(made[1], folder)
    with (folder / "covariance.csv").open("a") as file:
        file.write("mounting,single_step,a,b,1\n")
    assert any("covariance.csv" in line for line in problems(folder))


def test_a_changed_flight_is_refused(made, tmp_path):
    folder = tmp_path / "changed"
    shutil.copytree(made[1], folder)
    points = folder / "flight" / "calibration" / "image_points.csv"
    points.write_text(points.read_text(encoding="utf-8").replace(",", ",x", 1), encoding="utf-8")
    (line,) = problems(folder)
    assert line.endswith("calibration/image_points.csv changed since the run; run all stages again")
