"""A spoilt calibration or validation shows what the text beside it says."""

import numpy as np
import pytest

from acx4book.chapters.mounting.variants import calibrations, correlations
from acx4lib.calibration import mounting


@pytest.fixture(scope="module")
def table(ideal, mountings):
    single, free = mountings["single_step"], ideal.estimate_mounting
    return calibrations(ideal.calibration, single, free=free).set_index("variant")


def test_one_flying_height_does_not_separate_focal_length_and_lever_arm(table):
    lowest, all_heights = table.loc["lowest flying height only"], table.loc["as flown"]
    assert lowest["images"] == 30
    assert lowest["sigma_f_mm"] > 10 * all_heights["sigma_f_mm"]
    assert lowest["sigma_lever_z_m"] > 10 * all_heights["sigma_lever_z_m"]


def test_without_control_the_lever_arms_height_is_open_and_the_rest_is_not(table):
    without, complete = table.loc["without control points"], table.loc["as flown"]
    assert without["sigma_lever_z_m"] > 10 * complete["sigma_lever_z_m"]
    assert without["sigma_lever_x_m"] < 1.2 * complete["sigma_lever_x_m"]


def test_the_map_grid_as_cartesian_bends_the_focal_length_and_not_the_variance(table):
    wrong, right = table.loc["the map grid taken for a Cartesian frame"], table.loc["as flown"]
    # the geodesy note has +0.0083 mm near Curitiba, for another layout
    assert wrong["f_mm"] - right["f_mm"] == pytest.approx(0.0083, abs=0.005)
    assert wrong["sigma0_squared"] == pytest.approx(right["sigma0_squared"], abs=0.01)


def test_as_flown_is_the_single_step_itself_and_is_adjusted_where_there_is_none(
    ideal, mountings, table
):
    block = mountings["single_step"].bundle.network.block
    again = calibrations(block, None, free=ideal.estimate_mounting).set_index("variant")
    np.testing.assert_allclose(
        again.loc["as flown"].astype(float), table.loc["as flown"].astype(float), rtol=1e-6
    )


def test_a_missing_method_leaves_nothing_to_compare(mountings):
    alone = mounting.Mountings(methods={"single_step": mountings["single_step"]}, failures={})
    assert correlations(alone, "two_step").empty


def test_correlations_are_those_of_the_covariance(mountings):
    matrix = correlations(mountings)
    np.testing.assert_allclose(np.diag(matrix), 1.0)
    assert matrix.loc["k2", "k3"] < -0.95
    assert matrix.loc["f_mm", "lever_z_m"] > 0.5
