"""Figures of the chapter, by what they show."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.stability import figures
from support.figures import assert_texts_apart, drawn, panels

COV = np.array([[4.0, 16.0], [16.0, 100.0]])


def test_dots_lie_outside_ellipses_where_chance_does_not_make_them():
    pair, rest = (np.array([-9.0, 10.0]), COV), (np.array([-9.0, -5.0]), 0.5 * COV)
    fig = drawn(figures.hidden(pair, rest, label="2022-05 less 2021-08", n_tests=70))
    assert_texts_apart(fig)
    (ax,) = panels(fig)
    dots = [line for line in ax.lines if len(line.get_xdata()) == 1]
    ellipses = [line for line in ax.lines if len(line.get_xdata()) == 200]
    assert (len(dots), len(ellipses)) == (2, 2)
    for dot in dots:
        assert dot.get_xdata()[0] < min(line.get_xdata().min() for line in ellipses)
    # the ellipse ends where chance ends in one case of twenty: chi-square with 2 degrees of freedom
    assert_allclose(ellipses[0].get_xdata().max(), 2.0 * np.sqrt(5.991), rtol=1e-3)


def test_curves_are_the_shares():
    levels = np.array([0.01, 0.05, 0.2])
    shares = {way: k * levels for k, way in enumerate(figures.MARKS, start=1)}
    (ax,) = panels(drawn(figures.alarms(shares, levels)))
    by_label = {line.get_label(): line.get_ydata() for line in ax.lines}
    for way, share in shares.items():
        assert_allclose(by_label[way], share)
