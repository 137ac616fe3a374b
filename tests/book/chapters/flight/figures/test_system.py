"""The system: directions of the flight; names of the paper, where the system is its own."""

import numpy as np
from matplotlib.text import Text
from numpy.testing import assert_allclose

from acx4book.chapters.flight.figures import system
from support.figures import drawn


def texts(flight):
    return " ".join(text.get_text() for text in drawn(system.system(flight)).findobj(Text))


def test_the_parts_are_named(flight):
    said = texts(flight)
    assert all(head in said for head in ("CAM1", "CAM2", "CAM3", "CAM4"))
    assert "POS-AV510" in said
    assert "8984 × 6732 px" in said


def test_another_system_has_no_part_of_the_papers(other):
    assert "POS-AV510" not in texts(other)


def test_a_head_sits_on_the_side_to_which_it_looks_and_one_that_looks_down_in_the_middle():
    way = np.array([np.sin(0.3), 0.0, -np.cos(0.3)])
    assert_allclose(system.aside(way), [system.ASIDE, 0, 0])
    assert_allclose(system.aside(np.array([0.0, 0.0, -1.0])), 0)


def test_a_ring_is_a_circle_across_its_direction():
    way = np.array([0.6, 0.0, -0.8])
    circle = system.ring(np.ones(3), way, 0.5) - 1
    assert_allclose(np.linalg.norm(circle, axis=1), 0.5)
    assert_allclose(circle @ way, 0, atol=1e-12)
