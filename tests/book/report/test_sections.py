"""Sections of the report: the adjustment, the mounting, and the ground."""

import json
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report import adjustment, ground, mounting
from acx4book.report.adjustment import residual_plane, residuals_by_strip
from acx4book.report.ground import check_points
from acx4book.report.material import read
from acx4book.report.mounting import boresights as mounting_boresights
from acx4files.results import folder as results
from acx4files.results.table_files import COMPONENTS
from acx4lib.bundle.rejections import CRITICAL
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import Prior
from acx4lib.georeferencing import budget
from support import figures
from support.helpers import dots
from support.run_results import SINGLE, edit, edit_summary

# --- Groups of observations: ratios, redundancy, detectable errors ---------------------------


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
    summary = json.loads((folder / "summary.json").read_text())
    summary["mounting/single_step"]["n_observations"] = len(table)
    (folder / "summary.json").write_text(json.dumps(summary))
    (group,) = adjustment.decisive_qualities(read(folder))
    assert (group.group, group.unit, group.n) == ("heading", "deg", 20)
    assert_allclose(group.ratio, heading.std(ddof=1) / 0.01, rtol=1e-12)
    assert_allclose(group.redundancy, 19.0)


def test_the_groups_share_the_redundancy_of_the_adjustment(run):
    found = adjustment.decisive_qualities(run)
    assert {group.group for group in found} == {
        g for g in adjustment.GROUPS.values() if "declared" not in g and g != "distances"
    }
    total = sum(group.redundancy for group in found)
    assert_allclose(total, run.found.summary[SINGLE]["redundancy"], rtol=1e-6)
    cost = sum(group.ratio**2 * group.redundancy for group in found)
    assert_allclose(cost / total, run.found.summary[SINGLE]["sigma0_squared"], rtol=1e-6)


def test_a_detectable_error_is_found_in_four_of_five_cases(run):
    """By counting: w of an observation with this error is normal about delta_0."""
    w = np.random.default_rng(1).normal(adjustment.DETECTABLE, 1.0, 100_000)
    assert_allclose(np.mean(w > 3.9), 0.8, atol=0.005)  # three sigma of the count is 0.004
    rows = run.residuals[SINGLE]
    heading = rows[rows["component"] == "heading_deg"]
    expected = np.median(adjustment.DETECTABLE * 0.015 / np.sqrt(heading["redundancy"]))
    group = next(g for g in adjustment.decisive_qualities(run) if g.group == "heading")
    assert_allclose(group.detectable, expected)


def test_every_component_of_the_results_has_a_group():
    listed = {(kind, name) for kind, names in COMPONENTS.items() for name in names}
    assert set(adjustment.GROUPS) == listed


def test_baardas_delta_is_the_textbooks_4_13():
    """alpha = 0.1 %, beta = 20 %: the same sum with another critical value."""
    assert_allclose(stats.norm.isf(0.0005) + adjustment.DETECTABLE - 3.9, 4.13, atol=0.005)


def test_the_probability_of_a_ratio_is_the_one_that_the_run_tells(run):
    told = run.found.summary[SINGLE]["sigma_tests"]
    found = adjustment.decisive_qualities(run)
    assert {group.group for group in found} == set(told)
    for group in found:
        assert group.p == told[group.group]["p"]
        assert_allclose(group.ratio, told[group.group]["ratio"], rtol=1e-6)
        assert_allclose(group.redundancy, told[group.group]["redundancy"], rtol=1e-6)


def test_in_results_of_earlier_versions_it_is_that_of_chi_square(folder):
    summary = json.loads((folder / "summary.json").read_text())
    del summary[SINGLE]["sigma_tests"]
    (folder / "summary.json").write_text(json.dumps(summary))
    for group in adjustment.decisive_qualities(read(folder)):
        square, r = group.ratio**2 * group.redundancy, group.redundancy
        expected = 2 * min(stats.chi2.cdf(square, r), stats.chi2.sf(square, r))
        assert_allclose(group.p, expected, rtol=1e-9)


