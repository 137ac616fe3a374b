"""The flight of the chapter, calibrated, validated and split by its sources once."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import error_budget
from acx4book.notebooks import simulated
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import single_step, two_step
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.budget import SOURCES, like, over_ground
from acx4lib.georeferencing.validation import validate
from acx4lib.model import Model
from support.figures import drawn, panels


@pytest.fixture(scope="session")
def found():
    flight = simulated.fly_and_read("acx4-ideal", 1, blocks=("calibration", "validation")).flight
    block, free = flight.block("validation"), flight.estimate_mounting
    single = single_step(flight.calibration, Model(free=free))
    two = two_step(flight.calibration, Model(free=free), after=single)
    methods = {"two_step": two.calibration, "single_step": single.calibration}
    validations = {name: validate(block, one, method=name) for name, one in methods.items()}

    def split(kind):
        return {
            name: budget.of(getattr(one, kind).sources, one.georeferenced.layout)
            for name, one in validations.items()
        }

    return SimpleNamespace(
        block=block,
        calibrations=methods,
        validations=validations,
        points=split("points"),
        pairs=split("pairs"),
        mapping=like(block, block.cameras[0]),
    )


# --- Bars end where the shares say, lines at the standard deviations


def test_stacked_bars_end_at_a_hundred_percent(found):
    fig = drawn(error_budget.stacked(found.points))
    for ax in panels(fig):
        ends = {}
        for bar in ax.patches:
            middle = round(bar.get_y() + bar.get_height() / 2)
            ends[middle] = max(ends.get(middle, 0.0), bar.get_x() + bar.get_width())
        assert list(ends.values()) == pytest.approx([100.0] * len(found.validations))


@pytest.fixture(scope="module")
def heights(found):
    heights_m = np.array([500.0, 1000.0, 2000.0, 3000.0])
    return heights_m, {
        name: [over_ground(one, replace(found.mapping, height_m=h)) for h in heights_m]
        for name, one in found.calibrations.items()
    }


def test_image_points_grow_with_the_height(heights):
    """Within a percent: the lever arm, 0.2 m, moves the borders of low images on the ground."""
    first, *_, last = heights[1]["single_step"]
    np.testing.assert_allclose(np.sqrt(last.mean[:, 0] / first.mean[:, 0]), 6, rtol=1e-2)


def test_the_two_step_calibration_is_good_at_its_own_heights_only(heights):
    share = [budget.shares(split.mean[2])["calibration"] for split in heights[1]["two_step"]]
    assert np.argmin(share) == 1
    assert share[-1] > 10 * min(share)
    single = [budget.shares(split.mean[2])["calibration"] for split in heights[1]["single_step"]]
    assert max(single) < 0.03


# --- Tables: what their rows have, that shares add up, and figures that others computed


@pytest.fixture(scope="module")
def groups(found):
    return error_budget.groups(found.validations, found.points, found.pairs)


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


def test_the_printed_flight_says_what_it_predicts_and_leaves(found):
    calibration = error_budget.as_calibrated(found.calibrations["single_step"])
    cases = error_budget.assumptions()
    splits = [
        budget.of(*error_budget.sources(found.validations["single_step"], calibration, case))
        for case in cases
    ]
    table = error_budget.printed_flight(cases, splits)
    assert table.iloc[0, 0:2].tolist() == [0.5, 0.05]
    first = table.iloc[0]
    assert np.hypot(first["east: predicted (m)"], first["east: left (m)"]) == pytest.approx(0.44)
    assert np.isnan(table.iloc[2]["height: left (m)"])


# --- The paper's own accuracies: the unexplained part, by hand where it can be found by hand


BEST = error_budget.assumptions()[0]


def sources(found, case):
    calibration = error_budget.as_calibrated(found.calibrations["single_step"])
    return error_budget.sources(found.validations["single_step"], calibration, case)


def predicted(found, case):
    return budget.of(*sources(found, case))


@pytest.fixture(scope="module")
def best(found):
    return predicted(found, BEST)


@pytest.fixture(scope="module")
def as_printed_suspects(found):
    return error_budget.printed_suspects(*sources(found, BEST), BEST)


def test_sigma_are_those_of_table_3(found):
    said = error_budget.as_calibrated(found.calibrations["single_step"])
    of = {parameter.name: parameter.sigma for parameter in parameters(said)}
    assert of["f_mm"] == pytest.approx(0.0010)
    assert of["lever_z_m"] == pytest.approx(0.015)
    assert of["k3"] == pytest.approx(3.19e-15)
    # angles are reported about other axes, by less than three degrees
    assert of["boresight_kappa_deg"] == pytest.approx(0.00119, rel=0.05)


def test_what_is_left_and_what_is_predicted_are_the_printed_rms(best):
    left = error_budget.unexplained(error_budget.rms(), best.rms)
    assert np.hypot(best.rms, left) == pytest.approx([0.44, 0.46, 0.45])
    assert error_budget.unexplained(np.array([0.3]), np.array([0.4])) == 0.0


def test_suspects_make_what_is_left_in_plan(as_printed_suspects, best):
    left = error_budget.unexplained(error_budget.rms(), best.rms)
    for one in as_printed_suspects:
        assert np.hypot(*one.rms[:2]) == pytest.approx(np.hypot(*left[:2]), rel=1e-9)
        assert one.size > 0


def test_the_size_of_a_suspect_is_that_which_makes_its_rms(found, as_printed_suspects):
    """GNSS errors that large, put into the budget, give the RMS that the table says."""
    gnss = next(one for one in as_printed_suspects if one.name == "GNSS")
    case = error_budget.Assumed(sigma_px=0.5, sigma_gnss_m=gnss.size)
    mean = predicted(found, case).mean[:, SOURCES.index("GNSS")]
    assert_allclose(np.sqrt(mean), gnss.rms, rtol=1e-6)


def test_no_error_of_single_rays_is_larger_in_plan_than_in_height(as_printed_suspects):
    """A pair whose rays meet at a small angle has the poorer height."""
    free = {"boresight κ", "the targets themselves, in plan", "lever arm, forward", "boresight φ"}
    for one in as_printed_suspects:
        assert (one.rms[2] > np.hypot(*one.rms[:2])) or one.name in free, one.name
