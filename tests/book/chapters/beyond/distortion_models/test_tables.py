"""The tables have a row for every case and model."""

import pytest

from acx4book.chapters.beyond.distortion_models import cases, seams, tables
from acx4book.chapters.beyond.distortion_models.families import MODELS


def test_fits_have_the_real_camera_and_errors_only_simulated_ones(stored):
    fits, errors = tables.fits(stored), tables.errors(stored)
    assert len(fits) == (len(cases.CASES) + 1) * len(MODELS)
    assert len(errors) == len(cases.CASES) * len(MODELS)
    assert set(tables.FIT_FORMATS) <= set(fits)
    assert set(tables.ERROR_FORMATS) <= set(errors)
    assert errors.notna().all(axis=None)


def test_the_pattern_has_a_row_for_four_cameras(pattern):
    found = tables.pattern(pattern).set_index("Fitted")
    assert list(found.columns) == ["From 1000 m (px)", "From 1500 m (px)"]
    assert found.loc[seams.HEADS, "From 1000 m (px)"] < 0.02
    # chapter 12 has the same figure
    low = pattern.height_m == 1000
    assert found.iloc[0, 0] == pytest.approx(tables.rms(pattern.d_px[low]))
