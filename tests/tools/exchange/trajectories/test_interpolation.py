"""What lies between two records follows a motion in closed form."""

import numpy as np
import pytest

from acx4lib.geometry import frames
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories import interpolation, sbet

METRES = np.array([111_320.0, 111_320.0, 1.0])
EVENTS = np.linspace(0.3, 9.7, 40)


def at_rate(made, interval):
    times = np.arange(0, 10 + interval / 2, interval)
    track = sbet.read_track(Opened(file="a", data=made.sbet(times)))
    return track, interpolation.between(track.time, EVENTS)


def misfit_m(made, interval, *, by_velocity=True):
    truth = made.motion(EVENTS)[0]
    truth[:, :2] = np.degrees(truth[:, :2])
    track, at = at_rate(made, interval)
    found = interpolation.positions(track, at, by_velocity=by_velocity)
    return float(np.abs((found - truth) * METRES).max())


def test_positions_with_velocities_have_errors_of_the_fourth_power_of_the_interval(made):
    # h^4 / 384 of the fourth derivative; that of the height is 3 (2 pi / 8)^4 = 1.14 m/s^4
    coarse, fine = misfit_m(made, 0.5), misfit_m(made, 0.25)
    assert 0.3 * 1.9e-4 < coarse < 8 * 1.9e-4
    assert coarse / fine == pytest.approx(16, rel=0.2)
    assert misfit_m(made, 0.005) < 1e-6
    assert misfit_m(made, 0.5, by_velocity=False) > 0.03


def test_attitudes_turn_as_rotations_through_north(made):
    track, at = at_rate(made, 0.005)
    rph = interpolation.attitudes(track, at)
    truth = made.motion(EVENTS)[2]
    R, R_true = (frames.rotation_from_rph(one) for one in (rph, truth))
    assert np.abs(frames.log(np.swapaxes(R, 1, 2) @ R_true)).max() < 1e-7
    assert rph[:, 2].min() < 0.1  # the heading passes 360 degrees
    assert rph[:, 2].max() > 6.2


def test_records_across_the_antimeridian(made):
    records = np.frombuffer(made.sbet(np.array([0.0, 1.0]))).reshape(-1, 17).copy()
    records[:, 2] = [np.pi - 1e-6, -np.pi + 1e-6]
    records[:, 4:7] = 0.0
    track = sbet.read_track(Opened(file="a", data=records.tobytes()))
    at = interpolation.between(track.time, np.array([0.25, 0.75]))
    lon = interpolation.positions(track, at, by_velocity=False)[:, 0]
    assert np.abs(lon) == pytest.approx(180.0, abs=1e-4)
    assert np.sign(lon).tolist() == [1, -1]


def test_velocities_that_do_not_fit_are_seen(made):
    track, at = at_rate(made, 0.005)
    off, speed = interpolation.velocity_misfit(track, at)
    assert off < 0.3
    assert speed == pytest.approx(56.0, abs=3.0)
    records = track.record.copy()
    records["vy"] = -records["vy"]  # east in the place of west
    wrong = sbet.Track(source=track.source, time=track.time, record=records)
    assert interpolation.velocity_misfit(wrong, at)[0] > 30


def test_deviations_are_linear_between_records(made):
    of = sbet.read_deviations(Opened(file="a", data=made.smrmsg(np.array([0.0, 10.0]))))
    found = interpolation.deviations(of, np.array([5.0, 10.0]))
    assert found[0] == pytest.approx([0.03, 0.015, 0.045, 0.075, 0.15, 0.225])
    assert found[1] == pytest.approx([0.04, 0.02, 0.06, 0.1, 0.2, 0.3])
