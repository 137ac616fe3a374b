"""Verdicts of tests: significant among all, and large enough to matter."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.least_squares.verdict import (
    DISPLACED,
    FAILS,
    HOLDS,
    LEVEL,
    MATTERS,
    MINOR,
    UNTESTED,
    gravest,
    off_by,
    verdicts,
)


def judged(p, size, limit):
    return verdicts(*(np.array(column, dtype=float) for column in (p, size, limit)))


def test_a_verdict_needs_significance_among_all_and_a_size_that_matters():
    """Holm by hand: 0.001 x 4, 0.015 x 3, 0.02 x 2 but no less than before, 0.5."""
    found = judged(
        [0.015, 0.001, np.nan, 0.02, 0.5], [2.0, 0.05, 9.0, 1.0, 9.0], [1.0, 0.1, *[1.0] * 3]
    )
    assert [v.state for v in found] == [FAILS, MINOR, UNTESTED, FAILS, HOLDS]
    assert_allclose([v.p_joint for v in found], [0.045, 0.004, np.nan, 0.045, 0.5])
    assert [(v.p, v.size, v.limit) for v in found[:2]] == [(0.015, 2.0, 1.0), (0.001, 0.05, 0.1)]


def test_what_is_as_large_as_its_limit_matters_and_an_infinite_size_always_does():
    assert [v.state for v in judged([1e-9] * 2, [0.1, np.inf], [0.1, 1e9])] == [FAILS, FAILS]


def test_without_tests_there_is_no_verdict():
    assert judged([], [], []) == ()
    assert gravest([]) == UNTESTED


def test_right_data_are_rejected_as_often_as_the_level_says(rng):
    """10 tests, 4 000 times; three sigma of the count are 1 %."""
    size = np.full(10, np.inf)
    rejected = [
        any(v.state == FAILS for v in verdicts(p, size, np.zeros(10)))
        for p in rng.uniform(size=(4000, 10))
    ]
    assert_allclose(np.mean(rejected), LEVEL, atol=0.0103)


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ((HOLDS, UNTESTED), HOLDS),
        ((UNTESTED, UNTESTED), UNTESTED),
        ((HOLDS, MINOR, UNTESTED), MINOR),
        ((MINOR, FAILS, HOLDS), FAILS),
    ],
)
def test_the_gravest_state_counts(states, expected):
    assert gravest(states) == expected


def test_twice_and_half_differ_from_one_alike():
    assert off_by(2.0) == off_by(0.5) == 1.0
    assert off_by(1.0) == 0.0
    assert off_by(0.0) == np.inf


def test_a_displacement_at_its_limit_makes_errors_a_tenth_larger(rng):
    """As it is counted: a million errors of sigma 2, displaced by 2 times the limit."""
    errors = rng.normal(scale=2.0, size=1_000_000) + 2.0 * DISPLACED
    assert np.sqrt(np.mean(errors**2)) / 2.0 == pytest.approx(1 + MATTERS, abs=0.003)
