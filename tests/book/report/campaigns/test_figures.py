"""Figures of a comparison show its numbers, in units that are said."""

import datetime as dt

import numpy as np
from numpy.testing import assert_allclose

from acx4book.report.campaigns import figures
from acx4book.report.campaigns.study import study
from acx4lib.results.campaigns import comparison as compared
from support.figures import assert_texts_apart, drawn, panels, quivers, sentence


def test_the_time_line_has_a_panel_for_each_parameter_with_error_bars(three):
    fig = drawn(figures.time_line(three))
    assert_texts_apart(fig)
    shown = [ax for ax in panels(fig) if ax.lines]
    assert len(shown) == 14
    assert shown[0].get_title(loc="left") == "$f$ (µm)"
    dots = shown[0].lines[0]
    mean = compared.pooled(three.comparison).coefficients[0, 0]
    assert_allclose(dots.get_ydata(), 1e3 * (three.comparison.values[:, 0] - mean))
    assert_allclose(dots.get_xdata(), [2021.33, 2022.33, 2024.33], atol=0.01)


def test_without_dates_campaigns_stand_in_their_order(three):
    first, second = three.comparison.campaigns[:2]
    same_day = study([first, first.__class__(**{**vars(second), "session": first.session})])
    ax = panels(drawn(figures.time_line(same_day)))[0]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["2021-05", "2022-05"]


def test_a_year_has_decimals():
    assert figures.year_of(dt.date(2024, 1, 1)) == 2024
    assert 2024.4 < figures.year_of(dt.date(2024, 7, 1)) < 2024.6


def test_arrows_on_the_ground_are_the_difference(three):
    (ax,) = [ax for ax in panels(drawn(figures.on_the_ground(three))) if quivers(ax)]
    (arrows,) = quivers(ax)
    one = min(three.found, key=lambda found: found.test().p)
    moved = three.ground.of["CAM"].moved(one.d)
    drawn_at = np.column_stack([arrows.U, arrows.V])
    ratio = np.hypot(*drawn_at.T) / np.hypot(*moved.T)
    assert_allclose(ratio, ratio[0])
    assert_allclose(drawn_at[:, 0] / ratio[0], -moved[:, 1])  # to the right is minus left


def test_lines_over_temperature_go_through_the_campaigns(three):
    fig = drawn(figures.over(three, "temperature"))
    ax = panels(fig)[0]
    assert ax.get_title(loc="left") == "$f$"
    line = next(one for one in ax.lines if len(one.get_xdata()) == 2)
    assert_allclose(line.get_xdata(), [8, 32])
    slope = np.ptp(line.get_ydata()) / 24
    assert 0.3 < slope < 0.9
    two = study(three.comparison.campaigns[:2])
    assert "no temperatures to fit" in sentence(figures.over(two, "temperature"))
