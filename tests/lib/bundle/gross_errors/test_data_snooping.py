"""Gross errors: one of each kind is found exactly, and clean data lose nothing."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.gross_errors.data_snooping import adjust_rejecting
from acx4lib.bundle.gross_errors.rejections import without
from acx4lib.bundle.uses import free_orientation, mounted_orientation
from acx4lib.least_squares.statistical.w_test import critical_tau
from support import blocks

FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def mounted_network(block):
    return mounted_orientation(block, free=FREE)


def free_network(block):
    return free_orientation(block, free=FREE)


def rejections(block, set_up=mounted_network, **options):
    fit = adjust_rejecting(blocks.approximate(block), set_up, **options)
    return [(r.kind, r.row, r.component) for r in fit.rejected], fit


def test_clean_data_lose_nothing(noisy_block):
    assert rejections(noisy_block)[0] == []
    assert rejections(noisy_block, free_network)[0] == []


@pytest.mark.parametrize("set_up", [free_network, mounted_network])
def test_a_wrong_image_point_is_found(noisy_block, set_up):
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 8.0  # px, 16 sigma
    spoilt = blocks.changed(noisy_block, "image_point", by)
    found, fit = rejections(spoilt, set_up)
    assert found == [("image_point", 100, -1)]
    assert 100 not in fit.network.rows
    assert fit.solution.sigma0_sq == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("set_up", [free_network, mounted_network])
def test_a_wrong_distance_is_found_and_the_others_stay(noisy_block, rng, set_up):
    ends = [[11, 20], [12, 31], [13, 42], [14, 25], [15, 36]]
    off = 0.1 * rng.normal(size=5)
    off[3] += 3.0
    found, fit = rejections(blocks.taped(noisy_block, ends, sigma=0.1, off=off), set_up)
    assert found == [("distance", 3, -1)]
    assert len(fit.network.distances) == 4
    group = fit.solution.group("distance")
    assert np.abs(group.w).max() < 3.9


@pytest.mark.parametrize("component", [0, 2])
def test_a_wrong_control_coordinate_is_found_and_the_others_stay(noisy_block, component):
    by = np.zeros((9, 3))
    by[5, component] = 1.5  # m
    found, fit = rejections(blocks.changed(noisy_block, "control_point", by))
    assert found == [("control_point", 5, component)]
    used = fit.solution.group("control_point").used
    assert used.sum() == 26
    assert not used[5, component]


@pytest.mark.parametrize(
    ("kind", "component", "size"),
    [
        ("gnss", 2, 1.5),
        ("gnss", 0, 2.0),  # a shift along the flight looks much like a pitch: it takes 100 sigma
        ("attitude", 2, np.radians(0.1)),
        ("attitude", 1, np.radians(0.2)),
    ],
)
def test_a_wrong_trajectory_row_is_found(noisy_block, kind, component, size):
    by = np.zeros((len(noisy_block.trajectory), 3))
    by[7, component] = size
    found, fit = rejections(blocks.changed(noisy_block, kind, by))
    assert found == [(kind, 7, -1)]
    assert not fit.solution.group(kind).used[7].any()
    # the other half of the row stays an observation
    other = {"gnss": "attitude", "attitude": "gnss"}[kind]
    assert fit.solution.group(other).used[7].all()


def test_one_error_of_each_kind_is_found_at_once(noisy_block):
    block = noisy_block
    for kind, row, component, size in (
        ("image_point", 30, 0, 12.0),
        ("control_point", 2, 1, 2.0),
        ("gnss", 10, 2, 1.5),
        ("attitude", 4, 2, np.radians(0.3)),
    ):
        by = np.zeros_like(blocks.observed_sigmas(block)[kind])
        by[row, component] = size
        block = blocks.changed(block, kind, by)
    found, _ = rejections(block)
    assert sorted(found) == [
        ("attitude", 4, -1),
        ("control_point", 2, 1),
        ("gnss", 10, -1),
        ("image_point", 30, -1),
    ]


@pytest.mark.parametrize("sigmas", [100, 400])
def test_a_control_point_that_is_far_off_does_not_take_its_image_points_along(noisy_block, sigmas):
    """Its error widens the spread of all control residuals, and must still be the first to go."""
    by = np.zeros((9, 3))
    by[5, 0] = 0.01 * sigmas
    found, _ = rejections(blocks.changed(noisy_block, "control_point", by))
    assert found == [("control_point", 5, 0)]


def test_the_statistic_of_a_rejection_is_about_its_error_over_its_sigma(noisy_block):
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 50.0  # px; of 0.5 px
    _, fit = rejections(blocks.changed(noisy_block, "image_point", by))
    redundancy = adjust(mounted_network(blocks.approximate(noisy_block))).solution
    at = np.flatnonzero(mounted_network(blocks.approximate(noisy_block)).rows == 100)[0]
    share = redundancy.group("image_point").redundancy[at, 1]
    # w = r (e / sigma) / sqrt(r), give or take its own noise of one
    assert fit.rejected[0].statistic == pytest.approx(100 * np.sqrt(share), abs=4)


def test_a_wrong_weight_is_no_gross_error(noisy_block):
    """Sigmas five times too small make all w five times too large, and reject nothing."""
    points = noisy_block.image_points
    eager = replace(noisy_block, image_points=replace(points, sigma_px=points.sigma_px / 5))
    found, fit = rejections(eager, free_network)
    assert [row for row in found if row[0] == "image_point"] == []
    assert fit.solution.sigma0_sq > 10


# --- many at once ----------------------------------------------------------------------------


def spoilt_in_many_places(block, rng, *, share=0.03):
    """Return the block with gross errors of every kind, and what they are."""
    n = len(block.image_points)
    rows = np.sort(rng.choice(n, int(share * n), replace=False))
    size = np.exp(rng.uniform(np.log(8.0), np.log(200.0), len(rows)))
    angle = rng.uniform(0, 2 * np.pi, len(rows))
    by = {kind: np.zeros_like(sigma) for kind, sigma in blocks.observed_sigmas(block).items()}
    by["image_point"][rows] = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    by["control_point"][2, 1] = 1.5
    by["gnss"][10] = [1.0, -2.0, 2.0]
    by["attitude"][4, 2] = np.radians(0.3)
    for kind, change in by.items():
        block = blocks.changed(block, kind, change)
    others = {("control_point", 2, 1), ("gnss", 10, -1), ("attitude", 4, -1)}
    return block, {("image_point", int(row), -1) for row in rows} | others


@pytest.mark.parametrize("seed", range(6))
def test_all_of_many_gross_errors_are_found_and_hardly_anything_else(noisy_block, mounted, seed):
    spoilt, wrong = spoilt_in_many_places(noisy_block, np.random.default_rng(seed))
    found, fit = rejections(spoilt)
    few_rays = noisy_block.rays[noisy_block.image_points.point_idx] < 4
    certain = {w for w in wrong if w[0] != "image_point" or not few_rays[w[1]]}
    assert certain <= set(found)
    # a test of 0.01 % per component takes out 0.1 of these 450 points on average
    assert len(set(found) - wrong) <= 1
    ours, clean = fit.state.interiors[0].to_array(), mounted.state.interiors[0].to_array()
    columns = fit.network.layout.interior[0]
    sigma = np.sqrt(np.diag(fit.solution.cov))[columns[columns >= 0]]
    # both have the good observations in common, so they differ by less than a sigma
    assert np.all(np.abs(ours - clean)[columns >= 0] < sigma)


def test_a_statistic_is_the_w_of_the_observation_put_back(noisy_block):
    spoilt, _ = spoilt_in_many_places(noisy_block, np.random.default_rng(3))
    start = blocks.approximate(spoilt)
    fit = adjust_rejecting(start, mounted_network)
    for kind in ("image_point", "control_point", "gnss", "attitude"):
        one = next(r for r in fit.rejected if r.kind == kind)
        network = mounted_network(without(start, [r for r in fit.rejected if r is not one]))
        back = adjust(replace(network, start=fit.state)).solution.group(kind).w
        at = np.flatnonzero(network.rows == one.row)[0] if kind == "image_point" else one.row
        w = back[at, one.component] if one.component >= 0 else np.abs(back[at]).max()
        # predicted at the solution without it; put back, it bends the others a little
        assert abs(w) == pytest.approx(one.statistic, rel=0.02)


def test_rejections_come_with_the_largest_first_and_exceed_their_limit(noisy_block):
    spoilt, _ = spoilt_in_many_places(noisy_block, np.random.default_rng(0))
    rejected = rejections(spoilt)[1].rejected
    statistics = [r.statistic for r in rejected]
    assert statistics == sorted(statistics, reverse=True)
    assert all(r.statistic > r.limit >= 3.9 for r in rejected)


def test_nothing_that_is_left_fails_its_test(noisy_block):
    spoilt, _ = spoilt_in_many_places(noisy_block, np.random.default_rng(1))
    _, fit = rejections(spoilt)
    assert all(np.nanmax(np.abs(group.w), initial=0.0) < 3.9 for group in fit.solution.groups)


def test_of_two_rays_that_do_not_meet_one_is_rejected_and_the_point_left_out(noisy_block):
    """Which of them is wrong cannot be known; the other controls nothing any more."""
    points = noisy_block.image_points
    last = points.point_idx == points.point_idx.max()
    first, second = np.flatnonzero(last)[[0, -1]]
    sigma_px = np.where(last, np.inf, points.sigma_px)
    sigma_px[[first, second]] = points.sigma_px[[first, second]]
    by = np.zeros((len(points), 2))
    by[first] = [40.0, 40.0]
    spoilt = blocks.changed(
        replace(noisy_block, image_points=replace(points, sigma_px=sigma_px)), "image_point", by
    )
    found, fit = rejections(spoilt)
    assert found in ([("image_point", first, -1)], [("image_point", second, -1)])
    assert fit.network.left_out == {"measured once": 1}


# --- where sigma0 is estimated ---------------------------------------------------------------


def test_tau_needs_ratios_of_sigmas_only(noisy_block):
    """With all sigmas four times too small, the one error is found and nothing else."""
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 8.0
    block = blocks.changed(noisy_block, "image_point", by)
    points, control, trajectory = block.image_points, block.control, block.trajectory
    eager = replace(
        block,
        image_points=replace(points, sigma_px=points.sigma_px / 4),
        control=replace(control, sigma_m=control.sigma_m / 4),
        trajectory=replace(
            trajectory,
            sigma_position=trajectory.sigma_position / 4,
            sigma_attitude=trajectory.sigma_attitude / 4,
        ),
    )
    found, fit = rejections(eager, sigma0="estimated")
    assert found == [("image_point", 100, -1)]
    sigma0 = np.sqrt(fit.solution.sigma0_sq)
    assert sigma0 == pytest.approx(4.0, rel=0.1)
    limit = sigma0 * critical_tau(3.9, fit.solution.redundancy)
    assert fit.rejected[0].limit == pytest.approx(limit, rel=1e-4)
    assert rejections(block, sigma0="estimated")[0] == found


def test_another_word_for_sigma0_is_refused(noisy_block):
    with pytest.raises(ValueError, match="one of known, estimated, got 'guessed'"):
        rejections(noisy_block, sigma0="guessed")
