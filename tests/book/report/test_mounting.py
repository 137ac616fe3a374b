"""Surveyed lever arms beside the estimates."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.report import mounting
from acx4book.report.material import read
from acx4book.report.mounting import boresight_over_time
from acx4book.report.mounting import boresights as mounting_boresights
from acx4lib.geometry.parameters import Prior
from support import figures
from support.run_results import SINGLE, edit, edit_summary


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


def test_a_flight_without_a_survey_is_a_sentence(run):
    text = mounting.section(run).markdown
    assert "states no surveyed lever arm" in text
    assert "tab-report-lever" not in text


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


# --- Boresights drawn over time


mpl.use("agg")


@pytest.fixture
def boresights():
    """Four images that drift about x by 0.03 degrees in three minutes."""
    drift = {"x_deg": [0.0, 0.01, 0.02, 0.03], "y_deg": np.zeros(4), "z_deg": np.zeros(4)}
    sigma = {f"sigma_{axis}_deg": 0.005 for axis in "xyz"}
    times = {"time_s": [0.0, 60.0, 120.0, 180.0], "number": [1, 2, 3, 4]}
    return pd.DataFrame({**times, "strip": ["1", "1", "2", "2"], **drift, **sigma})


def test_boresights_have_their_line_over_time_in_minutes(boresights):
    fig = boresight_over_time(boresights)
    assert [ax.get_ylabel() for ax in fig.axes] == [f"about {axis} (°)" for axis in "xyz"]
    assert fig.axes[-1].get_xlabel() == "time after the first image (min)"
    (line,) = [a for a in fig.axes[0].get_lines() if a.get_linestyle() == "--"]
    assert_allclose(line.get_xydata(), [[0, 0], [3, 0.03]], atol=1e-12)
    untimed = boresight_over_time(boresights.assign(time_s=np.nan))
    assert untimed.axes[-1].get_xlabel() == "image number"


def test_no_boresights_are_said():
    assert len(boresight_over_time(pd.DataFrame()).axes[0].texts) == 1


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
