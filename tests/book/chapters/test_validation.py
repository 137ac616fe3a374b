"""Tables of validations side by side, as numbers, beside the paper's Table 4."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import validation
from acx4book.paper import printed
from acx4lib.calibration.estimates import from_bundle
from acx4lib.design import ground_sample_m
from acx4lib.georeferencing import accuracy, error_sources
from acx4lib.georeferencing.validation import validate
from support import blocks


@pytest.fixture(scope="module")
def found(mounted):
    """Nine check points, validated with parameters of which none is known exactly."""
    block = blocks.simulate(blocks.fly(), check=blocks.terrain(9, half_m=200.0, seed=8))
    noisy = blocks.noisy(block, np.random.default_rng(3))
    return validate(noisy, from_bundle(mounted), method="single_step")


@pytest.fixture(scope="module")
def sizes(found):
    return accuracy.from_differences(found.points.d)


def test_differences_are_those_of_the_validations_with_pixels_beside(found):
    table = validation.differences({"single": found})
    assert table.index.names == ["method", "of", "coordinate"]
    pairs = table.loc["single", "pairs"]
    rms = np.sqrt(np.mean(found.pairs.d**2, axis=0))
    assert_allclose(pairs["RMS (m)"], rms)
    assert_allclose(pairs["RMS (px)"], rms / ground_sample_m(found.block))
    assert_allclose(pairs["mean (m)"], found.pairs.d.mean(axis=0))
    points = table.loc["single", "points"]
    assert_allclose(points["expected RMS (m)"], np.sqrt(np.mean(found.points.sigma**2, axis=0)))


def test_printed_rows_have_the_digits_of_the_print(flight, other):
    table = validation.printed_differences(flight, {"single_step": "paper"})
    assert list(table.loc[("paper", "pairs", "north")]) == ["262", "−0.06", "0.53", "0.46", "4.6"]
    counted = validation.printed_counts(flight, {"single_step": "paper"})
    assert list(counted.loc["paper"]) == ["262", "0", "36", "14", "38.89"]
    assert validation.printed_differences(other, {"single_step": "paper"}) is None
    assert validation.printed_counts(other, {"single_step": "paper"}) is None


def test_the_papers_rms_in_plan_is_that_of_both_coordinates(flight, other):
    plan, height = printed.plan_and_height(flight, "single_step")
    assert (round(plan, 2), height) == (0.64, 0.45)
    assert printed.plan_and_height(other, "single_step") is None


def test_correlated_points_leave_wider_limits(found):
    test = accuracy.normalised_test(
        found.points.d,
        found.points.sigma,
        error_sources.axis_covariances(found.points.sources),
    )
    table = validation.normalised({"single": test}).loc["single"]
    assert list(table.index) == ["east", "north", "height"]
    rms = np.sqrt(np.mean((found.points.d / found.points.sigma) ** 2, axis=0))
    assert_allclose(table["RMS of d / σ"], rms)
    assert np.all((table["counts as"] > 1) & (table["counts as"] < 9))
    assert np.all(table["p joint"] >= table["p"])


def test_means_stand_over_the_sigma_of_correlated_points(found, sizes):
    test = accuracy.bias_test(np.array(sizes.mean), found.mean_cov)
    table = validation.bias({"single": found}, {"single": sizes}, {"single": test})
    sigma = np.sqrt(np.diag(found.mean_cov))
    assert_allclose(table["mean / σ"], found.points.d.mean(axis=0) / sigma)
    assert list(table["bias"] == "none seen") == list(np.abs(table["mean / σ"]) <= 1.645)
    assert np.all(table["RMS, from (m)"] < table["RMS (m)"])


def test_the_mean_that_correlations_harm_most_is_named(found):
    worst = validation.most_shared({"Single": found})
    apart = np.sqrt(np.sum(found.points.sigma**2, axis=0)) / 9
    ratio = np.sqrt(np.diag(found.mean_cov)) / apart
    assert worst["axis"] == ("east", "north", "height")[int(np.argmax(ratio))]
    assert worst["sigma"] / worst["if_independent"] == pytest.approx(ratio.max())
    assert worst["n"] == 9
