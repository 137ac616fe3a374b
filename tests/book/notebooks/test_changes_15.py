"""Chapter 15: what planned flights determine, what is computed by hand, and a plan of one's own."""

import numpy as np
import pytest

from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

NEVER = "shown.explorer(explorer.explorer(plan))"
"""The figure that moves has flights of its own, which take long."""


@pytest.fixture(scope="module")
def as_it_is():
    return changed("15", {NEVER: "None"})


def test_equal_heights_leave_f_and_z_nearly_one_number(as_it_is):
    assert as_it_is["library"] == pytest.approx(as_it_is["by_hand"], rel=0.05)


def test_two_heights_matter_to_f_and_z(as_it_is):
    gain = as_it_is["by_ratio"][1.0] / as_it_is["by_ratio"][1.5]
    assert gain[["f_mm", "lever_z_m"]].min() > 5
    assert gain.drop(["f_mm", "lever_z_m"]).max() < 2


def test_opposite_directions_matter_to_what_turns_with_the_aircraft(as_it_is):
    gain = as_it_is["by_turn"][0.0] / as_it_is["by_turn"][180.0]
    assert gain[["lever_x_m", "lever_y_m"]].min() > 5
    assert gain[["xp_mm", "yp_mm", "boresight_omega_deg", "boresight_phi_deg"]].min() > 1.5
    assert gain[["f_mm", "lever_z_m", "boresight_kappa_deg"]].max() < 1.2


def test_kappa_is_a_mean_of_headings(as_it_is):
    pairs, one_way = as_it_is["by_pairs"], as_it_is["by_same_way"]
    means = [0.008 / np.sqrt(28 * n) for n in pairs.columns]
    assert pairs.loc["boresight_kappa_deg"].tolist() == pytest.approx(means, rel=0.03)
    assert one_way.loc["boresight_kappa_deg"].tolist() == pytest.approx(means, rel=0.03)
    assert as_it_is["by_formula"].tolist() == pytest.approx(means)
    assert as_it_is["n"] == pytest.approx(256)


def test_a_flight_is_the_same_in_two_curves(as_it_is):
    same = as_it_is["by_pairs"][1].to_numpy()
    assert as_it_is["by_turn"][180.0].to_numpy() == pytest.approx(same, rel=0.1)
    assert as_it_is["by_ratio"][1.5].to_numpy() == pytest.approx(same)


def test_control_points_never_make_anything_worse(as_it_is):
    relative = as_it_is["by_control"].T.pct_change().iloc[1:]
    assert relative.max(axis=None) < 0.01


def test_sigma_by_the_sum_of_strips_is_the_library_s(as_it_is):
    expected = as_it_is["found"].given((0, 1, 3))
    np.testing.assert_allclose(as_it_is["by_sum"], expected, rtol=1e-5)


def test_the_chosen_flight_is_cheaper_and_within_what_is_allowed(as_it_is):
    assert as_it_is["chosen"].met
    table, wanted = as_it_is["table"], as_it_is["wanted"]
    assert table.loc["minutes", "chosen"] < 0.8 * table.loc["minutes", "the paper's"]
    ratio = table["chosen"] / table["the paper's"]
    assert ratio[wanted].max() <= 1.25


def test_a_held_lever_arm_leaves_f_to_the_shift_of_gnss(as_it_is):
    held = as_it_is["sigmas"](as_it_is["held"])["f_mm"]
    assert held > 5 * as_it_is["by_ratio"].loc["f_mm", 1.5]


def test_what_a_left_out_strip_does_is_told_by_sums_as_well(as_it_is):
    harm, by_sums = as_it_is["harm"].loc[as_it_is["wanted"]], as_it_is["by_sums"]
    assert (harm > 1).all(axis=None)
    assert by_sums.to_numpy() == pytest.approx(harm.to_numpy(), rel=0.12)
    assert harm.max()[by_sums.max().idxmin()] < 1.02 * harm.max().min()


def test_a_shorter_time_keeps_to_it(as_it_is):
    short = as_it_is["short"]
    assert short.minutes <= 6
    assert 1 < short.excess < as_it_is["excess"]
    heights = {one.flying_height_m for one in short.plan.blocks["calibration"].strips.values()}
    assert heights == {1000.0, 1500.0}


def test_what_is_allowed_is_an_argument(as_it_is):
    poorer = changed("15", {NEVER: "None"}, allowed=2.0)
    assert poorer["chosen"].minutes < as_it_is["chosen"].minutes
