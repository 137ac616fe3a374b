"""Cameras and strips are called anything, though results name things ``camera/parameter``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acx4book.chapters.heads import mean_residuals
from acx4book.chapters.mounting.tables import determination, reliability
from acx4book.report.words import adjustment_title, parameter_title
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.matrix import correlation_matrix
from acx4lib.calibration import mounting
from acx4lib.calibration.determination import detectable, parameter_correlations
from acx4lib.results import adjustments, read_back
from acx4lib.results import folder as results
from support import blocks

SETTINGS = {"free": ("f", "xp", "yp", "k1"), "gnss": ("drift",)}
CAMERAS = ("PhaseOne 150MP/50mm", "single_step", "heads/bundle", "/", "k1", " ", "gnss_drift_a/b")
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
    return block, mounting.single_step(block, **SETTINGS)


def test_tables_take_any_name(made):
    block, single = made
    worst = reliability(single.bundle, detectable(single.bundle))["On"]
    assert set(worst) <= {*LABELS.values(), *(f"boresight about ${axis}$" for axis in "xyz")}
    determined = determination({"single_step": single})
    assert len(determined) == 1
    related = parameter_correlations(single.calibration)
    labels = [f"{block.cameras[0].name}/{name}" for name in related.index]
    correlation_matrix(pd.DataFrame(related.to_numpy(), index=labels, columns=labels))


def test_names_that_begin_and_end_alike_have_their_own_panels(mounted):
    fits = {f"{30 * 'a'}{middle}{30 * 'b'}": mounted for middle in "12"}
    assert len(mean_residuals(fits).axes) == 2


def test_a_calibration_comes_back_from_its_files(made, tmp_path):
    block, single = made
    adjustments.write(tmp_path, "mounting", [adjustments.of_mounting(single)])
    found = results.read(tmp_path)
    back = read_back.read_calibration(found, "mounting/single_step", block.cameras)
    assert_allclose(back.cov, single.calibration.cov, rtol=1e-9)
    assert results.cameras(found, "mounting/single_step") == (block.cameras[0].name,)
    cov = results.covariance(found, "mounting/single_step")
    listed = results.rows(found, "parameters", "mounting/single_step")
    assert_allclose(np.sqrt(np.diag(cov)), listed["sigma"], rtol=1e-12)


def test_titles_of_parameters_and_adjustments_take_any_name():
    for name in CAMERAS:
        assert parameter_title(f"{name}/xp_mm") == "$x_p$"
        assert adjustment_title(f"heads/bundle/{name}") == f"head {name}"
    for strip in STRIPS.values():
        title = parameter_title(f"gnss_drift_{strip}_north_m_per_min")
        assert title == f"GNSS drift of strip {strip}, north"


@settings(max_examples=8)
@given(name=st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), min_size=1))
@example(name="a\rb")
@example(name='"a", b\r\n')
@example(name="nan")
@example(name=" 1.0 ")
def test_results_come_back_with_the_names_they_had(tmp_path_factory, name):
    folder = tmp_path_factory.mktemp("results")
    row = ("mounting", "rig", name, f"gnss_drift_{name}_east_m_per_min", 1.0, 0.1, "mm")
    table = pd.DataFrame([row], columns=list(results.COLUMNS["parameters"]))
    summary = {f"heads/bundle/{name}": {"notes": [name]}}
    results.replace(folder, ["mounting", "heads"], tables={"parameters": table}, summary=summary)
    found = results.read(folder)
    assert tuple(found.parameters.iloc[0]) == row
    assert found.summary == summary
