"""The calibration report: its numbers against closed forms, its verdicts against spoilt results."""

import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.command.acx4 import main
from acx4book.report import estimates, groups, stability, verdict
from acx4book.report.describe import identification
from acx4book.report.material import Material, image_residuals, read, residuals
from acx4book.report.page import markdown
from acx4book.report.sections import (
    correlation_sentence,
    method_table,
    parameter_table,
    verdict_table,
)
from acx4book.report.stability import boresights
from acx4book.report.verdict import findings, statement
from acx4lib.errors import FlightError
from acx4lib.results import folder as results
from acx4lib.results.own_folder.marks import MARK
from run_results import leave_results

SINGLE = "mounting/single_step"


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    return leave_results(tmp_path_factory.mktemp("report"))


@pytest.fixture(scope="session")
def run(made):
    return read(made[1])


@pytest.fixture
def folder(made, tmp_path):
    """A copy of the results, to be spoilt."""
    shutil.copytree(made[1], tmp_path / "results")
    (tmp_path / "results" / MARK).unlink()  # else the changes of these tests would be refused
    return tmp_path / "results"


def edit(folder, name, change):
    table = pd.read_csv(folder / f"{name}.csv", dtype={"point": str}, keep_default_na=False)
    change(table)
    table.to_csv(folder / f"{name}.csv", index=False)


def edit_summary(folder, key, **values):
    summary = json.loads((folder / "summary.json").read_text())
    summary[key].update(values)
    (folder / "summary.json").write_text(json.dumps(summary))


def state(folder_or_run, question):
    material = folder_or_run if isinstance(folder_or_run, Material) else None
    found = findings(material or read(folder_or_run))
    return next((f.state, f.answer) for f in found if f.question == question)


# --- groups ----------------------------------------------------------------------------------


def test_the_ratio_of_repeated_measurements_is_their_standard_deviation(folder, rng):
    """Residuals about a mean have redundancy 1 - 1/n each: the ratio is s / sigma exactly."""
    heading = rng.normal(0.0, 0.03, 20)
    row = {"stage": "mounting", "method": "single_step", "kind": "attitude", "point": ""}
    row |= {"component": "heading_deg", "sigma": 0.01, "redundancy": 1 - 1 / 20, "w": 0.0}
    table = pd.DataFrame(
        [
            {**row, "image_or_exposure": f"E{i}", "v": v}
            for i, v in enumerate(heading.mean() - heading)
        ]
    )
    table[list(results.COLUMNS["residuals"])].to_csv(folder / "residuals.csv", index=False)
    (group,) = groups.qualities(read(folder), SINGLE)
    assert (group.group, group.unit, group.n) == ("heading", "deg", 20)
    assert_allclose(group.ratio, heading.std(ddof=1) / 0.01, rtol=1e-12)
    assert_allclose(group.redundancy, 19.0)


def test_the_groups_share_the_redundancy_of_the_adjustment(run):
    found = groups.qualities(run, SINGLE)
    assert {group.group for group in found} == set(groups.GROUPS.values())
    total = sum(group.redundancy for group in found)
    assert_allclose(total, run.found.summary[SINGLE]["redundancy"], rtol=1e-6)
    cost = sum(group.ratio**2 * group.redundancy for group in found)
    assert_allclose(cost / total, run.found.summary[SINGLE]["sigma0_squared"], rtol=1e-6)


def test_a_detectable_error_is_found_in_four_of_five_cases(run):
    """By counting: w of an observation with this error is normal about delta_0."""
    w = np.random.default_rng(1).normal(groups.DETECTABLE, 1.0, 100_000)
    assert_allclose(np.mean(w > 3.9), 0.8, atol=0.005)  # three sigma of the count is 0.004
    rows = residuals(run, SINGLE)
    heading = rows[rows["component"] == "heading_deg"]
    expected = np.median(groups.DETECTABLE * 0.015 / np.sqrt(heading["redundancy"]))
    group = next(g for g in groups.qualities(run, SINGLE) if g.group == "heading")
    assert_allclose(group.detectable, expected)


