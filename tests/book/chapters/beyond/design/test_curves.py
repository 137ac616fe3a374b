import numpy as np
import pytest

from acx4book.chapters.beyond.design.plans import HIGH_M, LOW_M


def test_equal_heights_leave_f_and_z_nearly_one_number(tables):
    """An error of f moves the image as one of z does: δf / f = δz / h."""
    one = tables["ratio"][1.0]
    assert one["f_mm"] / 74.0 == pytest.approx(one["lever_z_m"] / LOW_M, rel=0.05)


def test_two_heights_matter_to_f_and_z(tables):
    gain = tables["ratio"][1.0] / tables["ratio"][1.5]
    assert gain[["f_mm", "lever_z_m"]].min() > 5
    assert gain.drop(["f_mm", "lever_z_m"]).max() < 2


def test_opposite_directions_matter_to_what_turns_with_the_aircraft(tables):
    gain = tables["turn"][0.0] / tables["turn"][180.0]
    assert gain[["lever_x_m", "lever_y_m"]].min() > 5
    assert gain[["xp_mm", "yp_mm", "boresight_omega_deg", "boresight_phi_deg"]].min() > 1.5
    assert gain[["f_mm", "lever_z_m", "boresight_kappa_deg"]].max() < 1.2


def test_kappa_is_a_mean_of_headings(tables):
    pairs = tables["pairs"].loc["boresight_kappa_deg"]
    means = [0.008 / np.sqrt(28 * n) for n in pairs.index]
    assert [*pairs] == pytest.approx(means, rel=0.03)
    assert [*tables["same_way"].loc["boresight_kappa_deg"]] == pytest.approx([*pairs], rel=0.03)


def test_a_flight_is_the_same_in_two_curves(tables):
    same = tables["pairs"][1]
    assert tables["turn"][180.0].to_numpy() == pytest.approx(same.to_numpy(), rel=0.1)
    assert tables["ratio"][HIGH_M / LOW_M].to_numpy() == pytest.approx(same.to_numpy())


def test_control_points_never_make_anything_worse(tables):
    relative = tables["control"].T.pct_change().iloc[1:]
    assert relative.max(axis=None) < 0.01
