"""Figures of scatter over sigma, of radial distortion, and of lens centres."""

import pytest
from matplotlib.quiver import Quiver

from acx4book.chapters.beyond.synthetic_cost import figures, geometry, study


@pytest.fixture(scope="module")
def found():
    return study.read()


def test_every_parameter_of_the_synthetic_camera_has_a_dot_of_both_kinds(found):
    ax = figures.scatter_over_sigma(found).axes[0]
    assert len(ax.get_xticklabels()) == 14
    assert len(ax.containers) == 5  # four heads and one camera


def test_the_fingerprint_has_a_curve_for_every_square_and_table_3(found):
    left, right = figures.fingerprint(found).axes
    assert len(left.lines) == 3 * 2
    assert len(right.lines) == len(geometry.by_side(found)) + 1


def test_lens_centres_are_compared_in_both_axes(found):
    (ax,) = figures.centres(found).axes
    assert [line.get_label() for line in ax.lines] == ["$X_c$", "$Y_c$"]
    assert (figures.centre_misfit(found) > 0).all(axis=None)


def test_every_height_has_its_field_and_its_seams(found):
    fig = figures.pattern(found)
    titles = [ax.get_title(loc="left") for ax in fig.axes]
    assert titles == ["From 1000 m", "From 1500 m"]
    for ax in fig.axes:
        (field,) = (c for c in ax.collections if isinstance(c, Quiver))
        assert 200 < field.N < 400
        assert ax.get_ylim() == (16200, 0)