def test_baardas_delta_is_the_textbooks_4_13():
    """alpha = 0.1 %, beta = 20 %: the same sum with another critical value."""
    assert_allclose(stats.norm.isf(0.0005) + groups.DETECTABLE - 3.9, 4.13, atol=0.005)


def test_limits_of_the_ratio_hold_in_95_of_100_samples(rng):
    v = rng.normal(size=(20_000, 30))
    ratio = np.sqrt(np.mean(v**2, axis=1))
    low, high = groups.ratio_limits(30.0)
    assert_allclose(np.mean((ratio > low) & (ratio < high)), 0.95, atol=0.005)  # 3 sigma


# --- parameters ------------------------------------------------------------------------------


def test_significance_is_against_zero_or_what_was_declared(run):
    found = {p.parameter: p for p in estimates.estimates(run, SINGLE)}
    camera = run.flight.cameras["CAM"]
    assert found["f_mm"].reference == camera.interior.f
    assert found["boresight_kappa_deg"].reference == pytest.approx(90.0)
    assert found["xp_mm"].reference == found["lever_z_m"].reference == 0.0
    f = found["f_mm"]
    assert_allclose(f.t, (f.value - camera.interior.f) / f.sigma)
    assert f.significant
    assert not replace(f, t=f.critical * 0.999).significant
    assert replace(f, t=-f.critical * 1.001).significant
    assert_allclose(f.critical, 1.96, atol=0.01)  # thousands of degrees of freedom


def test_an_angle_on_the_other_side_of_180_degrees_is_near(folder):
    """A declared mount of 180 degrees, an estimate of -179.9."""
    material = read(folder)
    camera = material.flight.cameras["CAM"]
    turned = np.diag([-1.0, -1.0, 1.0])
    mount = replace(camera, T_b_c=replace(camera.T_b_c, R=turned))
    flight = replace(material.flight, cameras={"CAM": mount})
    parameters = material.found.parameters.copy()
    kappa = parameters["parameter"] == "boresight_kappa_deg"
    parameters.loc[kappa, "value"] = -179.9
    parameters.loc[kappa, "sigma"] = 0.1
    found = replace(material.found, parameters=parameters)
    listed = estimates.estimates(replace(material, flight=flight, found=found), SINGLE)
    assert_allclose(next(p.t for p in listed if p.parameter.endswith("kappa_deg")), 1.0, atol=1e-9)


def test_strong_pairs_are_those_of_the_covariance(folder):
    sigma = np.array([2.0, 3.0, 0.5])
    rho = np.array([[1.0, 0.95, -0.2], [0.95, 1.0, -0.91], [-0.2, -0.91, 1.0]])
    names = ["CAM/f_mm", "CAM/xp_mm", "CAM/yp_mm"]
    cov = rho * sigma[:, None] * sigma
    table = pd.DataFrame(
        [
            ("mounting", "single_step", names[i], names[j], cov[i, j])
            for i in range(3)
            for j in range(3)
        ],
        columns=list(results.COLUMNS["covariance"]),
    )
    table.to_csv(folder / "covariance.csv", index=False)
    material = read(folder)
    pairs = estimates.strong_pairs(material, SINGLE)
    assert [(p.one, p.other) for p in pairs] == [tuple(names[:2]), tuple(names[1:])]
    assert_allclose([p.rho for p in pairs], [0.95, -0.91])
    assert correlation_sentence(material) == (
        "Correlations above 0.9: $f$ and $x_p$ (+0.95), $x_p$ and $y_p$ (-0.91)."
    )


# --- boresight over time ---------------------------------------------------------------------


def test_boresights_scatter_as_their_sigma_says(run):
    found = boresights(run)
    assert len(found) == len(run.flight.calibration.images)
    assert found["time_s"].is_monotonic_increasing
    for axis in stability.AXES:
        z = found[f"{axis}_deg"] / found[f"sigma_{axis}_deg"]
        # chi-square of n - 1 at 0.1 %; what images share makes it smaller, never larger
        assert np.sum(z**2) < stats.chi2.isf(0.001, len(z) - 1)
        assert np.sum(z**2) > stats.chi2.ppf(0.001, len(z) - 1)
        assert abs(found[f"{axis}_deg"].mean()) < 1e-4  # the mean rotation is the mean to 2nd order


