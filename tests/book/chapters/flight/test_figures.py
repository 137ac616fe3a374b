"""The system and the target: directions of the flight, areas of a disc, names of the paper."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib.text import Text
from numpy.testing import assert_allclose

import acx4lib
from acx4book.chapters.flight import figures
from acx4lib.flight.parts import without_control
from support.figures import drawn
from support.flights import unlike


def texts(flight):
    return " ".join(text.get_text() for text in drawn(figures.system(flight)).findobj(Text))


def test_the_parts_are_named(flight):
    said = texts(flight)
    assert all(head in said for head in ("CAM1", "CAM2", "CAM3", "CAM4"))
    assert "POS-AV510" in said
    assert "8984 × 6732 px" in said


def test_another_system_has_no_part_of_the_papers(other):
    assert "POS-AV510" not in texts(other)


def test_a_head_sits_on_the_side_to_which_it_looks_and_one_that_looks_down_in_the_middle():
    way = np.array([np.sin(0.3), 0.0, -np.cos(0.3)])
    assert_allclose(figures.aside(way), [figures.ASIDE, 0, 0])
    assert_allclose(figures.aside(np.array([0.0, 0.0, -1.0])), 0)


def test_a_ring_is_a_circle_across_its_direction():
    way = np.array([0.6, 0.0, -0.8])
    circle = figures.ring(np.ones(3), way, 0.5) - 1
    assert_allclose(np.linalg.norm(circle, axis=1), 0.5)
    assert_allclose(circle @ way, 0, atol=1e-12)


def test_labels_of_heads_that_look_one_way_do_not_lie_over_each_other(tmp_path):
    parallel = acx4lib.read(unlike.write("parallel heads", tmp_path))
    fig = drawn(figures.system(parallel))
    at = [t.get_window_extent() for t in fig.findobj(Text) if t.get_text() in parallel.cameras]
    assert len(at) == 4
    assert not [(a, b) for a, b in combinations(at, 2) if a.overlaps(b)]


# --- the target ------------------------------------------------------------------------------


@pytest.mark.parametrize("diameter", [2.0, 5.3, 8.0])
def test_pixels_sum_to_the_area_of_the_disc(diameter):
    shares = figures.pixels(diameter, np.array([0.23, -0.17]), half=6)
    assert shares.sum() == pytest.approx(np.pi / 4 * diameter**2, rel=0.01)
    assert shares.min() == 0
    assert shares.max() == 1


def test_the_disc_is_where_its_middle_is():
    shares = figures.pixels(4.0, np.array([1.0, -2.0]), half=5)
    row, col = np.indices(shares.shape) - 5
    assert (shares * col).sum() / shares.sum() == pytest.approx(1.0, abs=1e-3)
    assert (shares * row).sum() / shares.sum() == pytest.approx(-2.0, abs=1e-3)


def test_each_flying_height_has_a_panel(flight):
    said = [text.get_text() for text in drawn(figures.target(flight)).findobj(Text)]
    assert "60 cm" in said
    assert {"from 1596 m", "from 2597 m"} <= set(said)


def test_targets_of_another_flight_are_not_known(other):
    fig = drawn(figures.target(other))
    assert any("not described" in text.get_text() for text in fig.findobj(Text))


def test_heights_that_are_not_known_have_no_panel(flight):
    unknown = replace(flight, blocks={"heads": without_control(flight.heads)})
    said = [text.get_text() for text in drawn(figures.target(unknown)).findobj(Text)]
    assert "60 cm" in said
    assert not [text for text in said if text.startswith("from ")]
