import numpy as np
from numpy.testing import assert_allclose

from acx4book.foundations import example
from acx4book.foundations.drawings import collinearity
from acx4lib.geometry.frames import exp, rotation_from_opk
from support.figures import assert_labelled, assert_texts_apart, drawn, panels, quivers, title
from support.helpers import numeric_jacobian

HEIGHT_M = 480.0


def image(turn, shift, xy):
    """Project points of flat ground, seen at xy by a level camera, once it is turned and moved."""
    ground = np.column_stack([xy / example.F_MM, -np.ones(len(xy))]) * HEIGHT_M
    D = (ground - shift) @ exp(turn)
    return -example.F_MM * D[:, :2] / D[:, 2:]


def test_the_columns_are_derivatives_of_the_projection():
    xy, zero = collinearity.grid(3, 3), np.zeros(3)
    by_turn = numeric_jacobian(lambda turn: image(turn, zero, xy), zero)
    assert_allclose(collinearity.by_turn(xy), by_turn, atol=1e-6)
    by_shift = numeric_jacobian(lambda shift: image(zero, shift, xy), zero, step=1e-3)
    assert_allclose(collinearity.by_shift(xy, HEIGHT_M), by_shift, atol=1e-8)


def test_look_alikes_point_the_same_way():
    fields = collinearity.effects(collinearity.grid(), HEIGHT_M)
    for one, other in (
        ("turn about y", "shift along −x"),
        ("turn about x", "shift along y"),
        ("focal length", "shift along −z"),
    ):
        assert np.all(np.sum(fields[one] * fields[other], axis=1)[1:-1] >= 0)
    factor, left = collinearity.nearest(fields["focal length"], fields["shift along −z"])
    assert_allclose(factor, 0.1 / (example.F_MM / HEIGHT_M))
    assert_allclose(left, 0, atol=1e-15)


def test_what_is_left_has_nothing_of_the_field_that_was_taken_out():
    fields = collinearity.effects(collinearity.grid(), HEIGHT_M)
    _, left = collinearity.nearest(fields["turn about y"], fields["shift along −x"])
    assert_allclose(np.sum(left * fields["shift along −x"]), 0, atol=1e-15)


def test_differences_on_the_ground_turn_with_the_aircraft():
    down_left = np.tile([-0.1, -0.1], (4, 2, 1))
    fig = drawn(collinearity.differences(down_left, rotation_from_opk(example.attitudes())))
    assert_labelled(fig)
    assert_texts_apart(fig)
    to_east = [np.unique(np.sign(quiver.U)) for quiver in quivers(panels(fig)[1])]
    assert_allclose(np.ravel(to_east), [-1, -1, 1, 1])


def test_the_figures_of_columns_draw():
    fig = drawn(collinearity.columns(HEIGHT_M))
    names = [title(ax) for ax in panels(fig) if ax.get_visible()]
    assert names == list(collinearity.effects(collinearity.grid(), HEIGHT_M))
    fig = drawn(collinearity.look_alike(HEIGHT_M))
    assert [len(quivers(ax)) for ax in panels(fig)] == [1, 1, 1]