def test_an_image_turned_to_the_left_turns_the_boresight_about_z(folder):
    """kappa counts from x to y seen from above, and so does a turn about the body's z axis."""
    before = boresights(read(folder))
    image, n = before["image"][3], len(before)

    def turn(table):
        rows = (table["method"] == "two_step") & (table["image"] == image)
        table.loc[rows, "kappa_deg"] = table.loc[rows, "kappa_deg"].astype(float) + 0.5

    edit(folder, "exterior_orientation", turn)
    after = boresights(read(folder))
    change = (after["z_deg"] - before["z_deg"]).to_numpy()
    # attitudes of a few degrees: the cosine is one within 1 %, and the mean takes its part
    assert_allclose(change[3], 0.5 * (1 - 1 / n), atol=0.005)
    assert_allclose(np.delete(change, 3), -0.5 / n, atol=0.001)


def made_up(values, strips="1"):
    time = np.arange(len(values), dtype=float)
    axes = {f"{axis}_deg": values for axis in stability.AXES}
    return pd.DataFrame({"time_s": time, "number": time + 1, "strip": list(strips), **axes})


def test_a_drift_is_found_with_its_size_and_noise_is_none(rng):
    noise = rng.normal(0, 0.005, 40)
    drifting = stability.drifts(made_up(noise + np.linspace(0, 0.02, 40), "1" * 20 + "2" * 20))[0]
    still = stability.drifts(made_up(noise, "12" * 20))[0]
    assert drifting.p < 1e-3
    assert drifting.p_strips < 1e-3
    assert still.p > 0.05
    assert still.p_strips > 0.05
    exact = stability.drifts(made_up(np.linspace(0.01, 0.04, 7), "1" * 7))[0]
    assert_allclose(exact.change_deg, 0.03)
    assert np.isnan(exact.p_strips)
    assert stability.drifts(made_up(np.zeros(3), "111")) == []


# --- verdict ---------------------------------------------------------------------------------


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


# --- tables ----------------------------------------------------------------------------------


def test_the_identification_names_flight_camera_system_and_software(run):
    said = identification(run).set_index("Item")["Statement"]
    assert said["Flight"] == run.flight.name
    assert "pixels of 4.6 µm; declared focal length 50 mm" in said["Camera CAM"]
    assert said["Coordinate system"] == "WGS 84 / UTM zone 33N (EPSG:32633)"
    assert said["Stages computed"] == "mounting and validation"
    assert said["Data, SHA-256"] == f"`{run.provenance.digest}`"
    assert "acx4lib " in said["Software"]


def test_parameters_stand_with_their_sigma(run):
    table = parameter_table(run).set_index("Parameter")
    rows = results.parameters(run.found, SINGLE, "CAM")
    value, sigma = table.loc["$f$ (mm)", "Value and σ"].split(" ± ")
    assert_allclose(float(value), rows.loc["f_mm", "value"], atol=1e-4)
    assert_allclose(float(sigma), rows.loc["f_mm", "sigma"], rtol=0.05)
    assert len(table) == len(rows)
    methods = method_table(run).set_index("Parameter")
    assert methods.loc["lever arm $x$ (m)", "Two-step, GNSS positions"] == "held"


def test_residuals_stand_where_they_were_measured(run):
    table = image_residuals(run, SINGLE)
    block = run.flight.calibration
    one = table.iloc[7]
    i = block.images.names.index(one["image"])
    k = block.points.index(one["point"])
    seen = block.image_points
    row = np.flatnonzero((seen.image_idx == i) & (seen.point_idx == k))
    assert_allclose(seen.colrow[row[0]], [one["col_px"], one["row_px"]])
    rows = residuals(run, SINGLE)
    own = rows[(rows["image_or_exposure"] == one["image"]) & (rows["point"] == one["point"])]
    assert list(own["v"]) == [one["v_col"], one["v_row"]]


# --- Markdown --------------------------------------------------------------------------------


