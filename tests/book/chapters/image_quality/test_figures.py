"""Tables and figures on the quality of the synthetic image have what was found."""

import re

import numpy as np
import pytest

from acx4book.chapters.image_quality import figures
from acx4book.chapters.image_quality.examined import (
    drawn_calibration,
    examine_all,
    geometry_errors,
    lens_fits,
    measured_ties,
)
from acx4book.chapters.image_quality.figures import deviation_fields, distortion_taken_up
from support.figures import drawn, quivers
from support.pictures.known import every_refinement, known
from support.pictures.known import response as response_of

WAYS = ["true", "before", "mean shift", "rotations", "six"]


@pytest.fixture(scope="module")
def exposure():
    return known(16)


@pytest.fixture(scope="module")
def response(exposure):
    return response_of(exposure)


@pytest.fixture(scope="module")
def heads(exposure):
    wrong = drawn_calibration(exposure.orientation, seed=1, angle_deg=0.01)
    ties = measured_ties(exposure, wrong)
    return {
        "true": exposure.orientation,
        **every_refinement(wrong, ties),
    }


@pytest.fixture(scope="module")
def examined(exposure, response, heads):
    return examine_all(exposure, heads, response)


# --- tables and sentences --------------------------------------------------------------------


def test_the_ways_are_tabled_with_pixels_beside_geometry(exposure, heads, examined):
    geometry = geometry_errors(exposure, heads)
    table = figures.way_table(examined, geometry)
    assert list(table.index) == [figures.NAMES[name] for name in WAYS]
    for column, least in (("RMS (px)", 1.0), ("Oriented (px)", 0.5), ("Calibrated (px)", 0.5)):
        pixels, exact = table.loc["as calibrated", column]
        assert exact > least
        assert pixels == pytest.approx(exact, rel=0.03)


# --- figures ---------------------------------------------------------------------------------


def test_the_fields_have_one_scale(exposure, examined):
    fields = figures.self_calibration_fields(examined)
    assert len(fields) == 6
    fig = drawn(deviation_fields(fields, exposure.synthetic, exposure.orientation))
    keys = {text.get_text() for ax in fig.axes for text in ax.texts if "px" in text.get_text()}
    keys = {key for key in keys if re.fullmatch(r"[\d.]+ px", key)}
    assert len(keys) == 1
    longest = [np.hypot(q.U, q.V).max() for ax in fig.axes for q in quivers(ax)]
    assert longest[0] > 2 * longest[4]  # turned heads leave little


def test_the_papers_two_pixels_are_drawn_beside_the_distortion(examined):
    fits = lens_fits(examined)
    assert list(fits) == [name for name in WAYS if name != "before"]
    (ax,) = drawn(distortion_taken_up(fits)).axes
    (diamonds,) = [line.get_ydata() for line in ax.lines if line.get_marker() == "D"]
    assert sorted(diamonds) == [-2, 2]
