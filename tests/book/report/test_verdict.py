"""The verdict of a report holds for a good run, and fails by name for spoilt results."""

import json
import re

import pytest

from acx4book.report import groups, verdict
from acx4book.report.material import Material, read
from acx4book.report.sections import verdict_table
from acx4book.report.verdict import findings, statement
from acx4lib.results import folder as results
from support.run_results import SINGLE, edit, edit_summary


def state(folder_or_run, question):
    material = folder_or_run if isinstance(folder_or_run, Material) else None
    found = findings(material or read(folder_or_run))
    return next((f.state, f.answer) for f in found if f.question == question)


def test_a_good_run_holds(run):
    found = findings(run)
    assert [f.question for f in found if f.state == verdict.FAILS] == []
    n = sum(f.state == verdict.HOLDS for f in found)
    said = f"**The results hold.** All {n} tests of this report are passed."
    assert statement(found) == said
    assert n >= 7


def test_a_variance_of_unit_weight_far_from_one_fails(folder):
    edit_summary(folder, SINGLE, chi_square_p=0.049, sigma0_squared=1.07)
    assert state(folder, "Global χ² test")[0] == "fails"
    assert "single-step (σ₀² = 1.07)" in state(folder, "Global χ² test")[1]
    edit_summary(folder, SINGLE, chi_square_p=0.051)
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


@pytest.mark.parametrize(("lift_m", "expected"), [(0.6, "note"), (2.0, "fails")])
def test_check_points_that_are_all_high_are_noted_and_fail_beyond_the_predicted_sigma(
    folder, lift_m, expected
):
    """sigma in height is 0.45 m: what all points share may be 0.6 m, but not 2 m."""

    def lift(table):
        table["d_height_m"] = table["d_height_m"].astype(float) + lift_m

    edit(folder, "check_points", lift)
    answer = state(folder, "Independent check points")
    assert answer[0] == expected
    assert re.search(r"a mean of \+\d\.\d\d m in height", answer[1])
    assert "in east" not in answer[1].partition("Significant")[2]


def test_without_check_points_the_accuracy_is_not_shown(folder):
    header = ",".join(results.COLUMNS["check_points"])
    (folder / "check_points.csv").write_text(header + "\n")
    assert state(folder, "Independent check points")[0] == "note"


def test_many_rejected_observations_are_no_single_errors(folder):
    n = read(folder).found.summary[SINGLE]["n_observations"]
    edit_summary(folder, SINGLE, n_rejected=int(0.01 * n))
    assert state(folder, "Gross errors")[0] == "holds"
    edit_summary(folder, SINGLE, n_rejected=int(0.01 * n) + 1)
    assert state(folder, "Gross errors")[0] == "fails"


def test_what_fails_stands_first_and_in_the_sentence():
    good = verdict.Finding(question="Good", state="holds", answer="")
    bad = verdict.Finding(question="Bad thing", state="fails", answer="")
    note = verdict.Finding(question="Odd", state="note", answer="")
    assert list(verdict_table([good, note, bad])["Question"]) == ["Bad thing", "Good", "Odd"]
    assert statement([good, note, bad]) == (
        "**Not everything holds.** 1 of 2 tests fails: bad thing."
    )
