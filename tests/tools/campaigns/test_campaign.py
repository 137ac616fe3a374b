"""Tables of campaigns, and one campaign."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, stats

from acx4lib import flight
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters, reported_covariance
from acx4lib.calibration.stability import FTest, Rigidity
from acx4lib.errors import FlightError
from acx4lib.flight.settings import Session
from acx4lib.least_squares.statistics import holm
from acx4lib.results.own_folder import MARK
from acx4tools.campaigns import comparison, tables
from acx4tools.campaigns.comparison import (
    JointTest,
    compare,
    differences,
    fit,
    ground_of,
    joint_test,
    same_values,
)
from support.run_results import leave_results

# --- campaign --------------------------------------------------------------------------------
#
# A campaign as it is read from results, and as it was made; and folders that have none.


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return leave_results(tmp_path_factory.mktemp("campaign"))


@pytest.fixture
def spoilt(made, tmp_path):
    shutil.copytree(made[1], tmp_path / "results")
    (tmp_path / "results" / MARK).unlink()  # else any change would be refused
    return tmp_path / "results"


def test_what_is_read_is_what_was_adjusted(made):
    found = comparison.read(made[1])
    flown = flight.read(made[0])
    again = comparison.of_mounting(
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
    assert comparison.sensors(found) == {"CAM": (11608, 8708, 0.0046)}


def test_another_method_is_read_by_its_name(made):
    assert comparison.read(made[1], method="two_step", name="B").method == "two_step"
    with pytest.raises(ValueError, match="one of single_step"):
        comparison.read(made[1], method="three_step")


def problems(folder, **chosen):
    with pytest.raises(FlightError) as error:
        comparison.read(folder, **chosen)
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


# --- Vectors with known covariances: closed forms, SciPy, and dense least squares


SCALES = np.array([1e-3, 1e-8, 1e-14, 0.02])
"""Of standard deviations of a focal length, of k1, of k3, of a lever arm."""


def covariances(rng, n, k=4):
    """Strongly correlated matrices whose units differ by many powers of ten."""
    out = []
    for _ in range(n):
        A = rng.standard_normal((k, 6)) + 3 * rng.standard_normal((1, 6))
        out.append(A @ A.T * SCALES[:k, None] * SCALES[:k])
    return np.array(out)


def test_of_independent_components_chi_square_is_a_sum_of_squares():
    d, sigma = np.array([1.0, -2.0, 0.5]), np.array([1.0, 4.0, 0.5])
    found = joint_test(d, np.diag(sigma**2))
    assert_allclose(found.chi_square, 1.0 + 0.25 + 1.0)
    assert found.dof == 3
    assert_allclose(found.p, stats.chi2.sf(2.25, 3))


def test_with_an_estimated_variance_factor_it_is_fishers(rng):
    d, cov = 10 * SCALES * [1, -1, 1, 1], covariances(rng, 1)[0]
    found = joint_test(d, cov, redundancy=20)
    whitened = linalg.solve_triangular(
        linalg.cholesky(cov / SCALES[:, None] / SCALES, lower=True), d / SCALES, lower=True
    )
    assert_allclose(found.chi_square, whitened @ whitened, rtol=1e-6)
    assert_allclose(found.p, stats.f.sf(found.chi_square / 4, 4, 20))
    assert found.p > joint_test(d, cov).p


def test_nothing_is_no_test():
    assert np.isnan(joint_test(np.zeros(0), np.zeros((0, 0))).p)


def test_the_constant_of_independent_values_is_their_weighted_mean():
    values, sigma = np.array([[5.0], [8.0], [6.0]]), np.array([1.0, 2.0, 0.5])
    found = fit(values, (sigma**2)[:, None, None], np.ones((3, 1)))
    weight = sigma**-2
    mean = weight @ values[:, 0] / weight.sum()
    assert_allclose(found.coefficients, [[mean]])
    assert_allclose(found.cov.ravel(), 1 / weight.sum())
    assert_allclose(found.chi_square, np.sum(weight * (values[:, 0] - mean) ** 2))
    assert found.dof == 2


def test_a_line_of_independent_values_is_that_of_numpy():
    t, y, sigma = np.array([3.0, 8.0, 20.0, 31.0]), np.array([1.0, 2.5, 2.0, 6.0]), 0.3
    found = fit(y[:, None], np.full((4, 1, 1), sigma**2), np.column_stack([np.ones(4), t]))
    line, cov = np.polyfit(t, y, 1, w=np.full(4, 1 / sigma), cov="unscaled")
    assert_allclose(found.coefficients[::-1, 0], line)
    assert_allclose(found.cov[:, 0, :, 0][::-1, ::-1], cov)


def test_with_full_covariances_it_is_dense_least_squares(rng):
    n, k = 5, 4
    covs = covariances(rng, n)
    values = rng.standard_normal((n, k)) * SCALES
    X = np.column_stack([np.ones(n), rng.uniform(-10, 10, n)])
    found = fit(values, covs, X)
    half = [np.linalg.inv(np.linalg.cholesky(C / SCALES[:, None] / SCALES)) for C in covs]
    A = np.concatenate([H @ np.kron(x, np.eye(k)) for H, x in zip(half, X, strict=True)])
    b = np.concatenate([H @ (v / SCALES) for H, v in zip(half, values, strict=True)])
    solved = np.linalg.lstsq(A, b, rcond=None)[0]
    assert_allclose(found.coefficients, solved.reshape(2, k) * SCALES, rtol=1e-6)
    assert_allclose(found.chi_square, np.sum((A @ solved - b) ** 2), rtol=1e-6)
    assert_allclose(found.residuals, X @ found.coefficients - values)
    cov = np.linalg.inv(A.T @ A).reshape(2, k, 2, k) * SCALES[:, None, None] * SCALES
    assert_allclose(found.cov, cov, rtol=1e-5, atol=0)


def test_of_two_vectors_the_constant_tests_their_difference(rng):
    covs = covariances(rng, 2)
    values = rng.standard_normal((2, 4)) * SCALES
    d = joint_test(values[1] - values[0], covs.sum(axis=0))
    assert_allclose(fit(values, covs, np.ones((2, 1))).chi_square, d.chi_square, rtol=1e-6)
    alone = same_values(values, covs)
    t = (values[1] - values[0]) / np.sqrt(np.diagonal(covs.sum(axis=0)))
    assert_allclose([one.chi_square for one in alone], t**2)
    assert {one.dof for one in alone} == {1}


def test_levels_hold_where_the_variance_factor_is_estimated_from_little(rng):
    n, r, k = 4000, 12, 3
    d = rng.standard_normal((n, k))
    s0_sq = rng.chisquare(r, n) / r
    p = [joint_test(x, s * np.eye(k), redundancy=r).p for x, s in zip(d, s0_sq, strict=True)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("dof", [1, 14])
def test_probabilities_are_those_of_the_distribution(dof):
    assert_allclose(JointTest(chi_square=7.0, dof=dof).p, stats.chi2.sf(7.0, dof))


# --- tables of a comparison: their rows, and numbers that must agree with each other ---------


@pytest.fixture
def compared(fly):
    warm = {1: 5.0, 2: 15.0, 3: 30.0}
    return compare([fly(s, f_um=1.5 * t, temperature_c=t) for s, t in warm.items()])


@pytest.fixture
def every(compared):
    found = differences(compared)
    return tables.every(compared, found, ground_of(compared, height_m=1000.0))


def test_every_table_has_its_rows(every):
    assert {name: len(table) for name, table in every.items()} == {
        "campaigns": 3,
        "tests": 1 + 2 + 2 * 3 + 2,
        "differences": 2 * 14,
        "pooled": 14,
        "trends": 14,
        "covariance": 3 * 14 * 14,
    }
    assert set(every["campaigns"]["sigma"]) == {"a posteriori"}


def test_probabilities_are_at_a_joint_level_over_their_rows(every):
    for name in ("differences", "pooled", "trends"):
        assert_allclose(every[name]["p_joint"], holm(every[name]["p"].to_numpy()))
    tests = every["tests"]
    parts = tests[(tests["part"] != "all")]
    assert_allclose(parts["p_joint"], holm(parts["p"].to_numpy()))


def test_differences_tests_and_covariances_agree(every):
    listed, cov = every["differences"], every["covariance"]
    later = listed[listed["later"] == "campaign 2"]
    own = cov[cov["of"] == "campaign 2 - campaign 1"].pivot_table(
        index="row", columns="column", values="value"
    )
    names = "CAM/" + later["parameter"]
    C = own.loc[names, names].to_numpy()
    assert_allclose(np.sqrt(np.diag(C)), later["sigma"])
    d = later["difference"].to_numpy()
    z = d / later["sigma"].to_numpy()
    s = later["sigma"].to_numpy()
    whole = every["tests"].set_index(["test", "part"]).loc[("campaign 2 - campaign 1", "all")]
    assert_allclose(z @ np.linalg.solve(C / s[:, None] / s, z), whole["chi_square"], rtol=1e-6)
    assert whole["dof"] == 14


def test_what_a_focal_length_moves_on_the_ground_grows_with_the_height(compared):
    found = differences(compared)
    by_height = [
        tables.every(compared, found, ground_of(compared, height_m=h))["differences"]
        for h in (500.0, 1000.0)
    ]
    low, high = (table["ground_rms_m"].to_numpy() for table in by_height)
    of_lever = by_height[0]["parameter"].str.startswith("lever").to_numpy()
    assert_allclose(high[of_lever], low[of_lever], rtol=1e-4)
    assert_allclose(high[~of_lever], 2 * low[~of_lever], rtol=2e-3)
    assert ground_of(compared).height_m == 610.0


def test_the_slope_of_the_focal_length_is_significant(every):
    slopes = every["trends"].set_index("parameter")
    assert slopes.loc["f_mm", "unit"] == "mm per °C"
    assert abs(slopes.loc["f_mm", "slope"] - 1.5e-3) < 4 * slopes.loc["f_mm", "sigma"]
    assert slopes.loc["f_mm", "p_joint"] < 1e-3


def test_two_campaigns_have_no_trend(fly):
    two = compare([fly(1, temperature_c=1.0), fly(2, temperature_c=9.0)])
    assert tables.trends_of(two) == {}
    trends = tables.every(two, differences(two), ground_of(two))["trends"]
    assert list(trends.columns) == list(tables.SLOPES)


def test_the_rig_has_a_row_for_each_exposure_and_one_for_all():
    turns = np.radians([[[0, 0, 0], [1, -8, 2]], [[0, 0, 0], [1, 1, 1]]]) / 3600
    sigma = np.radians([[[0, 0, 0], [2, 2, 2]]] * 2) / 3600
    test = FTest(explained=12.0, left=97.0, dof=3, redundancy=97)
    small = FTest(explained=3.0, left=97.0, dof=3, redundancy=97)
    found = tables.rigidity(
        Rigidity(
            heads=("A", "B"),
            exposures=("E1", "E2"),
            turns=turns,
            sigma=sigma,
            tests=(test, small),
            whole=test,
        )
    )
    assert found["exposure"].tolist() == ["E1", "E2", ""]
    assert_allclose(found["f"], [4.0, 1.0, 4.0])
    first = found.iloc[0]
    assert first["head"] == "B"
    assert_allclose([first["turn_arcsec"], first["sigma_arcsec"]], [-8, 2])
    assert_allclose(found["p_joint"][:2], holm(found["p"].to_numpy()[:2]))
    assert isinstance(found, pd.DataFrame)
