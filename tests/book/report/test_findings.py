"""What is wrong with the results of a run fails by name."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report.findings import AGAIN, findings
from acx4book.report.groups import qualities
from acx4book.report.material import Material, read
from acx4files.results import folder as results
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.geometry.parameters import AXES, Prior
from support.run_results import SINGLE, edit, edit_summary, state

VALIDATED = "validation/single_step"
TWO_STEP = "mounting/two_step"

STABLE = "Boresight stable over time"
AGREE = "Observations agree with each other"
DECLARED = "Declared mounting confirmed"
HEIGHTS = "Heights of one system"
CHECKED = "Independent check points"
SIGMA, GROSS = "Global χ² test", "Gross errors"

MANY = "data snooping would reject 36 of 37 attitudes (pitch)"
OPEN = "CAM lever_z_m is not determined (sigma 2.1 m)"
NO_TURNS = {"strips": None, "drift": None}


def declared(part, **told):
    whole = {"difference": [0.0, 0.0, 3.4], "p": None, "confirmed": True, "mistake": ""}
    whole["told"] = "differs by (+0.00, +0.00, +3.40)"
    return {"declared": {f"CAM/{part}": whole | told}}


def fit(p, sigma0_sq):
    return {"chi_square_p": p, "sigma0_squared": sigma0_sq}


def joint(p):
    return {"joint_chi_square_p": p, "joint_chi_square": 1.0}


SAID = [
    (TWO_STEP, {"converged": False}, "Convergence", "fails", "no solution for two-step."),
    (TWO_STEP, {"converged": False, "left_out": ["no control"]}, "Convergence", "holds", ""),
    (SINGLE, {"not_determined": [OPEN]}, "All parameters determined", "fails", f"{OPEN}."),
    (TWO_STEP, {"not_determined": [OPEN]}, "All parameters determined", "holds", ""),
    (TWO_STEP, {"not_determined": [OPEN]}, "Other methods", "note", f"{OPEN}; this report"),
    (SINGLE, {"stopped": [MANY]}, AGREE, "fails", f"{MANY}."),
    (VALIDATED, {"stopped": [MANY]}, AGREE, "fails", f"{MANY}."),
    ("validation/two_step", {"stopped": [MANY]}, AGREE, "holds", ""),
    ("validation/two_step", {"stopped": [MANY]}, "Other methods", "note", MANY),
    # nothing was rejected, and so not tested
    (VALIDATED, {"stopped": [MANY]}, GROSS, "untested", "rejections say nothing"),
    (SINGLE, {"expected_rejections": None}, GROSS, "untested", AGAIN),
    (SINGLE, {"weak": [f"{SINGLE}: lever z is weak"]}, "Weak parameters", "note", "lever z is"),
    (SINGLE, {"boresight_stability": NO_TURNS}, STABLE, "untested", "It needs attitudes"),
    # variances of unit weight: significant, and large enough to matter from a tenth of sigma on
    (SINGLE, fit(1e-5, 1.27), SIGMA, "fails", "1.27): residuals are larger"),
    (SINGLE, fit(1e-5, 0.018), SIGMA, "fails", "residuals are smaller"),
    (SINGLE, fit(0.03, 1.27), SIGMA, "holds", ""),  # of many tests
    (SINGLE, fit(1e-12, 0.9**2), SIGMA, "fails", "single-step"),
    (SINGLE, fit(1e-12, 0.92**2), SIGMA, "minor", "8.7 %, limit 10 %)"),
    (SINGLE, fit(1e-12, 1.09**2), SIGMA, "minor", "9 %, limit 10 %)"),
    (SINGLE, fit(1e-12, 1.11**2), SIGMA, "fails", "single-step"),
    # without sigma an approximation, however far off, but for a known mistake
    (SINGLE, declared("boresight"), DECLARED, "untested", "not tested: boresight of CAM differs"),
    (SINGLE, declared("boresight", mistake="it is turned"), DECLARED, "fails", "); it is turned"),
    (SINGLE, declared("lever_arm", told="", mistake="is 31 m"), DECLARED, "fails", "CAM is 31 m"),
    (SINGLE, declared("lever_arm", p=2e-4), DECLARED, "fails", "Significant: lever arm of CAM"),
    (SINGLE, declared("lever_arm", p=0.02), DECLARED, "holds", "agrees with the estimates"),
    (SINGLE, {"declared": {}, "stopped": [MANY]}, DECLARED, "untested", "contradict each other"),
    (SINGLE, {"declared": {}}, DECLARED, "untested", "is held, or not determined"),
    (VALIDATED, {"height_offset_share": 0.009}, HEIGHTS, "holds", ""),
    (VALIDATED, {"height_offset_share": -0.011}, HEIGHTS, "fails", "1.1 % of the flying height"),
    (SINGLE, {"height_scale_error": -0.011, "height_scale_sigma": 0.0}, HEIGHTS, "fails", SINGLE),
    (SINGLE, {"height_scale_error": 0.098, "height_scale_sigma": 0.05}, HEIGHTS, "holds", "is 5 %"),
    (SINGLE, {"height_scale_error": 0.098, "height_scale_sigma": 0.02}, HEIGHTS, "fails", ""),
    (VALIDATED, joint(4e-4), CHECKED, "fails", "together are smaller"),
    (VALIDATED, joint(0.02), CHECKED, "holds", ""),
    (VALIDATED, {"joint_chi_square_p": None}, CHECKED, "holds", AGAIN),
    (VALIDATED, fit(1e-9, 0.018), CHECKED, "fails", "meet more closely"),
    (VALIDATED, fit(1e-9, 2.5), CHECKED, "fails", "less closely than predicted (σ₀² = 2.50)"),
]  # fmt: skip
"""Entry of summary.json, what it says, question, and the state and a part of the answer."""


@pytest.mark.parametrize(("entry", "said", "question", "expected", "part"), SAID)
def test_what_a_run_says_is_the_answer_to_a_question(folder, entry, said, question, expected, part):
    edit_summary(folder, entry, **said)
    found, answer = state(folder, question)
    assert found == expected
    assert part in answer


def test_good_results_hold(run):
    states = {f.question: f.state for f in findings(run)}
    assert {states[q] for q in (AGREE, SIGMA, GROSS, STABLE, HEIGHTS, CHECKED)} == {"holds"}


def made_of(folder, question):
    return next(f.tests for f in findings(read(folder)) if f.question == question)


def test_an_adjustment_of_which_nothing_is_estimated_is_tested_too(folder):
    for name in ("parameters", "covariance"):
        file = folder / f"{name}.csv"
        file.write_text(file.read_text().partition("\n")[0] + "\n")
    edit_summary(folder, SINGLE, chi_square_p=1e-6, sigma0_squared=3.1)
    assert read(folder).calibration == ""
    assert state(folder, "All parameters determined")[0] == "untested"
    assert state(folder, SIGMA)[0] == "fails"
    assert state(folder, "A priori standard deviations")[0] == "holds"
    assert made_of(folder, GROSS)


def test_a_gnss_sigma_that_is_2_5_times_too_small_is_named(folder):
    (old,) = (g for g in qualities(read(folder)) if g.group == "GNSS, height")

    def optimistic(table):
        rows = (table["kind"] == "gnss") & (table["component"] == "height_m")
        table.loc[rows, "sigma"] = table.loc[rows, "sigma"].astype(float) * old.ratio / 2.5

    told = read(folder).found.summary[SINGLE]["sigma_tests"]
    wrong = {**told["GNSS, height"], "ratio": 2.5, "p": 1e-9}
    edit_summary(folder, SINGLE, sigma_tests={**told, "GNSS, height": wrong})
    edit(folder, "residuals", optimistic)
    sigma = old.sigma * old.ratio / 2.5
    said = (
        "Significant: GNSS, height of single-step: σ is 2.5 times too small (stated "
        f"{sigma:.2g} m, by the residuals {2.5 * sigma:.2g} m)."
    )
    assert state(folder, "A priori standard deviations") == ("fails", said)


def test_weights_that_were_estimated_are_within_their_bounds_or_fail(folder):
    question, factors = "Estimated weights within bounds", {"GNSS": {"applied": 1.3}}
    edit_summary(folder, SINGLE, sigma_factors=factors)
    assert state(folder, question)[0] == "holds"
    edit_summary(folder, SINGLE, sigma_beyond=["the factor of GNSS is 7"])
    assert state(folder, question) == ("fails", "the factor of GNSS is 7.")


def test_a_flight_changed_between_stages_fails(folder):
    said = json.loads((folder / "summary.json").read_text())
    said["run"]["stages"]["mounting"]["flight"] = "0" * 64
    (folder / "summary.json").write_text(json.dumps(said))
    found, answer = state(folder, "One state of the data")
    assert found == "fails"
    assert "after mounting had run" in answer


# --- gross errors: their number and their size, by chance ------------------------------------


def reject(folder, n, w):
    """Put n rejected tie points of the single step in the results, the largest with w."""
    name = read(folder).flight.calibration.images.names[0]

    def rejected(table):
        for i in range(n):
            what = ["image_point", name, f"P{i}", w if i == 0 else 4.0, "w exceeds 3.9"]
            table.loc[1000 + i] = ["mounting", "single_step", *what]

    edit(folder, "rejected", rejected)
    edit_summary(folder, SINGLE, n_rejected=n, expected_rejections=0.15)
    edit_summary(folder, VALIDATED, n_rejected=0, expected_rejections=0.05)


@pytest.mark.parametrize(
    ("n", "w", "expected"),
    [(0, 0.0, "holds"), (1, 4.1, "holds"), (1, 377.0, "fails"), (7, 4.2, "fails")],
)
def test_gross_errors_are_more_or_larger_than_chance_makes_them(folder, n, w, expected):
    reject(folder, n, w)
    found, answer = state(folder, GROSS)
    assert found == expected
    assert "where chance alone takes out 0.2" in answer
    assert ("the largest is w = 377.0 (image point" in answer) == (w == 377.0)
    assert ("7 observations rejected" in answer) == (n == 7)
    if n == 0:
        assert [test.p for test in made_of(folder, GROSS)] == [1.0, 1.0]


@pytest.mark.parametrize(("n", "w"), [(1, 4.5), (4, 4.2), (7, 6.0)])
def test_the_probabilities_of_rejections_are_those_of_scipy(folder, n, w):
    reject(folder, n, w)
    number, largest = (test.p for test in made_of(folder, GROSS))
    chance = 0.15 + 0.05
    assert_allclose(number, stats.poisson.sf(n - 1, chance))
    n_tested = chance / (2 * stats.norm.sf(CRITICAL))
    expected = -np.expm1(2 * n_tested * stats.norm.logcdf(w))  # of n_tested two-sided values
    assert_allclose(largest, expected, rtol=1e-3)


# --- the mounting ----------------------------------------------------------------------------


@pytest.mark.parametrize(("p", "expected"), [(1e-4, "fails"), (0.04, "holds")])
def test_a_boresight_that_steps_between_strips_fails(folder, p, expected):
    strips = {"names": ["1", "2"], "turns_deg": [[0.0, 0.01, -0.002], [0.0, -0.01, 0.002]]}
    strips |= {"sigma_deg": [[0.004, 0.002, None], [0.004, 0.002, 0.004]], "p": p}
    strips |= {"f": 4.5, "dof": 3, "redundancy": 61.5}
    edit_summary(folder, SINGLE, boresight_stability={"strips": strips, "drift": None})
    found, answer = state(folder, STABLE)
    assert found == expected
    said = "differences between strips, most of all +0.0100° ± 0.0020° about y of strip 1"
    assert (said in answer) == (expected == "fails")


def test_a_flight_that_declares_no_mounting_is_told_what_that_hides(folder):
    edit_summary(folder, SINGLE, declared={})
    run = read(folder)
    cameras = {name: replace(one, prior=Prior()) for name, one in run.flight.cameras.items()}
    bare = Material(
        found=run.found, flight=replace(run.flight, cameras=cameras), provenance=run.provenance
    )
    assert "declares no mounting" in state(bare, DECLARED)[1]


# --- check points ----------------------------------------------------------------------------


def edit_points(folder, **values):
    points = read(folder).found.summary[VALIDATED]["points"]
    edit_summary(folder, VALIDATED, points={**points, **values})


@pytest.mark.parametrize(("sigmas", "expected"), [(2.2, "holds"), (4.2, "fails")])
def test_a_mean_is_tested_with_its_own_sigma(folder, sigmas, expected):
    sigma = read(folder).found.summary[VALIDATED]["points"]["mean_sigma"][2]
    edit_points(folder, mean=[0.0, 0.0, sigmas * sigma])
    found, answer = state(folder, CHECKED)
    assert found == expected
    said = f"a mean of {sigmas * sigma:+.2f} ± {sigma:.2f} m in height"
    assert (said in answer) == (expected == "fails")


@pytest.mark.parametrize(("ratio", "expected"), [(1.0, "holds"), (0.2, "fails"), (2.1, "fails")])
def test_a_normalised_spread_outside_its_limits_fails(folder, ratio, expected):
    edit_points(folder, normalised_rms=[1.0, ratio, 1.0], effective_number=[24.0] * 3)
    found, answer = state(folder, CHECKED)
    assert found == expected
    said = f"an RMS in north that is {ratio:.3f} times the predicted one"
    assert (said in answer) == (expected == "fails")


@pytest.mark.parametrize(
    ("n", "ratio", "expected"), [(0, 0.0, "untested"), (2, 1.0, "holds"), (2, 10.0, "fails")]
)
def test_check_points_of_the_calibration_block_are_tested_one_by_one(folder, n, ratio, expected):
    row = {"stage": "mounting", "method": "single_step", "n_images": 4}
    row |= {f"d_{axis}_m": 0.01 for axis in AXES} | {f"sigma_{axis}_m": 0.05 for axis in AXES}
    rows = [{**row, "point": f"C{i}"} for i in range(n)]
    for first in rows[:1]:
        first["d_height_m"] = 0.05 * ratio
    columns = list(results.COLUMNS["check_points"])
    pd.DataFrame(rows, columns=columns).to_csv(folder / "check_points.csv", index=False)
    edit_summary(folder, VALIDATED, n_points=0)
    found, answer = state(folder, CHECKED)
    assert found == expected
    said = "2 check points, tested one by one" if n else "the accuracy on the ground is not shown"
    assert said in answer
    assert ("a single check point: the largest difference is +0.50" in answer) == (ratio == 10.0)
