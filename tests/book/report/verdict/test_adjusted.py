"""What is wrong with an adjustment fails by name."""

import json

from acx4book.report.adjustment import groups
from acx4book.report.material import read
from support.run_results import SINGLE, edit, edit_summary, state


def test_a_variance_of_unit_weight_far_from_one_fails(folder):
    edit_summary(folder, SINGLE, chi_square_p=0.0009, sigma0_squared=1.07)
    assert state(folder, "Global χ² test")[0] == "fails"
    assert "single-step (σ₀² = 1.07)" in state(folder, "Global χ² test")[1]
    edit_summary(folder, SINGLE, chi_square_p=0.0011)
    assert state(folder, "Global χ² test")[0] == "holds"


def test_a_gnss_sigma_that_is_2_5_times_too_small_is_named(folder):
    def optimistic(table):
        rows = (table["kind"] == "gnss") & (table["component"] == "height_m")
        ratio = next(
            g.ratio for g in groups.qualities(read(folder), SINGLE) if "GNSS, h" in g.group
        )
        table.loc[rows, "sigma"] = table.loc[rows, "sigma"].astype(float) * ratio / 2.5

    edit(folder, "residuals", optimistic)
    said = state(folder, "A priori standard deviations")
    assert said == ("fails", "GNSS, height of single-step: σ is 2.5 times too small.")


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
    said = json.loads((folder / "provenance.json").read_text())
    said["stages"]["mounting"]["flight"] = "0" * 64
    (folder / "provenance.json").write_text(json.dumps(said))
    answer = state(folder, "One state of the data")
    assert answer[0] == "fails"
    assert "after mounting had run" in answer[1]


def test_many_rejected_observations_are_no_single_errors(folder):
    n = read(folder).found.summary[SINGLE]["n_observations"]
    edit_summary(folder, SINGLE, n_rejected=int(0.01 * n))
    assert state(folder, "Gross errors")[0] == "holds"
    edit_summary(folder, SINGLE, n_rejected=int(0.01 * n) + 1)
    assert state(folder, "Gross errors")[0] == "fails"


def test_the_number_that_chance_rejects_stands_beside_the_number_found(folder):
    entry = read(folder).found.summary[SINGLE]
    answer = state(folder, "Gross errors")[1]
    assert f"chance alone takes out {entry['expected_rejections']:.1f}" in answer
    edit_summary(folder, SINGLE, n_rejected=4, expected_rejections=0.84)
    said = "Four observations" if "Four" in answer else "4 observations of "
    assert state(folder, "Gross errors")[1].startswith(said)
    assert "takes out 0.8;" in state(folder, "Gross errors")[1]


def test_a_group_that_contradicts_the_others_fails(folder):
    line = f"{SINGLE}: data snooping would reject 36 of 37 attitudes (pitch)"
    assert state(folder, "Observations agree with each other")[0] == "holds"
    edit_summary(folder, SINGLE, stopped=[line])
    assert state(folder, "Observations agree with each other") == ("fails", f"{line}.")


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
