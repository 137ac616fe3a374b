"""Slow errors of a simulated trajectory, beyond white noise."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import acx4sim
from acx4sim import fly
from acx4sim.plan import SlowErrors

BLOCK = ("calibration",)
EXACT = {"image_noise": 0, "control_noise": 0, "gnss_noise": 0, "attitude_noise": 0}
SHIFT = ["east_m", "north_m", "height_m"]


def acx4(**options):
    return acx4sim.acx4_ideal(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def test_the_correlation_of_slow_errors_falls_exponentially():
    """The covariance of 20 000 processes, to four of its standard deviations."""
    time_s = np.array([0.0, 3.0, 6.0, 250.0, 1000.0])
    walks = fly.gauss_markov(time_s, np.full(20_000, 300.0), np.random.default_rng(5))
    expected = np.exp(-np.abs(time_s[:, None] - time_s) / 300.0)
    assert_allclose(walks @ walks.T / 20_000, expected, atol=4 * np.sqrt(2 / 20_000))


def errors(**options):
    """Return the errors of positions (m) and attitudes (body axes, deg) of the paper's block."""
    true, recorded = (acx4(**EXACT), acx4(**options))
    tables = [f.tables["calibration/trajectory.csv"] for f in (true, recorded)]
    R = [
        Rotation.from_euler("XYZ", t[["omega_deg", "phi_deg", "kappa_deg"]], degrees=True)
        for t in tables
    ]
    turn = (R[0].inv() * R[1]).as_rotvec(degrees=True)
    return (tables[1][SHIFT] - tables[0][SHIFT]).to_numpy(), turn


def test_a_share_of_the_noise_stays_white_and_keeps_its_values():
    white = errors()
    slow = errors(slow_errors=SlowErrors(gnss=1.0, attitude=0.0))
    both = errors(slow_errors=SlowErrors(gnss=0.8, attitude=0.0))
    assert_allclose(both[0], 0.8 * slow[0] + 0.6 * white[0], atol=3e-6)
    # attitudes refer to the grid's north at the recorded position, 1e-7 deg elsewhere
    assert_allclose(slow[1], white[1], atol=1e-6)


def test_slow_errors_of_an_endless_time_constant_are_one_shift():
    forever = SlowErrors(gnss=1.0, attitude=1.0, gnss_constant_s=1e12, attitude_constant_s=1e12)
    position, attitude = errors(slow_errors=forever)
    assert_allclose(position - position[0], 0.0, atol=5e-6)
    assert_allclose(attitude - attitude[0], 0.0, atol=1e-6)
    assert np.all(np.abs(position[0]) > 1e-4)
    assert np.all(np.abs(attitude[0]) < 4 * np.array([0.005, 0.005, 0.008]))


def test_a_strips_drift_is_linear_in_time_and_zero_at_its_middle():
    position, attitude = errors(**EXACT, gnss_strip_drift_m_per_min=(0.1, 0.0, 0.2))
    table = acx4().tables["calibration/trajectory.csv"]
    strip, minutes = table["exposure"].str[:2].to_numpy(), table["time_s"].to_numpy() / 60
    rates = []
    for name in np.unique(strip):
        here = strip == name
        line = np.polyfit(minutes[here] - minutes[here].mean(), position[here], 1)
        assert_allclose(line[1], 0.0, atol=2e-6)
        assert_allclose(
            position[here], np.outer(minutes[here] - minutes[here].mean(), line[0]), atol=2e-6
        )
        rates.append(line[0])
    assert_allclose(np.array(rates)[:, 1], 0.0, atol=1e-5)
    assert np.ptp(np.array(rates)[:, [0, 2]], axis=0).min() > 0.05
    assert_allclose(attitude, 0.0, atol=1e-6)


def test_a_delay_as_long_as_an_interval_records_the_next_exposures_pose():
    """Inside a strip the parabola goes through it; positions and attitudes by themselves."""
    true = acx4(**EXACT).tables["calibration/trajectory.csv"]
    k = 3
    step = float(true["time_s"][k + 1] - true["time_s"][k])
    angles = ["omega_deg", "phi_deg", "kappa_deg"]
    for option, late, kept in (
        ("gnss_delay_s", SHIFT, angles),
        ("attitude_delay_s", angles, SHIFT),
    ):
        found = acx4(**EXACT, **{option: step}).tables["calibration/trajectory.csv"]
        # m and degrees: times are written to 0.1 ms
        expected = true.loc[k + 1, late].to_numpy(float)
        assert_allclose(found.loc[k, late].to_numpy(float), expected, atol=0.02)
        assert_allclose(found[kept], true[kept], atol=1e-3)  # the grid turns along the way


def test_exposures_are_late_by_as_much_as_they_are_ahead():
    """Along every strip the ground speed is the plan's; times are written to 1 ms, 7 cm."""
    flight = acx4(**EXACT)
    table = flight.tables["calibration/trajectory.csv"]
    off = []
    for strip, own in table.groupby(table["exposure"].str[:2]):
        en, time = own[["east_m", "north_m"]].to_numpy(), own["time_s"].to_numpy()
        planned = flight.plan.blocks["calibration"].strips[int(strip[1]) - 1]
        course = np.radians(flight.plan.blocks["calibration"].azimuth_deg + planned.turn_deg)
        along = en @ [np.sin(course), np.cos(course)]
        passed = planned.speed_m_s * (time - time[0])
        assert_allclose(along - along[0], passed, atol=0.071)
        off.append(np.diff(time) - planned.base_m / planned.speed_m_s)
    assert np.std(np.concatenate(off)) > 0.05  # s: they are not at equal intervals


def test_exposures_stay_in_turn_however_short_the_base():
    block = acx4(**EXACT).plan.blocks["calibration"]
    short = replace(block, strips=tuple(replace(s, base_m=3.0) for s in block.strips))
    flown = fly.fly(acx4(**EXACT).plan, short, fly.stream(1, "short"))
    assert np.all(np.diff(flown.time_s) > 0)


def test_strips_may_be_flown_at_different_speeds():
    flight = acx4(**EXACT)
    block = flight.plan.blocks["calibration"]
    slow = replace(block, strips=tuple(replace(strip, speed_m_s=35.0) for strip in block.strips))
    assert_allclose(np.diff(fly._times(slow))[:9], 2 * np.diff(fly._times(block))[:9])