# --- Residuals drawn: what the tables say is what is drawn


mpl.use("agg")

CAMERA = Camera(
    name="CAM",
    width_px=4000,
    height_px=3000,
    pixel_mm=0.005,
    interior=Interior(f=50.0),
    T_b_c=Pose(R=np.eye(3), r=np.zeros(3)),
)


@pytest.fixture
def residuals(rng):
    """4000 residuals in two strips, the second with twice the promised noise in its rows."""
    n = 4000
    strip = np.repeat(["1", "2"], n // 2)
    v = rng.normal(0, 0.5, (n, 2))
    v[strip == "2", 1] *= 2
    return pd.DataFrame(
        {
            "camera": "CAM",
            "strip": strip,
            "col_px": rng.uniform(0, 4000, n),
            "row_px": rng.uniform(0, 3000, n),
            "v_col": v[:, 0],
            "v_row": v[:, 1],
            "sigma": 0.5,
            **{f"redundancy_{axis}": 1.0 for axis in ("col", "row")},
            **{f"w_{axis}": v[:, i] / 0.5 for i, axis in enumerate(("col", "row"))},
        }
    )


def test_the_plane_has_a_panel_for_every_camera_and_marks_what_is_systematic(residuals):
    other = residuals.assign(camera="CAM2", v_col=residuals["v_col"] + 0.4)
    both = pd.concat([residuals, other])
    fig = residual_plane({"Adjusted": both}, {"CAM": CAMERA, "CAM2": CAMERA})
    assert [ax.get_title(loc="left") for ax in fig.axes] == ["Adjusted, CAM", "Adjusted, CAM2"]
    coloured = []
    for ax in fig.axes:
        (arrows,) = [a for a in ax.get_children() if isinstance(a, Quiver)]
        ink = mpl.colors.to_rgba("#e58a1f")
        coloured.append(np.mean([np.allclose(c, ink) for c in arrows.get_facecolors()]))
    # twice the noise in half of the rows leaves few cells beyond 3 sigma, a shift of 0.4 px most
    assert coloured[0] < 0.1
    assert coloured[1] > 0.9


def test_a_strip_stands_at_its_ratio_under_its_limits(residuals):
    fig = residuals_by_strip({"One": residuals})
    cols, rows, largest, _ = fig.axes
    assert_allclose(dots(cols)[:, 1], 1.0, atol=0.06)  # 2000 residuals: 4 sigma of the ratio
    assert_allclose(dots(rows)[:, 1], [1.0, 2.0], atol=0.1)
    (bars,) = [c for c in cols.collections if isinstance(c, LineCollection)]
    low, high = bars.get_segments()[0][:, 1]
    assert_allclose([low, high], 1 + np.array([-3.29, 3.29]) / np.sqrt(2 * 2000), atol=0.002)
    assert CRITICAL in [line.get_ydata()[0] for line in largest.get_lines()]
    assert_allclose(dots(largest)[0, 1], residuals["w_col"][:2000].abs().max())


# --- Surveyed lever arms beside the estimates ------------------------------------------------


@pytest.fixture
def surveyed(folder):
    """Results of a flight whose lever arm x, z were surveyed, z with its sigma."""
    material = read(folder)
    camera = material.flight.cameras["CAM"]
    prior = Prior(
        declared=(True, False, True, False, False, False),
        sigma=(np.inf, np.inf, 0.02, *[np.inf] * 3),
    )
    place = replace(camera.T_b_c, r=np.array([-0.1, 0.0, -0.3]))
    cameras = {"CAM": replace(camera, prior=prior, T_b_c=place)}
    return replace(material, flight=replace(material.flight, cameras=cameras))


def levers(material):
    return figures.table(mounting.section(material).markdown, "tab-report-lever")


def test_differences_are_estimated_less_surveyed_where_nothing_else_is_told(surveyed):
    table = levers(surveyed).set_index("Component")
    rows = surveyed.found.parameters
    rows = rows[rows["method"] == "single_step"].set_index("parameter")
    assert list(table.index) == ["lever arm $x$", "lever arm $z$"]
    assert table.loc["lever arm $x$", "Surveyed (m)"] == "-0.1, σ not stated"
    assert table.loc["lever arm $z$", "Surveyed (m)"] == "−0.300 ± 0.020"
    expected = rows.loc["lever_x_m", "value"] + 0.1
    assert float(table.loc["lever arm $x$", "Difference (m)"]) == pytest.approx(expected, abs=6e-4)


def test_what_the_run_told_of_all_other_observations_is_shown(surveyed):
    told = {"CAM/lever_arm": {"difference": [0.25, None, -0.125], "p": 0.04, "confirmed": True}}
    summary = surveyed.found.summary
    summary = {**summary, SINGLE: {**summary[SINGLE], "declared": told}}
    found = replace(surveyed, found=replace(surveyed.found, summary=summary))
    table = levers(found)
    assert list(table["Difference (m)"]) == ["+0.250", "-0.125"]
    assert list(table["p"]) == ["0.040", "0.040"]


def test_a_held_lever_arm_is_said(surveyed):
    rows = surveyed.found.parameters
    held = rows[~rows["parameter"].str.startswith("lever")]
    table = levers(replace(surveyed, found=replace(surveyed.found, parameters=held)))
    assert set(table["Estimated (m)"]) == {"held as surveyed"}


# --- The boresight over time: single images, and the tests of the certified adjustment


def test_boresights_scatter_as_their_sigma_says(run):
    found = mounting_boresights(run)
    assert len(found) == len(run.flight.calibration.images)
    assert found["time_s"].is_monotonic_increasing
    for axis in mounting.AXES:
        z = found[f"{axis}_deg"] / found[f"sigma_{axis}_deg"]
        # chi-square of n - 1 at 0.1 %; what images share makes it smaller, never larger
        assert np.sum(z**2) < stats.chi2.isf(0.001, len(z) - 1)
        assert np.sum(z**2) > stats.chi2.ppf(0.001, len(z) - 1)
        assert abs(found[f"{axis}_deg"].mean()) < 1e-4  # the mean rotation is the mean to 2nd order


def test_an_image_turned_to_the_left_turns_the_boresight_about_z(folder):
    """kappa counts from x to y seen from above, and so does a turn about the body's z axis."""
    before = mounting_boresights(read(folder))
    image, n = before["image"][3], len(before)

    def turn(table):
        rows = (table["method"] == "two_step") & (table["image"] == image)
        table.loc[rows, "kappa_deg"] = table.loc[rows, "kappa_deg"].astype(float) + 0.5

    edit(folder, "exterior_orientation", turn)
    after = mounting_boresights(read(folder))
    change = (after["z_deg"] - before["z_deg"]).to_numpy()
    # attitudes of a few degrees: the cosine is one within 1 %, and the mean takes its part
    assert_allclose(change[3], 0.5 * (1 - 1 / n), atol=0.005)
    assert_allclose(np.delete(change, 3), -0.5 / n, atol=0.001)


def test_the_tests_of_the_certified_adjustment_are_read_back(folder):
    told = {
        "names": ["1", "2"],
        "turns_deg": [[0.0, 0.01, -0.002], [0.0, -0.01, 0.002]],
        "sigma_deg": [[0.004, 0.002, None], [0.004, 0.002, 0.004]],
        "f": 4.5,
        "dof": 3,
        "redundancy": 61.5,
        "p": 0.0063,
    }
    edit_summary(folder, SINGLE, boresight_stability={"strips": told, "drift": None})
    (test,) = mounting.turns_of(read(folder))
    assert (test.title, test.dof, test.p) == ("differences between strips", 3, 0.0063)
    assert test.sentence.endswith("+0.0100° ± 0.0020° about y of strip 1")
    edit_summary(folder, SINGLE, boresight_stability={"strips": None, "drift": None})
    assert mounting.turns_of(read(folder)) == []


# --- Check points drawn with their predicted sigma -------------------------------------------


mpl.use("agg")


def test_check_points_stand_on_bars_of_twice_their_sigma():
    table = pd.DataFrame({"point": ["A", "B"]})
    for axis, d in (("east", 0.1), ("north", -0.2), ("height", 0.3)):
        table[f"d_{axis}_m"] = [d, 2 * d]
        table[f"sigma_{axis}_m"] = [0.05, 0.15]
    fig = check_points(table)
    assert [ax.get_ylabel() for ax in fig.axes] == ["east (m)", "north (m)", "height (m)"]
    spans = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in fig.axes[1].patches]
    assert_allclose(spans, [(-0.1, 0.1), (-0.3, 0.3)])
    assert_allclose(dots(fig.axes[1])[:, 1], [-0.2, -0.4])
    assert [label.get_text() for label in fig.axes[2].get_xticklabels()] == ["A", "B"]