def test_markdown_becomes_html_with_numbers_and_without_foreign_markup():
    document = markdown.Document(numbers={"tab-x": "Table 1"})
    text = (
        "See {numref}`tab-x` and {eq}`eq-14`: $x_p$, $\\omega$, $\\chi^2$, "
        "<script>a < b</script>.\n\n"
        "```{table} A *caption*\n:name: tab-x\n\n"
        "| Flight |\n| :--- |\n| ✗ fails |\n| <b>x</b> |\n```"
    )
    html = markdown.to_html(text, document)
    assert "See Table 1 and (14):" in html
    assert "<i>x</i><sub><i>p</i></sub>, <i>ω</i>, <i>χ</i><sup>2</sup>" in html
    assert "<script>" not in html
    assert "&lt;script&gt;a &lt; b&lt;/script&gt;" in html
    assert '<table id="tab-x"><caption><b>Table 1.</b> A <em>caption</em></caption>' in html
    assert "<td>✗ fails</td>" in html or 'align:left">✗ fails</td>' in html  # a name, no answer
    verdict = markdown.to_html(text.replace("tab-x", "tab-report-verdict"), document)
    assert 'class="state fails">✗&nbsp;fails</td>' in verdict
    assert "&lt;b&gt;x" in html


# --- the file --------------------------------------------------------------------------------


@pytest.fixture
def acx4(capsys):
    def command(*arguments):
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return end.value.code, captured.out, captured.err

    return command


@pytest.mark.slow
def test_the_report_is_one_file_that_asks_for_nothing(acx4, made, run, tmp_path):
    out = tmp_path / "report.html"
    status, said, err = acx4("report", made[1], "--out", out)
    assert (status, err) == (0, "")
    assert said.splitlines() == ["report: done", str(out)]
    text = out.read_text(encoding="utf-8")
    assert not re.search(r"<script|<link|src=\"(?!data:)|url\(|@import", text)
    assert text.count("data:image/svg+xml;base64,") >= 6
    assert "<code class" not in text
    assert "import acx4lib" not in text
    assert run.flight.name in text
    assert "<b>Table 1.</b> What holds and what does not" in text
    assert not re.search(r"\{(numref|eq|doc)\}|\\varphi|\$", re.sub(r"<style>.*</style>", "", text))
    again = tmp_path / "again.html"
    acx4("report", made[1], "--out", again)
    assert again.read_text(encoding="utf-8") == text
    assert {path.name for path in tmp_path.iterdir()} == {"report.html", "again.html"}


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (shutil.rmtree, "no such folder"),
        (lambda f: (f / "residuals.csv").unlink(), "not complete, without residuals.csv"),
        (lambda f: (f / "summary.json").write_text("{}"), "no stage left results"),
        (lambda f: (f / "summary.json").write_text("{"), "summary.json: not JSON"),
        (lambda f: shutil.rmtree(f / "flight"), "not complete, without flight/flight.toml"),
        (lambda f: [p.unlink() for p in f.glob("*.*")], "no results of a run"),
    ],
)
def test_bad_results_are_one_line_and_leave_an_older_report_alone(acx4, folder, spoil, says):
    spoil(folder)
    out = folder.parent / "report.html"
    out.write_text("older")
    status, said, err = acx4("report", folder, "--out", out)
    assert (status, said) == (2, "")
    assert len(err.splitlines()) == 1
    assert says in err
    assert str(folder) in err
    assert out.read_text() == "older"


def test_a_place_that_cannot_be_written_is_one_line_before_anything_runs(acx4, made, tmp_path):
    for out, says in ((tmp_path, "is a folder"), (tmp_path / "no" / "x.html", "no such folder")):
        status, _, err = acx4("report", made[1], "--out", out)
        assert status == 2
        assert len(err.splitlines()) == 1
        assert says in err
    assert list(tmp_path.iterdir()) == []


def test_residuals_of_another_flight_are_refused(folder):
    def rename(table):
        table["point"] = table["point"].str.replace("T0", "X0")

    edit(folder, "residuals", rename)
    with pytest.raises(FlightError, match="not of the flight kept beside it"):
        image_residuals(read(folder), SINGLE)
