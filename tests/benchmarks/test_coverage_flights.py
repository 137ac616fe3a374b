"""What `make coverage` writes of a flight is what the acceptance tests compute of it."""

import json

import numpy as np
import pandas as pd
import pytest

from benchmarks import coverage_flights
from support.flights import simulated


@pytest.fixture(scope="module")
def found():
    parameters, points = coverage_flights.errors(1)
    return pd.DataFrame(parameters), pd.DataFrame(points)


def of(table, method):
    return table[table["method"] == method]


@pytest.mark.parametrize("method", ["two_step", "two_step_gnss", "single_step"])
def test_errors_are_those_of_the_method(found, method):
    rows = of(found[0], method)
    expected = simulated.mounting_errors("acx4-ideal", method, seed=1)
    assert rows["error"].tolist() == expected.tolist()
    cov = simulated.mounting_estimates("acx4-ideal", method, seed=1).cov
    assert rows["sigma"].to_numpy() == pytest.approx(np.sqrt(np.diag(cov)))


def test_squares_of_independent_errors_add_up_to_the_joint_chi_square(found):
    rows = of(found[0], "single_step")
    errors = simulated.mounting_errors("acx4-ideal", "single_step", seed=1)
    cov = simulated.mounting_estimates("acx4-ideal", "single_step", seed=1).cov
    total, n = simulated.chi_square(errors, cov)
    assert n == len(rows) == 14
    # the closest correlations leave 1e-6 of the digits
    assert np.sum(rows["decorrelated"] ** 2) == pytest.approx(total, rel=1e-6)


def test_points_are_the_differences_from_all_rays(found):
    rows = of(found[1], "single_step")
    checked = simulated.validations("acx4-ideal", seed=1)["single_step"]
    assert rows["d_height_m"].tolist() == checked.points.d[:, 2].tolist()
    assert rows["sigma_east_m"].tolist() == checked.points.sigma[:, 0].tolist()
    assert rows["point"].is_unique


def test_files_are_replaced_whole_or_not_at_all(tmp_path, found):
    parameters, points = (table.to_dict("records") for table in found)
    coverage_flights.write(tmp_path, parameters, points, {"commit": "old"})
    assert json.loads((tmp_path / "coverage.json").read_text())["commit"] == "old"
    with pytest.raises(TypeError):
        coverage_flights.write(tmp_path, [], [], {"commit": object()})  # cannot be written
    read = pd.read_csv(tmp_path / "coverage_points.csv")
    assert read["d_north_m"].to_numpy() == pytest.approx(found[1]["d_north_m"], rel=1e-4)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "coverage.json",
        "coverage_parameters.csv",
        "coverage_points.csv",
    ]
