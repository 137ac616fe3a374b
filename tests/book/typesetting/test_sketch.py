import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.typesetting import sketch, style
from support.figures import drawn

EAST, NORTH, UP = np.eye(3)


def test_from_straight_above_one_sees_the_map():
    seen = sketch.view(0, 90)
    assert_allclose(seen.apply([EAST, NORTH])[:, :2], np.eye(2), atol=1e-15)


@pytest.mark.parametrize(("from_deg", "right"), [(0, EAST), (90, NORTH), (180, -EAST)])
def test_from_the_horizon_up_is_up_and_what_is_right_depends_on_where_one_stands(from_deg, right):
    seen = sketch.view(from_deg, 0)
    assert_allclose(seen.apply([right, UP])[:, :2], np.eye(2), atol=1e-15)


def test_a_frame_has_a_name_at_every_tip_also_at_one_that_points_at_the_reader():
    with style.applied():
        fig, ax = plt.subplots()
        sketch.triad(ax, sketch.view(0, 90), np.zeros(3), np.eye(3), ("x", "y", "z"), "black")
        sketch.blank(fig)
    texts = [text.get_text() for text in drawn(fig).axes[0].texts if text.get_text()]
    assert texts == ["x", "y", "z"]


def test_a_scene_has_limits_equal_scales_and_no_frame():
    with style.applied():
        _, ax = style.subplots(figsize=(3.0, 2.0))
        sketch.scene(ax, (-1.0, 2.0), (0.0, 1.0))
    assert (ax.get_xlim(), ax.get_ylim(), ax.get_aspect()) == ((-1.0, 2.0), (0.0, 1.0), 1.0)
    assert not ax.axison
