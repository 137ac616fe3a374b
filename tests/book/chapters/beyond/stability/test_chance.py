"""False alarms: closed forms for independent parameters, and the joint level."""

import numpy as np

from acx4book.chapters.beyond.stability import chance


def test_shares_of_independent_parameters_are_the_closed_form():
    n, k = 4000, 6
    found = chance.false_alarms(np.diag([1.0, 4.0, 1e-12, 9.0, 1e6, 1.0]), chance.LEVELS, seed=3)
    expected = {
        chance.EACH: 1 - (1 - chance.LEVELS) ** k,
        chance.HOLM: 1 - (1 - chance.LEVELS / k) ** k,
        chance.JOINT: chance.LEVELS,
    }
    for way, share in expected.items():
        spread = np.sqrt(share * (1 - share) / n)
        assert np.all(np.abs(found[way] - share) < 4.5 * spread), way


def test_the_share_at_a_level_is_that_of_the_level():
    shares = {"a": np.arange(len(chance.LEVELS), dtype=float)}
    assert chance.at(shares, 0.05) == {"a": float(list(chance.LEVELS).index(0.05))}
