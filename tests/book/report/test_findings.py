"""What is wrong with an adjustment fails by name."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report import adjustment
from acx4book.report.findings import findings
from acx4book.report.material import Material, read
from acx4files.results import folder as results
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.geometry.parameters import AXES, Prior
from support.run_results import SINGLE, edit, edit_summary, state


def made_of(folder, question):
    return next(f.tests for f in findings(read(folder)) if f.question == question)


@pytest.mark.parametrize(("sigma0_sq", "word"), [(1.27, "larger"), (0.018, "smaller")])
def test_a_variance_of_unit_weight_far_from_one_fails(folder, sigma0_sq, word):
    edit_summary(folder, SINGLE, chi_square_p=1e-5, sigma0_squared=sigma0_sq)
    state_, answer = state(folder, "Global χ² test")
    assert state_ == "fails"
    assert f"single-step (σ₀² = {sigma0_sq:.2f}): residuals are {word} than" in answer
    edit_summary(folder, SINGLE, chi_square_p=0.03)
    assert state(folder, "Global χ² test")[0] == "holds"  # one of many tests


@pytest.mark.parametrize(
    ("ratio", "expected"), [(0.9, "fails"), (0.92, "minor"), (1.09, "minor"), (1.11, "fails")]
)
def test_errors_that_are_less_than_a_tenth_from_their_sigma_do_not_matter(folder, ratio, expected):
    edit_summary(folder, SINGLE, chi_square_p=1e-12, sigma0_squared=ratio**2)
    found, answer = state(folder, "Global χ² test")
    assert found == expected
    minor = "Rejected, but below the size that matters: single-step"
    assert (minor in answer) == (found == "minor")
    off = max(ratio, 1 / ratio) - 1
    measured = f"(p <\N{NO-BREAK SPACE}0.0005; {100 * off:.2g} %, limit 10 %)"
    assert (measured in answer) == (found == "minor")


def test_an_adjustment_of_which_nothing_is_estimated_is_tested_too(folder):
    for name in ("parameters", "covariance"):
        file = folder / f"{name}.csv"
        file.write_text(file.read_text().partition("\n")[0] + "\n")
    edit_summary(folder, SINGLE, chi_square_p=1e-6, sigma0_squared=3.1)
    assert read(folder).calibration == ""
    assert state(folder, "All parameters determined")[0] == "untested"
    assert state(folder, "Global χ² test")[0] == "fails"
    assert state(folder, "A priori standard deviations")[0] == "holds"
    assert made_of(folder, "Gross errors")


def test_a_gnss_sigma_that_is_2_5_times_too_small_is_named(folder):
    def optimistic(table):
        rows = (table["kind"] == "gnss") & (table["component"] == "height_m")
        ratio = next(
            g.ratio for g in adjustment.decisive_qualities(read(folder)) if "GNSS, h" in g.group
        )
        table.loc[rows, "sigma"] = table.loc[rows, "sigma"].astype(float) * ratio / 2.5

    told = read(folder).found.summary[SINGLE]["sigma_tests"]
    wrong = {**told["GNSS, height"], "ratio": 2.5, "p": 1e-9}
    edit_summary(folder, SINGLE, sigma_tests={**told, "GNSS, height": wrong})
    edit(folder, "residuals", optimistic)
    group = next(g for g in adjustment.decisive_qualities(read(folder)) if "GNSS, h" in g.group)
    said = (
        "Significant: GNSS, height of single-step: σ is 2.5 times too small (stated "
        f"{group.sigma:.2g} m, by the residuals {2.5 * group.sigma:.2g} m)."
    )
    assert state(folder, "A priori standard deviations") == ("fails", said)


def test_what_another_method_leaves_open_is_a_note(folder):
    line = "mounting/two_step: CAM lever_z_m is not determined (sigma 2.1 m)"
    edit_summary(folder, "mounting/two_step", not_determined=[line])
    assert state(folder, "All parameters determined")[0] == "holds"
    found, answer = state(folder, "Other methods")
    assert found == "note"
    assert answer.startswith(line)


def test_what_is_not_determined_fails_with_the_runs_own_words(folder):
    line = "mounting/single_step: CAM lever_z_m is not determined (sigma 2.1 m)"
    edit_summary(folder, SINGLE, not_determined=[line])
    assert state(folder, "All parameters determined") == ("fails", f"{line}.")


def test_a_method_without_a_solution_fails(folder):
    edit_summary(folder, "mounting/two_step", converged=False)
    said = state(folder, "Convergence")
    assert said == ("fails", "No solution for two-step.")
    edit_summary(folder, "mounting/two_step", left_out=["mounting/two_step: no control points"])
    assert state(folder, "Convergence")[0] == "holds"


def test_a_flight_changed_between_stages_fails(folder):
    said = json.loads((folder / "summary.json").read_text())
    said["run"]["stages"]["mounting"]["flight"] = "0" * 64
    (folder / "summary.json").write_text(json.dumps(said))
    answer = state(folder, "One state of the data")
    assert answer[0] == "fails"
    assert "after mounting had run" in answer[1]


def reject(folder, n, w):
    """Put n rejected tie points of the single step in the results, the largest with w."""
    name = read(folder).flight.calibration.images.names[0]

    def rejected(table):
        for i in range(n):
            what = ["image_point", name, f"P{i}", w if i == 0 else 4.0, "w exceeds 3.9"]
            table.loc[1000 + i] = ["mounting", "single_step", *what]

    edit(folder, "rejected", rejected)
    edit_summary(folder, SINGLE, n_rejected=n, expected_rejections=0.15)
    edit_summary(folder, "validation/single_step", n_rejected=0, expected_rejections=0.05)


@pytest.mark.parametrize(
    ("n", "w", "expected"),
    [(0, 0.0, "holds"), (1, 4.1, "holds"), (1, 377.0, "fails"), (7, 4.2, "fails")],
)
def test_gross_errors_are_more_or_larger_than_chance_makes_them(folder, n, w, expected):
    reject(folder, n, w)
    found, answer = state(folder, "Gross errors")
    assert found == expected
    assert "where chance alone takes out 0.2" in answer
    assert ("the largest is w = 377.0" in answer) == (w == 377.0)
    assert ("7 observations rejected" in answer) == (n == 7)


@pytest.mark.parametrize(("n", "w"), [(1, 4.5), (4, 4.2), (7, 6.0)])
def test_the_probabilities_of_rejections_are_those_of_scipy(folder, n, w):
    reject(folder, n, w)
    number, largest = (test.p for test in made_of(folder, "Gross errors"))
    chance = 0.15 + 0.05
    assert_allclose(number, stats.poisson.sf(n - 1, chance))
    n_tested = chance / (2 * stats.norm.sf(CRITICAL))
    expected = -np.expm1(2 * n_tested * stats.norm.logcdf(w))  # of n_tested two-sided values
    assert_allclose(largest, expected, rtol=1e-3)


def test_where_nothing_was_rejected_nothing_is_unlikely(folder):
    reject(folder, 0, 0.0)
    assert [test.p for test in made_of(folder, "Gross errors")] == [1.0, 1.0]


def test_results_that_do_not_say_what_chance_rejects_are_not_tested(folder):
    edit_summary(folder, SINGLE, expected_rejections=None)
    assert state(folder, "Gross errors")[0] == "untested"


@pytest.mark.parametrize(("p", "expected"), [(1e-4, "fails"), (0.04, "holds")])
def test_a_boresight_that_steps_between_strips_fails(folder, p, expected):
    told = read(folder).found.summary[SINGLE]["boresight_stability"]
    edit_summary(folder, SINGLE, boresight_stability={**told, "strips": {**told["strips"], "p": p}})
    found, answer = state(folder, "Boresight stable over time")
    assert found == expected
    assert ("differences between strips, most of all" in answer) == (expected == "fails")


def test_a_boresight_that_was_not_tested_says_why(folder):
    question = "Boresight stable over time"
    edit_summary(folder, SINGLE, boresight_stability={"strips": None, "drift": None})
    assert state(folder, question)[0] == "untested"
    summary = json.loads((folder / "summary.json").read_text())
    del summary[SINGLE]["boresight_stability"]  # as in results of earlier versions
    (folder / "summary.json").write_text(json.dumps(summary))
    assert "run again" in state(folder, question)[1]


def test_a_group_that_contradicts_the_others_fails(folder):
    line = f"{SINGLE}: data snooping would reject 36 of 37 attitudes (pitch)"
    assert state(folder, "Observations agree with each other")[0] == "holds"
    edit_summary(folder, SINGLE, stopped=[line])
    assert state(folder, "Observations agree with each other") == ("fails", f"{line}.")


def test_what_stops_another_method_is_a_note(folder):
    line = "validation/two_step: data snooping would reject 18 of 50 rays of camera CAM"
    edit_summary(folder, "validation/two_step", stopped=[line])
    assert state(folder, "Observations agree with each other")[0] == "holds"
    assert line in state(folder, "Other methods")[1]
    own = line.replace("two_step", "single_step")
    edit_summary(folder, "validation/single_step", stopped=[own])
    assert state(folder, "Observations agree with each other") == ("fails", f"{own}.")
    assert state(folder, "Gross errors")[0] == "untested"  # nothing was rejected, and so not tested


def test_attitudes_that_an_earlier_version_rejected_away_fail_too(folder):
    """36 of 37 attitudes are in rejected.csv, and nothing in the summary says so."""
    exposures = read(folder).flight.calibration.trajectory.exposures[:36]

    def rejected(table):
        for i, name in enumerate(exposures):
            what = ["attitude", name, "", 90.0, "attitude: w = 90.0 exceeds 3.9"]
            table.loc[1000 + i] = ["mounting", "single_step", *what]

    edit(folder, "rejected", rejected)
    answer = f"{SINGLE}: 36 of 37 attitudes were rejected."
    assert state(folder, "Observations agree with each other") == ("fails", answer)


# --- What contradicts the results from outside fails: declared mountings, heights, check points


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
    assert found == "untested"
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
    said = f"an RMS in north that is {ratio:.3f} times the predicted one"
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
    assert state(folder, CHECKED)[0] == "untested"


def test_results_without_the_joint_test_say_so(folder):
    edit_summary(folder, VALIDATED, joint_chi_square_p=None)
    assert "run again" in state(folder, CHECKED)[1]
