"""A validation with forgotten steps shows what the text beside it says."""

import numpy as np
import pytest

from acx4book.chapters.validation.forgotten_steps import validations
from acx4lib.calibration import mounting
from support.flights import simulated

FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")


@pytest.fixture(scope="module")
def flown():
    return simulated.fly("acx4-ideal", seed=1).flight


@pytest.fixture(scope="module")
def mountings(flown):
    return mounting.calibrate(flown.calibration, free=FREE)


def test_every_forgotten_step_of_georeferencing_is_seen(flown, mountings):
    table = validations(flown.validation, [mountings["single_step"].calibration]).set_index(
        "mistake"
    )
    rms = np.sqrt((table[["rms_east_m", "rms_north_m", "rms_height_m"]] ** 2).sum(axis=1))
    assert rms.idxmin() == "none"
    assert rms["boresight forgotten"] > 10.0  # m, 1.6 degrees at 1300 m
    assert rms["meridian convergence forgotten"] > 2.5  # m


def test_without_a_calibration_nothing_is_validated(flown):
    assert validations(flown.validation, []).empty
