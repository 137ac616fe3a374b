"""Tables and sentences of the validation, and where there is nothing to validate."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.validation import sentences, tables
from acx4lib.calibration.estimates import from_bundle
from acx4lib.georeferencing.validation import validate
from support import blocks


@pytest.fixture(scope="module")
def found(mounted):
    """Nine check points, validated with parameters of which none is known exactly."""
    block = blocks.simulate(blocks.fly(), check=blocks.terrain(9, half_m=200.0, seed=8))
    noisy = blocks.noisy(block, np.random.default_rng(3))
    return validate(noisy, from_bundle(mounted), method="single_step")


def test_all_differences_of_a_method_are_tested_together(found):
    row = tables.together([found]).iloc[0]
    assert row["Degrees of freedom"] == 27
    assert row["χ²"] == found.joint_chi_square
    assert row["p"] == found.joint_chi_square_p


def test_correlated_points_leave_wider_limits(found):
    table = tables.normalised([found])
    assert list(table["Axis"]) == ["east", "north", "height"]
    rms = np.sqrt(np.mean((found.points.d / found.points.sigma) ** 2, axis=0))
    assert_allclose(table["RMS of d / σ"], rms)
    assert np.all((table["counts as"] > 1) & (table["counts as"] < 9))
    low, high = zip(*(map(float, text.split(" to ")) for text in table["95 % limits"]), strict=True)
    inside = (np.array(low) <= rms) & (rms <= np.array(high))
    assert list(table["prediction"] == "holds") == list(inside)


def test_means_stand_over_the_sigma_of_correlated_points(found):
    table = tables.bias([found])
    sigma = np.sqrt(np.diag(found.mean_cov))
    assert_allclose(table["mean / σ"], found.points.d.mean(axis=0) / sigma)
    assert list(table["bias"] == "none seen") == list(np.abs(table["mean / σ"]) <= 1.645)
    assert "standard deviation of 0." in sentences.shared([found])


def test_without_a_validation_the_tables_keep_their_columns():
    assert list(tables.bias([]).columns) == list(tables.BIAS)
    assert list(tables.normalised([]).columns) == list(tables.NORMALISED)
    assert list(tables.together([]).columns) == list(tables.TOGETHER)
    assert "nothing to validate" in sentences.shared([])
    assert "nothing to validate" in sentences.validation([])


def test_the_answer_has_the_rms_over_points_and_names_the_scale_of_class_a(other, found):
    first, rest = sentences.answer(other, [found]).split("\n\n")
    rms = np.sqrt(np.mean(found.points.d**2, axis=0))
    assert f"RMS is {np.hypot(*rms[:2]):.2f} m in plan and {rms[2]:.2f} m in height" in first
    assert "printed" not in first
    assert "no tabulated scale" in rest or "class A at 1:" in rest
    assert "nothing to validate" in sentences.answer(other, [])
