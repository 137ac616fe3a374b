"""What mistakes leave, and that the commands name those that can be named."""

import numpy as np
import pytest

from acx4book.chapters.beyond.failures.examined import GROUPS, standardised, worst
from acx4book.chapters.beyond.failures.mistakes import GEOID_M


def test_without_a_mistake_nothing_is_said_and_residuals_are_as_large_as_sigma(found):
    clean = found["no mistake"]
    assert clean.check == clean.run == ()
    assert np.all(np.abs(standardised(clean) - 1) < 0.3)
    assert worst(clean)["off"] < 3.5


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("wrong sign", "pitch of opposite sign"),
        ("angles exchanged", "roll, pitch exchanged"),
        ("coordinates exchanged", "east_m and north_m were swapped in control_points.csv"),
        ("convergence", "heading from grid north"),
        ("delay", "s late"),
    ],
)
def test_check_names_the_mistake_before_any_adjustment(found, name, words):
    assert any(words in line for line in found[name].check)


def test_run_names_the_height_system(found):
    assert any("height system of control or trajectory" in line for line in found["geoid"].run)


@pytest.mark.parametrize(
    ("name", "parameter", "by"),
    [
        ("convergence", "boresight_kappa_deg", 1.22),  # of PROJ, at the field
        ("geoid", "lever_z_m", -GEOID_M),
        ("delay", "lever_x_m", -7.0),  # 70 m/s
    ],
)
def test_a_constant_mistake_goes_into_a_parameter_that_claims_to_be_certain(
    found, name, parameter, by
):
    off = worst(found[name])
    assert off.name == parameter
    assert off["error"] == pytest.approx(by, rel=0.02)
    assert off["off"] > 100


def test_one_direction_leaves_no_residual_and_large_sigmas(found):
    few, all_strips = found["one direction"], found["no mistake"]
    assert standardised(few).max() < 1.5
    ratio = few.parameters["sigma"] / all_strips.parameters["sigma"]
    assert ratio.min() > 1
    assert ratio["f_mm"] > 10


def test_what_is_refused_has_no_residuals(found):
    refused = found["coordinates exchanged"]
    assert worst(refused) is None
    assert standardised(refused).isna().all()
    assert list(standardised(refused).index) == list(GROUPS)


def test_no_sentence_names_a_folder_of_the_machine(found):
    assert not any("/tmp" in line for one in found.values() for line in (*one.check, *one.run))
