"""Where, when and in which attitude a plan is exposed."""

from dataclasses import replace

import numpy as np
import pytest

from acx4tools.planning.flown import CRAB_DEG, MOTION_DEG, SCATTER_M, exposures, flying_time_s
from acx4tools.planning.plan import Area, PlannedBlock, Points, Strip

STRIP = Strip(flying_height_m=500.0, course_deg=30.0, length_m=900.0, base_m=100.0)


def block(*strips, course_deg=30.0):
    return PlannedBlock(
        name="calibration",
        area=Area(east_m=0.0, north_m=0.0, course_deg=course_deg),
        strips={f"s{k}": strip for k, strip in enumerate(strips)},
        points=Points(layout="at"),
    )


def test_a_length_that_is_no_multiple_of_the_base_is_rounded_up():
    assert STRIP.n_exposures == 10
    assert replace(STRIP, length_m=901.0).n_exposures == 11
    assert replace(STRIP, length_m=0.0).n_exposures == 1


def test_exposures_lie_on_their_line_but_for_the_scatter():
    taken = exposures(block(STRIP, replace(STRIP, course_deg=210.0, left_m=80.0)))
    assert taken.names[:2] == ("s0-01", "s0-02")
    along = np.linspace(-450.0, 450.0, 10)
    off = taken.local - np.column_stack([np.r_[along, -along], np.repeat([0.0, 80.0], 10)])
    assert np.all(np.abs(off) <= 2 * SCATTER_M[:2] + 1e-9)
    assert np.all(np.abs(taken.flying_height_m - 500.0) <= 2 * SCATTER_M[2])


def test_the_aircraft_is_as_unsteady_as_it_says_and_the_same_in_every_run():
    taken, again = (exposures(block(replace(STRIP, length_m=40_000.0))) for _ in range(2))
    np.testing.assert_array_equal(taken.rph_deg, again.rph_deg)
    motion = taken.rph_deg - [0.0, 0.0, taken.rph_deg[:, 2].mean()]
    # clipped at two standard deviations, a normal distribution has 0.96 of its own
    np.testing.assert_allclose(motion.std(axis=0), 0.96 * MOTION_DEG, rtol=0.06)
    assert np.abs(motion[:, :2].mean(axis=0)).max() < 0.05
    related = np.corrcoef(motion.T)
    assert np.abs(related - np.eye(3)).max() < 0.15
    assert abs(taken.rph_deg[:, 2].mean() - 30.0) <= CRAB_DEG


def test_another_wind_moves_the_aircraft_as_much_and_otherwise():
    long = block(replace(STRIP, length_m=40_000.0))
    even, one, again, other = (exposures(long, wind=wind) for wind in (0, 1, 1, 2))
    np.testing.assert_array_equal(one.rph_deg, again.rph_deg)
    for taken in (one, other):
        assert np.abs(taken.rph_deg[:, 0] - even.rph_deg[:, 0]).max() > 1.0
        assert taken.rph_deg[:, :2].std() == pytest.approx(even.rph_deg[:, :2].std(), rel=0.1)
    assert np.abs(one.rph_deg[:, 0] - other.rph_deg[:, 0]).max() > 1.0


def test_exposures_stay_in_turn_however_short_the_base():
    short = block(replace(STRIP, base_m=3.0))
    assert all(np.all(np.diff(exposures(short, wind=k).time_s) > 0) for k in range(4))


def test_time_goes_on_by_base_over_speed_and_four_minutes_for_a_turn():
    fast = replace(STRIP, speed_m_s=50.0)
    taken = exposures(block(STRIP, fast))
    # an exposure is late by as much as it is ahead: along its line the speed is constant
    along = taken.local @ [1.0, 0.0]
    for rows, speed in ((slice(10), 70.0), (slice(10, 20), 50.0)):
        passed = along[rows] - along[rows][0]
        np.testing.assert_allclose(passed, speed * (taken.time_s[rows] - taken.time_s[rows][0]))
    ahead = along - np.tile(np.linspace(-450.0, 450.0, 10), 2)
    planned = taken.time_s - ahead / np.repeat([70.0, 50.0], 10)
    np.testing.assert_allclose(np.diff(planned)[:9], 100 / 70)
    assert planned[10] - planned[9] == pytest.approx(240.0)
    assert planned[11] - planned[10] == pytest.approx(2.0)
    assert flying_time_s((STRIP, fast)) == pytest.approx(planned[-1])
    assert flying_time_s(()) == 0.0
