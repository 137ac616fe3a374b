"""The sentences say what the numbers say."""

from dataclasses import replace

import pandas as pd
import pytest

from acx4book.chapters.beyond.distortion_models import sentences
from acx4book.chapters.beyond.distortion_models.families import MODELS
from acx4book.chapters.beyond.distortion_models.trials import FLEXIBLE


@pytest.fixture
def by_depth(stored):
    """Two depths made of stored flights: the flexible model halves the error at neither."""
    rows = stored.rows[stored.rows["model"].isin([MODELS[0].name, FLEXIBLE])]
    rows = rows[rows["seed"] == 1]
    flat, dented = (rows[rows["case"] == case] for case in ("decentred", "dented"))
    return pd.concat([flat.assign(depth_um=0.0), dented.assign(depth_um=25.0)])


def test_the_page_says_when_and_from_how_many_flights_it_was_computed(stored):
    said = sentences.made(stored)
    assert f"{stored.n_flights} flights" in said
    assert stored.about["date"] in said


def test_browns_model_is_chosen_for_lenses_and_waves_for_the_dent(stored):
    said = sentences.fits(stored)
    assert "*Brown* for symmetric, *Brown* for decentred, *radial + Fourier* for dented" in said


def test_nothing_changes_in_direct_georeferencing(stored):
    assert "at most 0.5\N{NO-BREAK SPACE}% in height" in sentences.errors(stored)


def test_what_is_never_halved_is_said_so(by_depth):
    assert "at no depth of the figure" in sentences.depths(by_depth)


def test_the_adjustment_keeps_one_model(stored, pattern, by_depth):
    assert "keeps one model" in sentences.decision(stored, pattern, by_depth)


def test_a_model_that_halved_an_error_would_be_taken(stored, pattern, by_depth):
    rows = stored.rows.copy()
    rows.loc[rows["model"] == FLEXIBLE, "direct_plan_m"] *= 0.4
    halved = replace(stored, rows=rows)
    assert "needs a second model" in sentences.decision(halved, pattern, by_depth)


def test_the_real_camera_and_the_answer_have_their_numbers(stored, pattern, by_depth):
    assert "px and" in sentences.real(stored)
    said = sentences.answer(stored, pattern, by_depth)
    assert said.startswith("Brown's model.")
    assert "nan" not in said + sentences.pattern(pattern)
