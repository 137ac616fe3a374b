"""What contradicts the results from outside fails: declared mountings, heights, check points."""

import re
from dataclasses import replace

import pandas as pd
import pytest

from acx4book.report.material import Material, read
from acx4lib.geometry.parameters import AXES
from acx4lib.geometry.prior import Prior
from acx4lib.results import folder as results
from support.run_results import SINGLE, edit_summary, state

VALIDATED = "validation/single_step"


def edit_points(folder, **values):
    points = read(folder).found.summary[VALIDATED]["points"]
    edit_summary(folder, VALIDATED, points={**points, **values})


QUESTION = "Declared mounting confirmed"


def declare(folder, part, **told):
    whole = {"difference": [0.0, 0.0, 3.4], "p": None, "confirmed": True, "mistake": ""}
    told = {**whole, "told": "differs by (+0.00, +0.00, +3.40)", **told}
    edit_summary(folder, SINGLE, declared={f"CAM/{part}": told})


def test_a_mounting_without_sigma_is_an_approximation(folder):
    """However far off it is; the difference is said."""
    declare(folder, "boresight")
    found, answer = state(folder, QUESTION)
    assert found == "note"
    assert "approximation and not tested: boresight of CAM differs by (+0.00, +0.00" in answer
    declare(folder, "boresight", mistake="it is turned by 90° about the body's z axis")
    found, answer = state(folder, QUESTION)
    assert found == "fails"
    assert answer.startswith("boresight of CAM differs by")
    assert "turned by 90°" in answer
    declare(folder, "lever_arm", told="", mistake="is 31.0 m long, and none is declared: why?")
    assert state(folder, QUESTION)[1].startswith("lever arm of CAM is 31.0 m long, and none")


@pytest.mark.parametrize(("p", "expected"), [(2e-4, "fails"), (0.02, "holds")])
def test_a_mounting_with_sigma_is_tested_among_all_tests(folder, p, expected):
    declare(folder, "lever_arm", p=p, confirmed=True)
    found, answer = state(folder, QUESTION)
    assert found == expected
    assert ("Significant: lever arm of CAM differs" in answer) == (expected == "fails")


def test_why_nothing_was_compared_is_said(folder):
    line = f"{SINGLE}: data snooping would reject 36 of 37 attitudes (pitch)"
    edit_summary(folder, SINGLE, declared={}, stopped=[line])
    assert "observations contradict each other" in state(folder, QUESTION)[1]
    edit_summary(folder, SINGLE, stopped=[])
    assert "is held, or not determined" in state(folder, QUESTION)[1]
    run = read(folder)
    cameras = {name: replace(one, prior=Prior()) for name, one in run.flight.cameras.items()}
    bare = Material(
        found=run.found, flight=replace(run.flight, cameras=cameras), provenance=run.provenance
    )
    assert "declares no mounting" in state(bare, QUESTION)[1]


def test_results_of_an_earlier_version_fail_in_the_runs_own_words(folder):
    line = f"{SINGLE}: not confirmed: lever arm of CAM differs from the declared one"
    old = {"CAM/lever_arm": {"difference": [1.0, 0.0, 0.0], "p": None, "confirmed": False}}
    edit_summary(folder, SINGLE, not_confirmed=[line], declared=old)
    assert state(folder, QUESTION) == ("fails", f"{line}.")
    right = {"CAM/lever_arm": {"difference": [0.1, 0.0, 0.0], "p": 0.4, "confirmed": True}}
    edit_summary(folder, SINGLE, not_confirmed=[], declared=right)
    assert state(folder, QUESTION)[0] == "holds"


@pytest.mark.parametrize(("share", "expected"), [(0.009, "holds"), (-0.011, "fails")])
def test_heights_that_differ_by_more_than_a_hundredth_fail(folder, share, expected):
    edit_summary(folder, VALIDATED, height_offset_share=share)
    assert state(folder, "Heights of one system")[0] == expected
    edit_summary(folder, VALIDATED, height_offset_share=0.0)
    edit_summary(folder, SINGLE, height_scale_error=share)
    assert state(folder, "Heights of one system")[0] == expected


