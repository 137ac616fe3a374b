"""Surveyed lever arms beside the estimates."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.report.material import read
from acx4book.report.mounting.lever_arm import lever_sentence, lever_table
from acx4lib.geometry.prior import Prior
from support.run_results import SINGLE


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


def test_a_flight_without_a_survey_is_a_sentence(run):
    assert lever_table(run).empty
    assert "states no surveyed lever arm" in lever_sentence(run)


def test_differences_are_estimated_less_surveyed_where_nothing_else_is_told(surveyed):
    table = lever_table(surveyed).set_index("Component")
    rows = surveyed.found.parameters
    rows = rows[rows["method"] == "single_step"].set_index("parameter")
    assert list(table.index) == ["lever arm $x$", "lever arm $z$"]
    assert table.loc["lever arm $x$", "Surveyed (m)"] == "-0.1, σ not stated"
    assert table.loc["lever arm $z$", "Surveyed (m)"] == "-0.300 ± 0.020"
    expected = rows.loc["lever_x_m", "value"] + 0.1
    assert float(table.loc["lever arm $x$", "Difference (m)"]) == pytest.approx(expected, abs=6e-4)


def test_what_the_run_told_of_all_other_observations_is_shown(surveyed):
    told = {"CAM/lever_arm": {"difference": [0.25, None, -0.125], "p": 0.04, "confirmed": True}}
    summary = surveyed.found.summary
    summary = {**summary, SINGLE: {**summary[SINGLE], "declared": told}}
    found = replace(surveyed, found=replace(surveyed.found, summary=summary))
    table = lever_table(found)
    assert list(table["Difference (m)"]) == ["+0.250", "-0.125"]
    assert list(table["p"]) == ["0.040", "0.040"]


def test_a_held_lever_arm_is_said(surveyed):
    rows = surveyed.found.parameters
    held = rows[~rows["parameter"].str.startswith("lever")]
    table = lever_table(replace(surveyed, found=replace(surveyed.found, parameters=held)))
    assert set(table["Estimated (m)"]) == {"held as surveyed"}
