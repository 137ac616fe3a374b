"""A shift of the trajectory does to calibrations what the book says."""

import numpy as np
import pytest

import acx4sim
from acx4book.chapters.beyond.weights import tables
from acx4book.chapters.beyond.weights.shifted import SHIFT_M, shifted_trajectories
from acx4book.chapters.beyond.weights.simulated import TIES, fly, scatter
from acx4lib.calibration import mounting, trajectory_errors

SHIFTED, UNKNOWN = "shifted, none", "shifted, shift"


@pytest.fixture(scope="module")
def errors():
    return shifted_trajectories(range(1, 9))


def of(errors, kind, parameter):
    own = errors[(errors["kind"] == kind) & (errors["parameter"] == parameter)]
    return own["error"].to_numpy(), own["sigma"].to_numpy()


def test_a_shift_in_plan_no_longer_moves_the_lever_arm_when_it_is_unknown(errors):
    """Across the strips its effect is 0.19 m, four sigma; eight flights average its noise out."""
    for kind, low, high in ((SHIFTED, 3.0, 6.0), (UNKNOWN, 0.0, 1.1)):
        error, sigma = of(errors, kind, "lever_y_m")
        assert low < abs(np.mean(error / sigma)) < high  # the mean's sigma is 0.35


def test_a_shift_in_height_is_in_the_lever_arm_either_way(errors):
    for kind in (SHIFTED, UNKNOWN):
        error, sigma = of(errors, kind, "lever_z_m")
        assert abs(np.mean(error) + SHIFT_M[2]) < 3.3 * sigma.mean() / np.sqrt(8)


def test_the_variance_of_unit_weight_gives_a_shift_away(errors):
    mean = errors.groupby("kind")["sigma0_squared"].mean()
    assert mean[SHIFTED] > 1.15
    assert mean[UNKNOWN] == pytest.approx(1.0, abs=0.03)
    said = tables.ratio_sentence(errors)
    assert f"is {mean[SHIFTED]:.2f} on average, and {mean[UNKNOWN]:.2f} with" in said


def test_a_lever_arm_that_is_held_has_no_errors_to_show(errors):
    found = scatter(errors)
    table = tables.ratio_table(found).set_index("Parameter")
    assert (table.loc["lever arm $z$"] == "held").sum() == 1
    row = found.set_index(["kind", "parameter"]).loc[(UNKNOWN, "f_mm")]
    assert table.loc["$f$", "Shifted; unknown: shift"] == f"{row['ratio']:.1f}"
    assert not any("k_1" in name for name in table.index)


def test_the_mounting_page_says_what_was_estimated_or_that_nothing_was():
    options = acx4sim.Options(tie_points=TIES, gnss_shift_m=SHIFT_M)
    flown = fly("single-head", 1, options)
    settings = {"free": flown.flight.estimate_mounting}
    found = mounting.single_step(flown.block, **settings, gnss=("shift",))
    notes = trajectory_errors.notes(found.bundle)
    assert len(notes) == 3
    assert "height of the GNSS shift is held, since it and the lever arm's z" in notes[1]
    without = mounting.single_step(flown.block, **settings)
    assert trajectory_errors.notes(without.bundle) == []