def test_heights_that_differ_by_less_than_the_focal_length_may_do_not_fail(folder):
    edit_summary(folder, VALIDATED, height_offset_share=0.0)
    edit_summary(folder, SINGLE, height_scale_error=0.098, height_scale_sigma=0.05)
    found, answer = state(folder, "Heights of one system")
    assert found == "holds"
    assert "not significant here: the σ of the focal length is 5 %" in answer
    edit_summary(folder, SINGLE, height_scale_error=0.098, height_scale_sigma=0.02)
    assert state(folder, "Heights of one system")[0] == "fails"


CHECKED = "Independent check points"


@pytest.mark.parametrize(("p", "expected"), [(0.0004, "fails"), (0.02, "holds")])
def test_differences_that_are_unlikely_together_fail(folder, p, expected):
    edit_summary(folder, VALIDATED, joint_chi_square_p=p, joint_chi_square=1.0)
    found, answer = state(folder, CHECKED)
    assert found == expected
    assert ("all differences together are smaller than" in answer) == (expected == "fails")


@pytest.mark.parametrize(("sigma0_sq", "word"), [(0.018, "more"), (2.5, "less")])
def test_rays_that_meet_closer_than_predicted_are_said_to(folder, sigma0_sq, word):
    edit_summary(folder, VALIDATED, chi_square_p=1e-9, sigma0_squared=sigma0_sq)
    found, answer = state(folder, CHECKED)
    assert found == "fails"
    assert f"rays meet {word} closely than predicted (σ₀² = {sigma0_sq:.2f})" in answer


@pytest.mark.parametrize(("sigmas", "expected"), [(2.2, "holds"), (4.2, "fails")])
def test_a_mean_is_tested_with_its_own_sigma(folder, sigmas, expected):
    sigma = read(folder).found.summary[VALIDATED]["points"]["mean_sigma"][2]
    edit_points(folder, mean=[0.0, 0.0, sigmas * sigma])
    found = state(folder, CHECKED)
    assert found[0] == expected
    assert bool(re.search(r"a mean of \+\d\.\d\d ± \d", found[1])) == (expected == "fails")


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, "holds"), (0.2, "fails"), (2.1, "fails")])
def test_a_normalised_spread_outside_its_limits_fails(folder, ratio, expected):
    edit_points(folder, normalised_rms=[1.0, ratio, 1.0], effective_number=[24.0] * 3)
    found = state(folder, CHECKED)
    assert found[0] == expected
    said = f"an RMS in north that is {ratio:.2f} times the predicted one"
    assert (said in found[1]) == (expected == "fails")


def leave_check_points(folder, n, ratio):
    """Leave n check points of the calibration block, the first off by so many sigma."""
    row = {"stage": "mounting", "method": "single_step", "n_images": 4}
    row |= {f"d_{axis}_m": 0.01 for axis in AXES} | {f"sigma_{axis}_m": 0.05 for axis in AXES}
    rows = [{**row, "point": f"C{i}"} for i in range(n)]
    if n:
        rows[0]["d_height_m"] = 0.05 * ratio
    columns = list(results.COLUMNS["check_points"])
    pd.DataFrame(rows, columns=columns).to_csv(folder / "check_points.csv", index=False)
    edit_summary(folder, VALIDATED, n_points=0)


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, "holds"), (10.0, "fails")])
def test_two_check_points_of_the_calibration_block_are_tested(folder, ratio, expected):
    leave_check_points(folder, 2, ratio)
    found, answer = state(folder, CHECKED)
    assert found == expected
    assert answer.startswith("2 check points, tested one by one")
    assert ("a single check point: the largest difference is +0.50" in answer) == (ratio == 10.0)


def test_without_check_points_the_accuracy_is_not_shown(folder):
    leave_check_points(folder, 0, 0.0)
    assert state(folder, CHECKED)[0] == "note"


def test_results_without_the_joint_test_say_so(folder):
    edit_summary(folder, VALIDATED, joint_chi_square_p=None)
    assert "run again" in state(folder, CHECKED)[1]
