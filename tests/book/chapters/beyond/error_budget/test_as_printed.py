"""The paper's own accuracies: the unexplained part, by hand where it can be found by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.error_budget import as_printed
from acx4book.paper import printed
from acx4lib.calibration.estimates import parameters
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.budget import SOURCES

BEST, POORER, _ = as_printed.assumptions()


def sources(found, case):
    calibration = as_printed.as_calibrated(found.calibrations["single_step"])
    return as_printed.sources(found.validations["single_step"], calibration, case)


def predicted(found, case):
    return budget.of(*sources(found, case))


@pytest.fixture(scope="module")
def best(found):
    return predicted(found, BEST)


@pytest.fixture(scope="module")
def suspects(found):
    return as_printed.suspects(*sources(found, BEST), BEST)


def test_sigma_are_those_of_table_3(found):
    said = as_printed.as_calibrated(found.calibrations["single_step"])
    of = {parameter.name: parameter.sigma for parameter in parameters(said)}
    assert of["f_mm"] == pytest.approx(0.0010)
    assert of["lever_z_m"] == pytest.approx(0.015)
    assert of["k3"] == pytest.approx(3.19e-15)
    # angles are reported about other axes, by less than three degrees
    assert of["boresight_kappa_deg"] == pytest.approx(0.00119, rel=0.05)


def test_cases_differ_in_what_they_say_alone(found, best):
    poorer = predicted(found, POORER).mean
    image = SOURCES.index("image points")
    assert_allclose(poorer[:, image], 9 * best.mean[:, image], rtol=1e-9)
    others = [i for i in range(len(SOURCES)) if i != image]
    assert_allclose(poorer[:, others], best.mean[:, others], rtol=1e-9, atol=1e-15)


def test_what_is_left_and_what_is_predicted_are_the_printed_rms(best):
    left = as_printed.unexplained(as_printed.rms(), best.rms)
    assert np.hypot(best.rms, left) == pytest.approx([0.44, 0.46, 0.45])
    assert as_printed.unexplained(np.array([0.3]), np.array([0.4])) == 0.0


def test_suspects_make_what_is_left_in_plan(suspects, best):
    left = as_printed.unexplained(as_printed.rms(), best.rms)
    for one in suspects:
        assert np.hypot(*one.rms[:2]) == pytest.approx(np.hypot(*left[:2]), rel=1e-9)
        assert one.size > 0


def test_the_size_of_a_suspect_is_that_which_makes_its_rms(found, suspects):
    """GNSS errors that large, put into the budget, give the RMS that the table says."""
    gnss = next(one for one in suspects if one.name == "GNSS")
    case = as_printed.Assumed(sigma_px=0.5, sigma_gnss_m=gnss.size)
    mean = predicted(found, case).mean[:, SOURCES.index("GNSS")]
    assert_allclose(np.sqrt(mean), gnss.rms, rtol=1e-6)


def test_no_error_of_single_rays_is_larger_in_plan_than_in_height(suspects):
    """A pair whose rays meet at a small angle has the poorer height."""
    free = {"boresight κ", "the targets themselves, in plan", "lever arm, forward", "boresight φ"}
    for one in suspects:
        assert (one.rms[2] > np.hypot(*one.rms[:2])) or one.name in free, one.name


def test_a_trajectory_as_printed_has_the_printed_angles():
    assert printed.statement("roll_pitch_deg") == 0.005
    assert [case.sigma_gnss_m for case in as_printed.assumptions()] == [0.05, 0.05, 0.3]
