"""The chapter's campaigns and its rig, made once."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4book.chapters import stability
from acx4tools import campaigns as acx4tools_campaigns
from acx4tools.campaigns import compare
from support.figures import assert_texts_apart, drawn, panels
from support.run_results import campaign, rigidity_of_a_turned_head


@pytest.fixture(scope="session")
def campaigns():
    return [campaign(one) for one in stability.flights(1)]


@pytest.fixture(scope="session")
def every(campaigns):
    return compare(campaigns)


@pytest.fixture(scope="session")
def before(campaigns):
    return compare(campaigns[: stability.BEFORE])


@pytest.fixture(scope="session")
def rigid():
    return rigidity_of_a_turned_head(1)


# --- Figures of the chapter, by what they show


COV = np.array([[4.0, 16.0], [16.0, 100.0]])


def test_dots_lie_outside_ellipses_where_chance_does_not_make_them():
    pair, rest = (np.array([-9.0, 10.0]), COV), (np.array([-9.0, -5.0]), 0.5 * COV)
    fig = drawn(stability.hidden(pair, rest, label="2022-05 less 2021-08", n_tests=70))
    assert_texts_apart(fig)
    (ax,) = panels(fig)
    dots = [line for line in ax.lines if len(line.get_xdata()) == 1]
    ellipses = [line for line in ax.lines if len(line.get_xdata()) == 200]
    assert (len(dots), len(ellipses)) == (2, 2)
    for dot in dots:
        assert dot.get_xdata()[0] < min(line.get_xdata().min() for line in ellipses)
    # the ellipse ends where chance ends in one case of twenty: chi-square with 2 degrees of freedom
    assert_allclose(ellipses[0].get_xdata().max(), 2.0 * np.sqrt(5.991), rtol=1e-3)


def test_curves_are_the_shares():
    levels = np.array([0.01, 0.05, 0.2])
    shares = {way: k * levels for k, way in enumerate(stability.MARKS, start=1)}
    (ax,) = panels(drawn(stability.alarms(shares, levels)))
    by_label = {line.get_label(): line.get_ydata() for line in ax.lines}
    for way, share in shares.items():
        assert_allclose(by_label[way], share)


# --- Campaigns of a camera whose truth is known at every date


def test_the_true_camera_follows_temperature_and_repair():
    cold, late = stability.HISTORY[0], stability.HISTORY[-1]
    a, b = (stability.plan_of(flown).cameras[stability.CAMERA] for flown in (cold, late))
    degrees = late.temperature_c - cold.temperature_c
    assert np.isclose(b.f_mm - a.f_mm, degrees * stability.UM_PER_DEGREE / 1000)
    assert np.allclose(np.subtract(b.boresight_deg, a.boresight_deg), stability.REPAIR_DEG)


def test_estimates_are_near_the_truth(every):
    for i, flown in enumerate(stability.HISTORY):
        true = stability.plan_of(flown).cameras[stability.CAMERA]
        truth = {"f_mm": true.f_mm, "xp_mm": true.xp_mm, "lever_z_m": true.lever_m[2]}
        truth["boresight_kappa_deg"] = true.boresight_deg[2]
        for k, p in enumerate(every.parameters):
            if p.name in truth:
                sigma = np.sqrt(every.covs[i, k, k])
                assert abs(every.values[i, k] - truth[p.name]) < 4 * sigma


def test_before_the_repair_the_campaigns_lie_on_lines_and_with_it_they_do_not(every, before):
    lines = [
        acx4tools_campaigns.trend(one, acx4tools_campaigns.temperatures(one))
        for one in (before, every)
    ]
    assert lines[0].scatter.p > 1e-3
    assert lines[1].scatter.p < 1e-6
    assert acx4tools_campaigns.stability(before).p < 1e-6


# --- A planted turn: of one head, at one exposure, by the collinearity equations


def test_only_the_points_of_one_image_move_by_what_a_turn_makes():
    still = stability.flown(1)
    moved = stability.turning(still)
    a, b = (flight.tables[stability.POINTS] for flight in (still, moved))
    shift = (b[["col_px", "row_px"]] - a[["col_px", "row_px"]]).to_numpy()
    images = a["image"][np.abs(shift[:, 0]) > 0]
    assert set(images) == {f"{stability.EXPOSURE}_{stability.HEAD}"}
    camera = still.plan.cameras[stability.HEAD]
    own = (a["image"] == images.iloc[0]).to_numpy()
    f = camera.f_mm / camera.pixel_um * 1000
    x = a.loc[own, "col_px"] - (camera.width_px - 1) / 2
    y = (camera.height_px - 1) / 2 - a.loc[own, "row_px"]
    turn = Rotation.from_euler("y", stability.ARCSEC / 3600, degrees=True)
    ray = turn.inv().apply(np.column_stack([x, y, np.full(len(x), -f)]))  # in the turned axes
    turned_x, turned_y = -f * ray[:, :2].T / ray[:, 2]
    expected = np.column_stack([turned_x - x, -(turned_y - y)])  # rows count downwards
    np.testing.assert_allclose(shift[own], expected, atol=1e-3)


def test_the_planted_turn_is_found_and_nothing_else(rigid):
    own = stability.planted(rigid)
    assert own["p_joint"] < 1e-3
    assert abs(own["turn_arcsec"] - stability.ARCSEC) < 4 * own["sigma_arcsec"]
    assert np.sum(rigid.p_joint < 0.05) == 1
