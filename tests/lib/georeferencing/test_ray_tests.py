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


def w_of(block, cameras):
    return ray_tests.of(block, direct.georeference(block, cameras), rays(block))


def cost(block, cameras):
    return ray_tests.cost(block, direct.georeference(block, cameras), rays(block))


def test_slow_errors_of_no_share_are_independent_ones(many_rays, cameras):
    noisy = blocks.noisy(many_rays, np.random.default_rng(3))
    hardly = slow(noisy, 1e-6)
    assert_allclose(w_of(hardly, cameras), w_of(noisy, cameras), rtol=1e-4)
    assert cost(hardly, cameras) == pytest.approx(cost(noisy, cameras), rel=1e-4)


def agreement(flights, cameras, share):
    """Return the p of chi-square for the costs of flights whose errors change slowly, or not."""
    costs = [cost(slow(flight, share), cameras) for flight in flights]
    dof = 2 * len(flights[0].image_points) - 3 * CHECK
    return stats.kstest(costs, stats.chi2(dof).cdf).pvalue


def test_cost_has_its_chi_square_where_errors_change_slowly(many_rays, cameras):
    """If their correlation is known: otherwise not."""
    flights = [
        blocks.noisy(slow(many_rays, 0.98), np.random.default_rng(seed)) for seed in range(60)
    ]
    assert agreement(flights, cameras, 0.98) > 0.01
    assert agreement(flights, cameras, 0.0) < 0.01


def test_costs_spread_as_chi_square_where_rays_share_exposures(many_rays, cameras):
    """Each image shows several points: taken for independent, costs spread too widely."""
    flights = [blocks.noisy(many_rays, np.random.default_rng(seed)) for seed in range(100)]
    assert agreement(flights, cameras, 0.0) > 0.01


def test_a_wrong_ray_is_found_sooner_by_its_neighbours_slow_errors(many_rays, cameras):
    points, row = many_rays.image_points, 4
    by = np.zeros((len(points), 2))
    by[row] = [3.0, 0.0]
    wrong = blocks.changed(many_rays, "image_point", by)
    order = np.lexsort((points.image_idx, points.point_idx))
    for w in (w_of(wrong, cameras), w_of(slow(wrong, 0.98), cameras)):
        assert order[np.argmax(w)] == row
    assert w_of(slow(wrong, 0.98), cameras).max() > 1.1 * w_of(wrong, cameras).max()


@pytest.mark.parametrize("share", [0.0, 0.9])
def test_cost_is_that_of_the_joint_covariance_of_all_rays(rig, calibration, share):
    """Against dense matrices: rays share the errors of their exposures and of the calibration."""
    timed = blocks.in_strips(rig, 2) if share else rig
    block = slow(blocks.noisy(timed, np.random.default_rng(4)), share)
    posed = direct.georeference(block, calibration)
    posed = replace(posed, cov_parameters=25.0 * posed.cov_parameters)
    selected = rays(block)
    at = direct.intersect_rays(block, posed, selected)
    n, exposure = len(selected.group), block.images.exposure_idx[selected.image_idx]
    cov = np.diag(np.repeat(selected.sigma_px**2, 2))
    points = np.zeros((2 * n, 3 * selected.n_groups))
    for i in range(n):
        points[2 * i : 2 * i + 2, 3 * selected.group[i] :][:, :3] = at.by_point[i]
        for j in range(n):
            body = posed.cov_body[exposure[i]] * (exposure[i] == exposure[j])
            if share and exposure[i] != exposure[j]:
                body = posed.shared.between(exposure[[i]], exposure[[j]])[0]
            D = [at.by_parameters[k] for k in (i, j)]
            both = at.by_body[i] @ body @ at.by_body[j].T + D[0] @ posed.cov_parameters @ D[1].T
            cov[2 * i : 2 * i + 2, 2 * j : 2 * j + 2] += both
    root = np.linalg.inv(np.linalg.cholesky(cov))
    right, left = root @ at.v.ravel(), root @ points
    solved = np.linalg.lstsq(left, right, rcond=None)[0]
    least = np.sum((right - left @ solved) ** 2)
    assert ray_tests.cost(block, posed, selected) == pytest.approx(least, rel=1e-6)
    held = replace(posed, cov_parameters=0.0 * posed.cov_parameters)
    assert least < 0.999 * ray_tests.cost(block, held, selected)
