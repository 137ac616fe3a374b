"""Held focal lengths: a line per head."""

from acx4book.chapters.heads.figure_held import held_focal_lengths
from support.figures import UNIT, assert_texts_apart, drawn, legend, panels
from support.flights.simulated import HEADS


def test_held_focal_lengths_have_a_line_per_head_in_every_panel(held):
    fig = drawn(held_focal_lengths(held))
    assert_texts_apart(fig)
    assert all(UNIT.search(ax.get_ylabel()) for ax in panels(fig))
    assert [len(ax.lines) for ax in panels(fig)] == [4, 4, 5, 4, 4, 4]
    assert legend(fig) == list(HEADS)
