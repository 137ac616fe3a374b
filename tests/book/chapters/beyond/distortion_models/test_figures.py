"""Every figure shows all models and all cases."""

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.distortion_models import cases, figures, study, trials
from acx4book.chapters.beyond.distortion_models.candidates import single_step
from acx4book.chapters.beyond.distortion_models.families import MODELS


def test_six_terms_are_drawn():
    fig = figures.terms()
    assert len(fig.axes) == 6
    titles = [ax.get_title(loc="left").partition(",")[0] for ax in fig.axes]
    assert titles == ["Brown", "Ebner", "Fourier"] * 2


def test_residuals_have_a_panel_for_every_adjustment(decentred):
    found = single_step(decentred.calibration, MODELS[0])
    assert len(figures.residuals({"a": found, "b": found}).axes) == 2


def test_criteria_and_errors_have_a_row_for_every_case(stored):
    rows = [label.get_text() for label in figures.criteria(stored).axes[0].get_yticklabels()]
    assert set(rows) == {*cases.CASES, study.REAL}
    for ax in figures.errors(stored).axes:
        assert len([line for line in ax.lines if len(line.get_xdata()) == 4]) == len(MODELS)


def test_the_errors_of_browns_model_lie_at_one(stored):
    first = figures.errors(stored).axes[0].lines[0]
    assert np.allclose(first.get_xdata(), 1)


def test_the_seams_have_a_panel_for_two_models_and_one_for_four_cameras(pattern):
    titles = [ax.get_title(loc="left") for ax in figures.at_seams(pattern).axes]
    assert titles == ["Brown", "Radial + Fourier", "Four cameras"]


def test_depths_have_two_lines_in_every_panel():
    rows = [
        {"depth_um": depth, "model": model} | dict.fromkeys(study.ERRORS, 0.1)
        for depth in (0.0, 10.0)
        for model in (MODELS[0].name, trials.FLEXIBLE)
    ]
    assert all(len(ax.lines) == 2 for ax in figures.depths(pd.DataFrame(rows)).axes)
