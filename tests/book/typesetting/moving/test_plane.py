import re

import numpy as np
import pytest

from acx4book.typesetting import moving, style
from acx4book.typesetting.moving import Linear, Mark, Plane

PLANE = Plane(x=(-10.0, 10.0), y=(0.0, 5.0), size=(120.0, 90.0), margin=(10.0, 10.0, 20.0, 20.0))


def mark(kind, *moved):
    response = Linear(matrix=np.array([moved]).T)
    at = np.tile([10.0, 20.0], (len(moved) // 2, 1))
    return Mark(kind=kind, colour="teal", at=at, scale=(1.0, 1.0), response=response)


def test_corners_of_the_plane_are_at_the_margins_and_y_counts_upwards():
    corners = np.array([[-10.0, 0.0], [10.0, 5.0]])
    assert PLANE.at(corners) == pytest.approx(np.array([[10.0, 70.0], [110.0, 20.0]]))
    assert PLANE.scale == pytest.approx((5.0, -10.0))


def test_an_arrow_ends_at_its_place_with_a_head_no_longer_than_half_of_it():
    d = moving.path(mark("arrows", 30.0, 40.0), [1.0])
    points = np.array(re.findall(r"-?[\d.]+", d), dtype=float).reshape(-1, 2)
    assert points[[0, 1]] == pytest.approx(np.array([[10.0, 20.0], [40.0, 60.0]]))
    short = moving.path(mark("arrows", 3.0, 4.0), [1.0])
    back = np.array(re.findall(r"-?[\d.]+", short), dtype=float).reshape(-1, 2)[2] - [13.0, 24.0]
    assert np.hypot(*back) == pytest.approx(2.5, abs=0.05)


def test_an_arrow_without_length_is_none():
    assert moving.path(mark("arrows", 30.0, 40.0), [0.0]) == ""


def test_a_bar_ends_at_its_place():
    assert moving.path(mark("bars", 25.0, 0.0), [1.0]) == "M10.00 14.00H35.00v12.00H10.00z"


def test_a_dot_lies_around_its_place():
    d = moving.path(mark("dots", 25.0, 0.0), [1.0])
    assert d == "M29.00 20.00a6.00 6.00 0 1 0 12.00 0a6.00 6.00 0 1 0 -12.00 0z"


def test_a_curve_goes_through_its_places():
    assert moving.path(mark("curve", 1.0, 2.0, 3.0, 4.0), [1.0]) == "M11.00 22.00L13.00 24.00"


def test_text_is_escaped_and_colours_are_those_of_the_page_or_of_the_figures():
    text = PLANE.text((0.0, 0.0), "<b> & c", colour="blue")
    assert "&lt;b&gt; &amp; c" in text
    assert f'fill="var(--figure-blue, {style.BLUE})"' in text


def test_axes_have_all_numbers():
    drawn = PLANE.axes([-10, 0, 10], [0.0, 2.5, 5.0], labels=("x, m", "y, m"))
    said = re.findall(r">([^<]+)</text>", drawn)
    assert said == ["−10", "0", "10", "0.0", "2.5", "5.0", "x, m", "y, m"]
