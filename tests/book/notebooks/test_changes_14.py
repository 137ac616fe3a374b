"""Chapter 14: what mistakes leave, what commands say of them, and what is computed by hand."""

import numpy as np
import pytest

from acx4book.chapters.beyond.failures import tables
from acx4book.chapters.beyond.failures.examined import GROUPS, standardised, worst
from acx4book.typesetting.plain_text import shown
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""


@pytest.fixture(scope="module")
def as_it_is():
    return changed("14")


@pytest.fixture(scope="module")
def found(as_it_is):
    return as_it_is["found"]


def test_without_a_mistake_nothing_is_said_and_residuals_are_as_large_as_sigma(found):
    clean = found["no mistake"]
    assert clean.check == clean.run == ()
    assert not clean.named
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


def test_run_names_the_height_system_and_what_few_strips_leave_weak(found):
    assert any("height system of control or trajectory" in line for line in found["geoid"].run)
    assert any("CAM f_mm is weak" in line for line in found["one direction"].run)


@pytest.mark.parametrize(
    ("name", "parameter", "by"),
    [
        ("convergence", "boresight_kappa_deg", 1.22),  # of PROJ, at the field
        ("geoid", "lever_z_m", -45.0),
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


def test_one_direction_leaves_no_residual_and_large_sigmas(as_it_is):
    assert standardised(as_it_is["found"]["one direction"]).max() < 1.5
    assert as_it_is["ratio"].min() > 1
    assert as_it_is["ratio"]["f_mm"] > 10


def test_what_is_refused_has_no_residuals(found):
    refused = found["coordinates exchanged"]
    assert worst(refused) is None
    assert standardised(refused).isna().all()
    assert list(standardised(refused).index) == list(GROUPS)


def test_no_sentence_names_a_folder_of_the_machine(found):
    assert not any("/tmp" in line for one in found.values() for line in (*one.check, *one.run))


def test_the_words_of_the_commands_stand_there_unchanged(found):
    one = found["geoid"]
    text = one._repr_markdown_()
    assert all(shown(line) in text for line in (*one.check, *one.run))
    assert "(nothing odd)" in text  # of check
    assert found["no mistake"]._repr_markdown_().count("(nothing odd)") == 2


def test_every_mistake_has_a_row(found):
    table = tables.table(found)
    assert list(table["Mistake"]) == list(found)
    assert table.set_index("Mistake").loc["geoid", "wrong by"] == "-45 m"


def test_gross_errors_are_counted_against_those_that_were_planted(as_it_is):
    planted = {
        (e["kind"], e["image_or_exposure"], e.get("point", ""))
        for e in as_it_is["found"]["gross errors"].planted
    }
    assert len(as_it_is["gross"]) == len(planted)
    assert len(as_it_is["both"]) > 0.9 * len(planted)


def test_the_answer_sorts_the_mistakes_by_how_they_are_found(as_it_is):
    assert as_it_is["refused"] == ["coordinates exchanged"]
    assert as_it_is["cleaned"] == ["gross errors"]
    planned = ["wrong sign", "angles exchanged", "convergence", "geoid", "delay"]
    assert as_it_is["seen"] == planned
    assert sum(one.named for one in as_it_is["wrong_ones"].values()) == 7


def test_residuals_of_a_wrong_sign_are_those_of_the_library_and_twice_the_angle(as_it_is):
    np.testing.assert_allclose(as_it_is["by_hand"], as_it_is["library"], rtol=1e-9)
    both = np.sqrt(np.mean(as_it_is["library"][:2] ** 2))
    rms = standardised(as_it_is["found"]["wrong sign"])
    assert both == pytest.approx(rms["roll, pitch"], rel=1e-6)
    assert np.corrcoef(as_it_is["twice"], as_it_is["pitch"])[0, 1] > 0.99
    assert as_it_is["reading"].name == "pitch of opposite sign"


def test_a_mistake_of_a_reader_is_planted_in_the_same_way():
    """Heights that are 5 m wrong in place of 45 m move the lever arm by 5 m."""
    other = changed("14", {'control["height_m"] - 45.0': 'control["height_m"] - 5.0'})
    assert worst(other["found"]["geoid"])["error"] == pytest.approx(-5.0, rel=0.05)
