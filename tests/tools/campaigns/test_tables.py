"""Tables of a comparison: their rows, and numbers that must agree with each other."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.stability import FTest, Rigidity
from acx4lib.least_squares.statistics import holm
from acx4tools.campaigns import tables
from acx4tools.campaigns.comparison import compare, differences, ground_of


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
        tables.differences(compared, found, ground_of(compared, height_m=h))
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
    assert list(tables.trends(two).columns) == list(tables.SLOPES)


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