# --- The report's budget: of this run, or the reason why there is none


@pytest.fixture(scope="module")
def mapped(run):
    found = ground.mapped(run)
    assert not isinstance(found, str), found
    return found


def test_it_has_the_accuracies_of_the_run(run, mapped):
    block = run.flight.block("validation")
    assert mapped.flight.sigma_position_m == pytest.approx(block.trajectory.sigma_position[0])
    assert mapped.flight.sigma_attitude == pytest.approx(block.trajectory.sigma_attitude[0])
    text = ground.section(mapped).markdown
    assert f"{mapped.flight.height_m:.0f} m over flat ground" in text
    assert f"image points {mapped.flight.sigma_px:.2f} px" in text


def test_the_table_adds_up(mapped):
    table = figures.table(ground.section(mapped).markdown, "tab-report-budget").set_index("Source")
    parts, together = table.iloc[:-1], table.iloc[-1]
    for axis in ("plan", "height"):
        shares = figures.numbers(parts[f"in {axis} (%)"])
        assert sum(shares) == pytest.approx(100.0, abs=0.05 * len(shares))
        sigma = np.array(figures.numbers(parts[f"σ in {axis} (m)"]))
        assert np.sqrt(np.sum(np.sign(sigma) * sigma**2)) == pytest.approx(
            float(together[f"σ in {axis} (m)"]), abs=2e-3
        )
    rms = budget.over_ground(mapped.calibration, mapped.flight).rms
    assert float(together["σ in height (m)"]) == pytest.approx(rms[2], abs=5e-4)
    assert "survey" not in parts.index


