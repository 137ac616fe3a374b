"""The robust phase goes where most observations agree, and loses nothing where all do."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.start.robust import reweighted, robust_phase, sizes, spread
from acx4lib.bundle.uses import mounted_orientation
from support import blocks

FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def network_of(block):
    return mounted_orientation(blocks.approximate(block), free=FREE)


def interior(state):
    return np.array([getattr(state.interiors[0], name) for name in FREE])


def contaminated(block, rng, *, share):
    """Return the block with a share of its measurements wrong by 10 to 200 px, and which."""
    n = len(block.image_points)
    wrong = rng.permutation(n) < share * n
    size = np.exp(rng.uniform(np.log(10.0), np.log(200.0), n)) * wrong
    angle = rng.uniform(0, 2 * np.pi, n)
    by = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return blocks.changed(block, "image_point", by), wrong


def test_without_gross_errors_it_ends_at_the_least_squares_solution(noisy_block, mounted):
    network = network_of(noisy_block)
    state = robust_phase(network, network.start)
    sigma = np.sqrt(np.diag(mounted.solution.cov))[: len(FREE)]
    # weights between 1/4 and 1 for residuals up to the width of 4: a little less efficient
    assert np.all(np.abs(interior(state) - interior(mounted.state)) < 0.5 * sigma)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2])
def test_gross_errors_do_not_pull_it_along(noisy_block, mounted, rng, share):
    spoilt, wrong = contaminated(noisy_block, rng, share=share)
    network = network_of(spoilt)
    state = robust_phase(network, network.start)
    sigma = np.sqrt(np.diag(mounted.solution.cov))[: len(FREE)]
    assert np.all(np.abs(interior(state) - interior(mounted.state)) < 2 * sigma)
    u = sizes(*network.residuals(state)[0])[:, 0]
    assert np.mean(u[wrong[network.rows]] > 5) > 0.98  # few rays may agree with a wrong one
    assert np.mean(u[~wrong[network.rows]] > 5) < 0.01


def test_least_squares_is_pulled_along(noisy_block, mounted, rng):
    """So that the test above says something."""
    spoilt, _ = contaminated(noisy_block, rng, share=0.1)
    sigma = np.sqrt(np.diag(mounted.solution.cov))[: len(FREE)]
    pulled = interior(adjust(network_of(spoilt)).state) - interior(mounted.state)
    assert np.max(np.abs(pulled) / sigma) > 10


def test_redundancy_numbers_show_an_observation_that_draws_the_others_to_itself(noisy_block):
    """Control is so precise here that its error of 150 sigma shows in its rays instead."""
    by = np.zeros((9, 3))
    by[5, 2] = 3.0  # m
    network = network_of(blocks.changed(noisy_block, "control_point", by))
    first = adjust(network)
    redundancy = [group.redundancy for group in first.solution.groups]
    assert redundancy[1][5, 2] < 0.02
    unaware = robust_phase(network, first.state)
    assert abs(network.residuals(unaware)[1][0][5, 2]) < 0.02
    aware = robust_phase(network, first.state, redundancy)
    assert network.residuals(aware)[1][0][5, 2] == pytest.approx(-3.0, abs=0.3)


def test_sigmas_are_multiplied_where_asked(noisy_block):
    network = network_of(noisy_block)
    before = [sigma for _, sigma in network.residuals(network.start)]
    factors = [np.ones((len(before[0]), 1)), *(np.ones_like(sigma) for sigma in before[1:])]
    factors[0][7] = 2.0
    factors[1][3, 1] = 3.0
    factors[2][4] = 5.0
    factors[3][6, 2] = 7.0
    changed = reweighted(network, factors)
    after = [sigma for _, sigma in changed.residuals(network.start)]
    for sigma, factor, old in zip(after, factors, before, strict=True):
        assert_allclose(sigma, factor * old, rtol=1e-15)
    # rays keep their order, which takes long to find, and get the weights of the other sigma
    anew = replace(changed).packed
    assert_array_equal(changed.packed.rays.weight, anew.rays.weight)
    assert changed.packed.rays.xy is network.packed.rays.xy


def test_an_image_point_counts_by_its_length_and_others_by_component():
    assert_allclose(sizes(np.array([[3.0, -4.0]]), np.full((1, 2), 0.5)), [[10.0]])
    assert_allclose(sizes(np.array([[3.0, -4.0, 1.0]]), np.full((1, 3), 0.5)), [[6.0, 8.0, 2.0]])


def test_spread_is_one_at_least_and_ignores_what_takes_no_part(rng):
    v = 3 * rng.normal(size=(5000, 2))
    sigma = np.ones((5000, 2))
    assert spread(v, sigma) == pytest.approx(3.0, rel=0.05)
    assert spread(v / 100, sigma) == 1.0
    half = np.where(np.arange(5000)[:, None] < 2500, sigma, np.inf)
    assert spread(v, half) == pytest.approx(3.0, rel=0.05)
    assert spread(v[:0], sigma[:0]) == 1.0
