"""Figures of the chapter, by what they show."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.stability import chance, figures
from acx4lib.results.campaigns.comparison import difference
from acx4lib.results.campaigns.estimates import joint_test
from support.figures import assert_texts_apart, drawn, panels


def test_chi_squares_of_the_pair_and_of_the_others_add_up(every):
    left, cov = figures.without_others(every, 1, 2)
    whole = difference(every, 1, 2)
    names = [p.name for p in every.parameters]
    others = [i for i, name in enumerate(names) if name not in figures.PAIR]
    total = joint_test(left, cov).chi_square + whole.test(others).chi_square
    assert_allclose(total, whole.test().chi_square, rtol=1e-6)


def test_the_pair_is_in_micrometres_and_millimetres(every):
    d, cov = figures.pair_of(every, 0, 1)
    one = difference(every, 0, 1)
    places = [[p.name for p in every.parameters].index(name) for name in figures.PAIR]
    assert_allclose(d, 1e3 * one.d[places])
    assert_allclose(np.sqrt(np.diag(cov)), 1e3 * one.sigma[places])


def test_dots_lie_outside_ellipses_where_chance_does_not_make_them(every):
    fig = drawn(figures.hidden(every, 1, 2))
    assert_texts_apart(fig)
    (ax,) = panels(fig)
    dots = [line for line in ax.lines if len(line.get_xdata()) == 1]
    ellipses = [line for line in ax.lines if len(line.get_xdata()) == 200]
    assert (len(dots), len(ellipses)) == (2, 2)
    for dot in dots:
        assert dot.get_xdata()[0] < min(line.get_xdata().min() for line in ellipses)


def test_curves_are_the_shares():
    shares = chance.false_alarms(np.eye(3), chance.LEVELS, seed=1, draws=200)
    (ax,) = panels(drawn(figures.alarms(shares, chance.LEVELS)))
    by_label = {line.get_label(): line.get_ydata() for line in ax.lines}
    for way, share in shares.items():
        assert_allclose(by_label[way], share)
