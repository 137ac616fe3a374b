"""Chapter 4 changed as it suggests: one argument, and everything below follows."""

import numpy as np
import pytest

import acx4sim
from acx4lib import flight as flights
from acx4lib.least_squares.covariance import sigmas
from acx4lib.stages import mounting
from support.changed_notebook import changed

CHOICES = "refraction, smallest_angle = flight.refraction, block.smallest_angle"
FACTORS = "factors: dict[str, float] = {}"
READ = "calibrations = stages_validation.calibrations(flight, results_path, calibration_path)\n"


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A flight, and results with its calibration."""
    flight, results = tmp_path_factory.mktemp("flight") / "small", tmp_path_factory.mktemp("run")
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), flight)
    mounting.run(flights.read(flight), results)
    return flight, results


@pytest.fixture(scope="module")
def run(calibrated):
    """What the cells define, by the change."""
    flight, results = calibrated

    def one(changes=None):
        return changed("04", changes, flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run()


def of(names, rays):
    """Return the table of the last method's differences, without its unit."""
    return names["validated"].table().droplevel("unit").loc[rays]


def test_the_intersection_by_hand_is_the_librarys(as_it_is):
    library = as_it_is["library"]
    np.testing.assert_allclose(as_it_is["x"], library.x_m[0], atol=1e-4)  # one step: 0.1 mm
    np.testing.assert_allclose(as_it_is["sigma"], sigmas(library.cov[0]), rtol=1e-3)


def test_chi_square_by_hand_is_the_librarys(as_it_is):
    d, C = as_it_is["d"], as_it_is["C"]
    assert d @ np.linalg.solve(C, d) == pytest.approx(as_it_is["validated"].joint_chi_square)


def test_wider_angles_leave_fewer_and_better_pairs_and_the_same_points(run, as_it_is):
    wide = run({CHOICES: "refraction, smallest_angle = flight.refraction, np.radians(30)"})
    assert wide["validated"].n_failed > as_it_is["validated"].n_failed
    assert of(wide, "pairs")["RMS"]["height"] < 0.6 * of(as_it_is, "pairs")["RMS"]["height"]
    assert of(wide, "points").equals(of(as_it_is, "points"))


def test_a_trajectory_that_is_mistrusted_is_predicted_too_poor(run, as_it_is):
    doubted = run({FACTORS: 'factors = {"GNSS": 3.0, "roll, pitch": 3.0}'})
    before, after = of(as_it_is, "pairs"), of(doubted, "pairs")
    assert np.all(after["expected RMS"] > 1.3 * before["expected RMS"])
    np.testing.assert_allclose(after["RMS"], before["RMS"])
    assert doubted["validated"].joint_chi_square < 0.5 * as_it_is["validated"].joint_chi_square
    assert doubted["validated"].joint_chi_square_p < 0.001
    assert not any(doubted["honest"]["Single-step"].accepted)


def test_a_forgotten_lever_arm_is_seen_in_heights(run, as_it_is):
    line = "calibrations = {k: forgotten.lever_arm(camera) for k, camera in calibrations.items()}\n"
    without = run({READ: f"{READ}{line}"})
    assert of(without, "points")["RMS"]["height"] > of(as_it_is, "points")["RMS"]["height"]
    p = [names["validated"].joint_chi_square_p for names in (without, as_it_is)]
    assert p[0] < 0.001 < p[1]
