"""Gross errors: one of each kind is found exactly, and clean data lose nothing."""

from dataclasses import replace

import numpy as np
import pytest

import blocks
from acx4lib.bundle import adjust, free_orientation, mounted_orientation
from acx4lib.data_snooping import adjust_rejecting

FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def mounted_network(block):
    return mounted_orientation(block, free=FREE)


def free_network(block):
    return free_orientation(block, free=FREE)


def rejections(block, set_up=mounted_network):
    fit = adjust_rejecting(blocks.approximate(block), set_up)
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
