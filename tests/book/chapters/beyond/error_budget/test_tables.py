"""Tables: what their rows have, that shares add up, and figures that others computed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.error_budget import as_printed, tables
from acx4lib.georeferencing import budget


@pytest.fixture(scope="module")
def groups(found):
    return tables.groups(found.validations, found.points, found.pairs)


def test_groups_have_a_row_for_every_method_kind_of_rays_and_coordinate(found, groups):
    assert len(groups) == len(found.validations) * 2 * 2
    shares = groups[[f"{name} (%)" for name in budget.GROUPS]]
    assert shares.sum(axis=1).to_numpy() == pytest.approx(100.0)
    last = groups.loc["Single-step", "pairs", "height"]
    assert last["RMS predicted (m)"] == pytest.approx(found.pairs["single_step"].rms[2])
    assert groups["RMS of d / σ"].between(0.5, 1.5).all()


def test_shares_of_pairs_are_those_computed_independently(groups):
    """Plan: 52 % image and survey, 48 % trajectory, below 1 % calibration; height: 50, 47, 3."""
    image, trajectory, calibration = groups.loc["Two-step", "pairs", "plan"].iloc[2:]
    assert image == pytest.approx(52, abs=1)
    assert trajectory == pytest.approx(48, abs=1)
    assert 0 < calibration < 1
    height = groups.loc["Two-step", "pairs", "height"].iloc[2:]
    assert list(height) == pytest.approx([50, 47, 3], abs=1.1)


@pytest.mark.parametrize("kind", ["points", "pairs"])
def test_budgets_are_those_of_the_validation(found, kind):
    for method, validation in found.validations.items():
        split, differences = getattr(found, kind)[method], getattr(validation, kind)
        assert_allclose(split.sigma, differences.sigma, rtol=1e-12)


def test_correlations_and_parts_of_the_calibration_add_up_to_all(found):
    height = tables.plan_and_height(found.points["two_step"].mean)[1]
    parts = [tables.percent(height, name) for name in budget.CALIBRATION]
    assert sum(parts) == pytest.approx(tables.percent(height, *budget.CALIBRATION))
    assert tables.percent(height, "lever arm with interior orientation") < 0


def test_the_printed_flight_says_what_it_predicts_and_leaves(found):
    calibration = as_printed.as_calibrated(found.calibrations["single_step"])
    cases = as_printed.assumptions()
    splits = [
        budget.of(*as_printed.sources(found.validations["single_step"], calibration, case))
        for case in cases
    ]
    table = tables.printed_flight(cases, splits)
    assert table.iloc[0, 0:2].tolist() == [0.5, 0.05]
    first = table.iloc[0]
    assert np.hypot(first["east: predicted (m)"], first["east: left (m)"]) == pytest.approx(0.44)
    assert np.isnan(table.iloc[2]["height: left (m)"])


def test_suspects_are_named_with_their_size(suspects):
    table = tables.suspects(suspects)
    assert list(table.index) == [one.name for one in suspects]
    assert table["size needed"].str.contains(r"^[\d.]+(?: px| m|°)$").all()
    assert_allclose(table["height (m)"], [one.rms[2] for one in suspects])


@pytest.fixture(scope="module")
def suspects(found):
    calibration, best = as_printed.as_calibrated(found.calibrations["single_step"]), 0
    case = as_printed.assumptions()[best]
    of = as_printed.sources(found.validations["single_step"], calibration, case)
    return as_printed.suspects(*of, case)
