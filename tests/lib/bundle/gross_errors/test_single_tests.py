"""As many tests fail by chance as they should."""

import numpy as np
import pytest
from scipy import stats

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.gross_errors.single_tests import expected_failures
from acx4lib.bundle.uses import mounted_orientation
from support import blocks


def test_one_in_ten_thousand_components_fails(mounted):
    groups = mounted.solution.groups
    n = sum(int(group.used.sum()) for group in groups)
    assert expected_failures(mounted) == pytest.approx(n * 9.6e-5, rel=0.01)  # of a normal variable


def test_at_a_low_limit_that_many_fail(exact_block):
    """At a critical value of 2, 4.55 % of all w exceed it; tests of one flight are correlated."""
    found, predicted = 0, 0.0
    for seed in range(12):
        start = blocks.approximate(blocks.noisy(exact_block, np.random.default_rng(seed)))
        fit = adjust(mounted_orientation(start, free=("f", "xp", "yp", "k1", "p1", "p2")))
        found += sum(int(np.sum(np.abs(g.w[g.used]) > 2)) for g in fit.solution.groups)
        predicted += expected_failures(fit, critical=2.0)
    assert predicted > 500
    low, high = stats.poisson.interval(0.999, predicted)
    assert low < found < high
