"""Tests of the rays of a point, with independent exposures and with slow errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.georeferencing import direct, ray_tests
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from support import blocks

CHECK = 6


@pytest.fixture(scope="module")
def many_rays():
    """Six points in up to twelve images, whose exposures follow each other within seconds."""
    points = blocks.terrain(CHECK, half_m=150.0, seed=8)
    return blocks.in_strips(blocks.simulate(blocks.fly(), check=points), 3)


def slow(block, share):
    process = GaussMarkov(share=share, time_constant_s=60.0)
    own = replace(block.trajectory, slow_positions=process, slow_attitudes=process)
    return replace(block, trajectory=own)


def rays(block):
    points = block.image_points
    rows = np.lexsort((points.image_idx, points.point_idx))
    return direct.Rays(
        image_idx=points.image_idx[rows],
        group=points.point_idx[rows],
        colrow=points.colrow[rows],
        sigma_px=points.sigma_px[rows],
    )


def found(block, cameras):
    return ray_tests.of(block, direct.georeference(block, cameras), rays(block))


def test_slow_errors_of_no_share_are_independent_ones(many_rays, cameras):
    noisy = blocks.noisy(many_rays, np.random.default_rng(3))
    white, hardly = found(noisy, cameras), found(slow(noisy, 1e-6), cameras)
    assert_allclose(hardly.w, white.w, rtol=1e-4)
    assert hardly.cost == pytest.approx(white.cost, rel=1e-4)


def test_cost_has_its_chi_square_where_errors_change_slowly(many_rays, cameras):
    """60 flights: within bounds of 99 % if their correlation is known, outside if it is not."""
    knowing, unknowing, dof = 0.0, 0.0, 0
    for seed in range(60):
        noisy = blocks.noisy(slow(many_rays, 0.98), np.random.default_rng(seed))
        knowing += found(noisy, cameras).cost
        unknowing += found(slow(noisy, 0.0), cameras).cost
        dof += 2 * len(noisy.image_points) - 3 * CHECK
    assert 0.005 < stats.chi2.cdf(knowing, dof) < 0.995
    assert stats.chi2.cdf(unknowing, dof) > 0.995


def test_a_wrong_ray_is_found_sooner_by_its_neighbours_slow_errors(many_rays, cameras):
    points, row = many_rays.image_points, 4
    by = np.zeros((len(points), 2))
    by[row] = [3.0, 0.0]
    wrong = blocks.changed(many_rays, "image_point", by)
    order = np.lexsort((points.image_idx, points.point_idx))
    for w in (found(wrong, cameras).w, found(slow(wrong, 0.98), cameras).w):
        assert order[np.argmax(w)] == row
    assert found(slow(wrong, 0.98), cameras).w.max() > 1.1 * found(wrong, cameras).w.max()
