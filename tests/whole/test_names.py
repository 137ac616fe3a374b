"""Names: two that were exchanged are rejected, and one with a slash comes back as it was."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import acx4sim
from acx4book.command import acx4
from acx4files.results import folder as results
from acx4files.results import read_back
from acx4files.stages import diagnosed
from acx4lib.calibration import mounting
from acx4lib.model import Model
from support import blocks
from support.helpers import repeats
from support.run_results import put, state

EXCHANGED = {
    "neighbours": ("calibration/trajectory.csv", "exposure", "C1-03", "C1-04"),
    "strips": ("calibration/trajectory.csv", "exposure", "C1-02", "C5-07"),
    "control": ("control_points.csv", "point", "P01", "P04"),
}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), path)
    return path


def exchange(flight, into, table, column, a, b):
    """Copy a flight, with two names exchanged."""
    shutil.copytree(flight, into)
    rows = pd.read_csv(into / table, dtype=str)
    rows[column] = rows[column].replace({a: b, b: a})
    rows.to_csv(into / table, index=False)
    return into


@pytest.mark.parametrize("name", ["strips", "control", repeats("neighbours")])
def test_the_two_are_rejected_and_the_finding_does_not_hold(good, tmp_path, name):
    table, column, a, b = EXCHANGED[name]
    flight = exchange(good, tmp_path / "flight", table, column, a, b)
    with pytest.raises(SystemExit) as ended:
        acx4.main(["run", str(flight), "--results", str(tmp_path / "r"), "--numbers-only"])
    assert ended.value.code == 0
    rejected = results.read(tmp_path / "r").rejected.query("method == 'single_step'")
    place = "point" if column == "point" else "image_or_exposure"
    assert {a, b} == {*rejected.query("statistic > 100")[place]}
    assert state(tmp_path / "r", "Gross errors")[0] == "fails"


# --- cameras and strips are called anything, though results name things ``camera/parameter`` ---


MODEL = Model(free=("f", "xp", "yp", "k1"), gnss=("drift",))
CAMERAS = ("PhaseOne 150MP/50mm", "heads/bundle", "gnss_drift_a/b")
STRIPS = {"A": "a/b", "B": "gnss_shift_east_m", "C": "k1/f_mm", "D": "_east_m_per_min"}


@pytest.fixture(scope="module", params=CAMERAS)
def made(request, noisy_block):
    """A single step of a camera and strips with strange names."""
    block = blocks.in_strips(blocks.approximate(noisy_block), 3)
    strips = tuple(STRIPS[strip] for strip in block.images.strips)
    block = replace(
        block,
        cameras=(replace(block.cameras[0], name=request.param),),
        images=replace(block.images, strips=strips),
    )
    return block, mounting.single_step(block, MODEL)


def test_a_calibration_comes_back_from_its_files(made, tmp_path):
    block, single = made
    put(tmp_path, "mounting", [diagnosed.of_mounting(single)])
    found = results.read(tmp_path)
    back = read_back.read_calibration(found, "mounting/single_step", block.cameras)
    assert_allclose(back.cov, single.calibration.cov, rtol=1e-9)
    assert results.cameras(found, "mounting/single_step") == (block.cameras[0].name,)
    cov = results.covariance(found, "mounting/single_step")
    listed = results.rows(found, "parameters", "mounting/single_step")
    assert_allclose(np.sqrt(np.diag(cov)), listed["sigma"], rtol=1e-12)


@settings(max_examples=8)
@given(name=st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), min_size=1))
@example(name="a\rb")
@example(name='"a", b\r\n')
@example(name="nan")
@example(name=" 1.0 ")
def test_results_come_back_with_the_names_they_had(tmp_path_factory, name):
    folder = tmp_path_factory.mktemp("results")
    row = ("mounting", "rig", name, f"gnss_drift_{name}_east_m_per_min", 1.0, 0.1, "mm", 0.0)
    table = pd.DataFrame([row], columns=list(results.COLUMNS["parameters"]))
    summary = {f"heads/bundle/{name}": {"notes": [name]}}
    results.replace(folder, ["mounting", "heads"], tables={"parameters": table}, summary=summary)
    found = results.read(folder)
    assert tuple(found.parameters.iloc[0]) == row
    assert found.summary == summary
