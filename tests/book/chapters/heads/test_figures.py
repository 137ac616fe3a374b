"""Figures of the heads: residuals, distortion, correlations, held focal lengths."""

import re
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest

from acx4book.chapters.heads.figures import (
    correlations,
    held_focal_lengths,
    mean_residuals,
    radial_distortion,
)
from acx4book.typesetting import style
from acx4lib.calibration.correlations import interior_exterior
from acx4lib.calibration.heads import Heads
from support.figures import (
    UNIT,
    assert_labelled,
    assert_texts_apart,
    drawn,
    legend,
    panels,
    quivers,
)
from support.flights.simulated import HEADS


def test_mean_residuals_have_one_field_per_head(fits):
    fig = drawn(mean_residuals(fits))
    assert_labelled(fig)
    assert_texts_apart(fig)
    assert [ax.get_title(loc="left") for ax in panels(fig)] == list(HEADS)
    for ax, fit in zip(panels(fig), fits.values(), strict=True):
        (arrows,) = quivers(ax)
        assert 80 <= len(arrows.U) <= 108  # 12 x 9 cells, some with too few points
        assert ax.get_ylim() == (fit.cameras[0].height_px, 0)  # rows run down


def test_a_pattern_in_the_residuals_is_told_from_noise(fits):
    fit = fits["CAM1"]
    group = fit.solution.group("image_point")
    shifted = replace(group, v=group.v + np.array([1.0, 0.0]))
    groups = tuple(shifted if g is group else g for g in fit.solution.groups)
    spoilt = replace(fit, solution=replace(fit.solution, groups=groups))
    colours = [
        {tuple(c) for c in quivers(panels(mean_residuals({"CAM1": f}))[0])[0].get_facecolor()}
        for f in (fit, spoilt)
    ]
    orange = mpl.colors.to_rgba(style.ORANGE)
    assert orange not in colours[0]
    assert orange in colours[1]


def test_radial_distortion_ends_at_the_corner_beside_the_papers_values(fits):
    printed = dict.fromkeys(HEADS, 14.0)
    fig = drawn(radial_distortion(fits, printed_px=printed, claim_px=15.0))
    assert_labelled(fig)
    assert_texts_apart(fig)
    wide, near = panels(fig)
    assert len(wide.lines) == 4 + 1
    assert len(near.lines) == 4 + 4 + 1
    assert wide.lines[0].get_xdata()[-1] == pytest.approx(33.68, abs=0.01)  # half the diagonal, mm
    assert wide.lines[0].get_ydata()[-1] == pytest.approx(15.0, abs=1.0)
    assert legend(fig)[-2:] == ["Table 1 of the paper", "its text: about 15 px"]


def test_other_cameras_are_not_compared_with_the_paper(fits):
    fig = drawn(radial_distortion(fits))
    assert [len(ax.lines) for ax in panels(fig)] == [4, 4]
    assert legend(fig) == list(HEADS)


def test_correlations_show_every_pair_and_all_values(fits):
    found = {name: interior_exterior(fit) for name, fit in fits.items()}
    fig = drawn(correlations(found, claim=0.1))
    assert_texts_apart(fig)
    pairs, shares = panels(fig)
    assert (pairs.get_xlim(), pairs.get_ylim()) == ((0, 6), (5, 0))
    assert len([text for text in pairs.texts if re.fullmatch(r"\d\.\d\d", text.get_text())]) == 30
    assert len(shares.lines) == 4 + 1
    assert len(shares.lines[0].get_xdata()) == 31 * 5 * 6
    assert shares.lines[0].get_ydata()[-1] == 100
    assert UNIT.search(shares.get_xlabel())


def test_without_an_estimated_parameter_correlations_are_a_sentence(fits):
    found = interior_exterior(fits["CAM1"])
    none = replace(found, interior=(), values=found.values[:, :0])
    (text,) = drawn(correlations({"CAM1": none})).axes[0].texts
    assert text.get_text() == "No parameter is estimated in oriented images."


def test_held_focal_lengths_have_a_line_per_head_in_every_panel(held):
    fig = drawn(held_focal_lengths(held))
    assert_texts_apart(fig)
    assert all(UNIT.search(ax.get_ylabel()) for ax in panels(fig))
    assert [len(ax.lines) for ax in panels(fig)] == [4, 4, 5, 4, 4, 4]
    assert legend(fig) == list(HEADS)


def test_held_focal_lengths_without_a_head_are_a_sentence():
    none = Heads(bundles={}, failures={})
    (text,) = drawn(held_focal_lengths({-0.5: none, 0.5: none})).axes[0].texts
    assert text.get_text() == "No head could be adjusted."


@pytest.mark.parametrize(
    "draw",
    [mean_residuals, radial_distortion, correlations],
    ids=lambda f: f.__name__,
)
def test_without_a_head_there_is_a_sentence(draw):
    assert [t.get_text() for t in drawn(draw({})).axes[0].texts] == ["No head could be adjusted."]
