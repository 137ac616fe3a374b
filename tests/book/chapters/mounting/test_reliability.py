"""The table of reliability counts what takes part, in the units that it names."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.mounting.reliability import FORMATS, largest_effect, reliability_table
from acx4lib.bundle.gross_errors.rejections import noncentrality
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import Mounting


@pytest.fixture(scope="module")
def single_step(mounted):
    return Mounting(method="single_step", calibration=from_bundle(mounted), bundle=mounted)


def test_every_component_has_a_row_with_its_unit(single_step):
    table = reliability_table(single_step)
    assert list(table.columns) == list(FORMATS)
    assert list(table["Observation"]) == [
        "Image points, col (px)",
        "Image points, row (px)",
        "Control points, east (m)",
        "Control points, north (m)",
        "Control points, height (m)",
        "GNSS positions, east (m)",
        "GNSS positions, north (m)",
        "GNSS positions, height (m)",
        "Attitudes, roll (°)",
        "Attitudes, pitch (°)",
        "Attitudes, heading (°)",
    ]
    assert list(table["Number"])[2:] == [9] * 3 + [12] * 6


def test_attitudes_are_in_degrees(single_step):
    heading = reliability_table(single_step).iloc[-1]
    expected = noncentrality() * 0.008 / np.sqrt(heading["Median"])
    assert heading["Detectable, median"] == pytest.approx(expected, rel=0.01)


def test_what_was_taken_out_does_not_count(single_step):
    groups = list(single_step.bundle.solution.groups)
    gnss = groups[2]
    redundancy = gnss.redundancy.copy()
    redundancy[3] = np.nan
    groups[2] = replace(gnss, redundancy=redundancy)
    solution = replace(single_step.bundle.solution, groups=tuple(groups))
    without_one = replace(single_step, bundle=replace(single_step.bundle, solution=solution))
    assert list(reliability_table(without_one)["Number"])[5:8] == [11] * 3


def test_the_share_of_the_poorly_controlled_is_in_per_cent(single_step):
    table = reliability_table(single_step)
    r = single_step.bundle.solution.group("control_point").redundancy[:, 2]
    row = table[table["Observation"] == "Control points, height (m)"].iloc[0]
    assert row["Below 0.1 (%)"] == pytest.approx(100 * np.mean(r < 0.1))
    assert row["Redundancy, least"] == r.min()


def test_the_sentence_names_the_worst_of_the_table(single_step):
    table = reliability_table(single_step)
    worst = table.loc[table["Effect (σ)"].idxmax()]
    said = largest_effect(table)
    assert f"more than {worst['Effect (σ)']:.2f} of" in said
    assert f"moves {worst['On']}." in said
    assert "4.74 standard deviations" in said


def test_an_observation_that_nothing_controls_is_said(single_step):
    table = reliability_table(single_step)
    table.loc[5, "Effect (σ)"] = np.inf
    said = largest_effect(table)
    assert said.startswith("Nothing controls an observation in GNSS positions, east")


def test_without_a_result_there_is_an_empty_table_and_a_sentence():
    table = reliability_table(None)
    assert table.empty
    assert list(table.columns) == list(FORMATS)
    assert largest_effect(table) == "No parameter of a camera is estimated, so no error moves one."
