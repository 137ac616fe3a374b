"""Groups of parameters in chapter 03: against zero, what was declared, and what is printed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.mounting import joint_tests


@pytest.fixture(scope="module")
def single(mountings):
    return mountings["single_step"]


@pytest.fixture(scope="module")
def table(ideal, single):
    return joint_tests.table(ideal, single)


def test_covariance_and_nested_adjustment_agree(table):
    """Also hundreds of sigmas away: the problem is nearly linear."""
    assert_allclose(table["F"], table["F, adjusted without them"], rtol=0.01)


def test_the_printed_values_are_the_truth_and_zero_is_not(table):
    of = table.groupby("against", sort=False)["p"].agg(list)
    assert set(of["zero"]) == set(of["declared"]) == {"<\N{NO-BREAK SPACE}0.0005"}
    assert len(of["printed"]) == 4
    assert min(map(float, of["printed"])) > 0.001


def test_single_tests_hide_what_the_radial_parameters_are_together(single, table):
    radial = table.iloc[0]
    assert np.sqrt(3 * radial["F"]) > 3 * radial["largest single t"]
    assert joint_tests.sentence(single).startswith("Single tests hide most of $k_1$, $k_2$, $k_3$")


def test_without_a_single_step_there_is_nothing_to_test(ideal):
    assert joint_tests.table(ideal, None).empty
    assert joint_tests.sentence(None) == joint_tests.NOTHING