def without(run, **changes):
    """Return the material with another entry of the single step in the summary."""
    name = "mounting/single_step"
    summary = {**run.found.summary, name: {**run.found.summary[name], **changes}}
    return replace(run, found=replace(run.found, summary=summary))


def test_without_a_determined_calibration_the_reason_is_given(run):
    spoilt = without(run, converged=False)
    said = ground.mapped(spoilt)
    assert said == "No error budget: the run has no calibration with all its parameters determined."
    shown = ground.section(said).markdown
    assert shown.startswith(said)
    assert "```{table}" not in shown
    assert len(ground.over_format(said).axes) == 1


def test_a_trajectory_without_sigma_has_no_budget(run):
    block = run.flight.block("validation")
    unknown = replace(
        block.trajectory, sigma_attitude=np.full_like(block.trajectory.sigma_attitude, np.inf)
    )
    blocks = {**run.flight.blocks, "validation": replace(block, trajectory=unknown)}
    flight = replace(run.flight, blocks=blocks)
    assert "no σ of positions or attitudes" in ground.mapped(replace(run, flight=flight))


def test_the_record_has_the_variances_of_the_table(run, mapped):
    recorded = ground.recorded(mapped)
    plan = sum(part["plan_m2"] for part in recorded["sources"])
    table = figures.table(ground.section(mapped).markdown, "tab-report-budget")
    assert np.sqrt(plan) == pytest.approx(float(table["σ in plan (m)"].iloc[-1]), abs=5e-4)
    said = ground.recorded(ground.mapped(without(run, converged=False)))
    assert list(said) == ["reason"]
