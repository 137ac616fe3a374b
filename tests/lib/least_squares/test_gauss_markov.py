"""Errors that change slowly beside white noise."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.least_squares.gauss_markov import WHITE, GaussMarkov
from acx4sim.fly import gauss_markov


def test_the_correlation_is_that_of_the_processes_which_the_simulator_draws():
    """20 000 processes: a correlation is known to 0.02 at three standard deviations."""
    time_s = np.array([0.0, 2.0, 5.0, 60.0])
    walks = gauss_markov(time_s, np.full(20_000, 20.0), np.random.default_rng(1))
    process = GaussMarkov(share=0.5, time_constant_s=20.0)
    assert_allclose(process.together(time_s), np.corrcoef(walks), atol=0.02)


def test_the_origin_of_time_does_not_matter():
    process = GaussMarkov(share=0.5, time_constant_s=2.0)
    assert process.together(np.array([7.0, 9.0]))[0, 1] == pytest.approx(np.exp(-1.0))
    assert process.together(np.array([9.0, 7.0]))[0, 1] == pytest.approx(np.exp(-1.0))


def test_errors_are_white_unless_it_is_said_otherwise():
    assert WHITE.share == 0


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"share": 1.1}, "share: expected a number from 0 to 1, got 1.1"),
        ({"share": -0.1}, "share: expected"),
        ({"share": np.nan}, "share: expected"),
        ({"time_constant_s": 0.0}, "time_constant_s"),
    ],
)
def test_wrong_values_are_named(wrong, says):
    with pytest.raises(ValueError, match=says):
        GaussMarkov(**wrong)
