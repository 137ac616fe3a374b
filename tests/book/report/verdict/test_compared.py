"""What contradicts the results from outside fails: declared mountings, heights, check points."""

import re

import pytest

from acx4book.report.material import read
from support.run_results import SINGLE, edit_summary, state

VALIDATED = "validation/single_step"


def edit_points(folder, **values):
    points = read(folder).found.summary[VALIDATED]["points"]
    edit_summary(folder, VALIDATED, points={**points, **values})


def test_a_declared_mounting_is_confirmed_or_fails_in_the_runs_own_words(folder):
    question = "Declared mounting confirmed"
    assert state(folder, question) == (
        "holds",
        "The estimates of the boresight of CAM agree with what flight.toml declares. Where it "
        "declares no σ, only a difference as large as a mistake counts.",
    )
    line = f"{SINGLE}: not confirmed: lever arm of CAM differs from the declared one"
    edit_summary(folder, SINGLE, not_confirmed=[line])
    assert state(folder, question) == ("fails", f"{line}.")
    edit_summary(folder, SINGLE, not_confirmed=[], declared={})
    assert state(folder, question)[0] == "note"


@pytest.mark.parametrize(("share", "expected"), [(0.009, "holds"), (-0.011, "fails")])
def test_heights_that_differ_by_more_than_a_hundredth_fail(folder, share, expected):
    edit_summary(folder, VALIDATED, height_offset_share=share)
    assert state(folder, "Heights of one system")[0] == expected
    edit_summary(folder, VALIDATED, height_offset_share=0.0)
    edit_summary(folder, SINGLE, height_scale_error=share)
    assert state(folder, "Heights of one system")[0] == expected


@pytest.mark.parametrize(("p", "expected"), [(0.0004, "fails"), (0.002, "holds")])
def test_a_p_of_0_0004_does_not_hold(folder, p, expected):
    edit_summary(folder, VALIDATED, joint_chi_square_p=p)
    found = state(folder, "Independent check points")
    assert found[0] == expected
    assert f"p = {p}" in found[1]


@pytest.mark.parametrize(("sigmas", "expected"), [(3.2, "holds"), (3.4, "fails")])
def test_a_mean_is_tested_with_its_own_sigma(folder, sigmas, expected):
    sigma = read(folder).found.summary[VALIDATED]["points"]["mean_sigma"][2]
    edit_points(folder, mean=[0.0, 0.0, sigmas * sigma])
    found = state(folder, "Independent check points")
    assert found[0] == expected
    assert bool(re.search(r"a mean of \+\d\.\d\d m in height", found[1])) == (expected == "fails")


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, "holds"), (0.2, "fails"), (1.9, "fails")])
def test_a_normalised_spread_outside_its_limits_fails(folder, ratio, expected):
    """24 independent differences spread by chance between 0.58 and 1.52 of sigma."""
    edit_points(folder, normalised_rms=[1.0, ratio, 1.0], effective_number=[24.0] * 3)
    found = state(folder, "Independent check points")
    assert found[0] == expected
    assert (f"north {ratio:.2f} times the predicted RMS" in found[1]) == (expected == "fails")


def test_without_check_points_the_accuracy_is_not_shown(folder):
    edit_summary(folder, VALIDATED, n_points=1)
    assert state(folder, "Independent check points")[0] == "note"


def test_results_without_the_joint_test_say_so(folder):
    edit_summary(folder, VALIDATED, joint_chi_square_p=None)
    found = state(folder, "Independent check points")
    assert found[0] == "note"
    assert "run again" in found[1]
