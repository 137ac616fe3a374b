"""A validation with forgotten steps shows what the text beside it says."""

import numpy as np

from acx4book.chapters.validation.forgotten_steps import validations


def test_every_forgotten_step_of_georeferencing_is_seen(ideal, mountings):
    table = validations(ideal.validation, [mountings["single_step"].calibration]).set_index(
        "mistake"
    )
    rms = np.sqrt((table[["rms_east_m", "rms_north_m", "rms_height_m"]] ** 2).sum(axis=1))
    assert rms.idxmin() == "none"
    assert rms["boresight forgotten"] > 10.0  # m, 1.6 degrees at 1300 m
    assert rms["meridian convergence forgotten"] > 2.5  # m


def test_without_a_calibration_nothing_is_validated(ideal):
    assert validations(ideal.validation, []).empty
