import pytest

from acx4book.chapters.beyond.from_pictures import exact, figures

pytestmark = pytest.mark.repeats


def test_patches_of_four_pictures_are_shown_twice(found):
    fig = figures.patches(found.outcome)
    assert len(fig.axes) == 8
    assert [ax.images[0].get_array().shape for ax in fig.axes] == [(49, 49)] * 8


def test_points_lie_on_the_picture(found):
    ax = figures.cover(found.outcome, found.block).axes[0]
    rows, cols = ax.images[0].get_array().shape
    x, y = (values for line in ax.lines[2:3] for values in line.get_data())
    assert x.min() > 0
    assert x.max() < cols
    assert y.max() < rows


def test_errors_rise_to_one(found):
    ties = exact.of_ties(found)
    fig = figures.sizes(ties, exact.same_height(found, ties))
    assert [line.get_ydata()[-1] for line in fig.axes[0].lines] == [1.0, 1.0]
