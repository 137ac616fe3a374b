"""Many tests at one joint level: Holm's own numbers, and the level under any dependence."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.least_squares.statistical.many_tests import holm


def test_an_example_by_hand():
    p = np.array([0.01, 0.04, 0.03, 0.005])
    assert_allclose(holm(p), [0.03, 0.06, 0.06, 0.02])


def test_one_test_keeps_its_probability_and_none_exceeds_one():
    assert holm(np.array([0.3])) == 0.3
    assert_allclose(holm(np.array([0.6, 0.9])), [1.0, 1.0])
    assert len(holm(np.zeros(0))) == 0


def test_a_test_that_was_not_made_does_not_count():
    assert_allclose(holm(np.array([np.nan, 0.01, 0.2])), [np.nan, 0.02, 0.2])


def test_it_rejects_whatever_bonferroni_rejects(rng):
    p = rng.uniform(size=(100, 7)) ** 3
    assert all(np.all(holm(row) <= np.minimum(1, 7 * row) + 1e-15) for row in p)


def test_the_level_holds_for_correlated_tests(rng):
    n, level = 4000, 0.05
    for rho in (0.0, 0.9):
        common, own = rng.standard_normal((n, 1)), rng.standard_normal((n, 10))
        z = np.sqrt(rho) * common + np.sqrt(1 - rho) * own
        p = 2 * stats.norm.sf(np.abs(z))
        alarms = np.mean([holm(row).min() < level for row in p])
        assert alarms < level + 4 * np.sqrt(level * (1 - level) / n)


def test_only_a_row_of_probabilities_is_taken():
    with pytest.raises(ValueError, match=r"p: expected shape \(n,\)"):
        holm(np.zeros((2, 2)))
