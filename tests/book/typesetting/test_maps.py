"""Maps of a flight: every exposure, strip and point has its place."""

from dataclasses import replace

import pytest
from matplotlib.collections import PolyCollection

from acx4book.typesetting.maps import block_maps, control_maps
from support.figures import assert_labelled, assert_texts_apart, drawn, legend, panels
from support.flights.simulated import fly


@pytest.fixture(scope="module")
def flight():
    return fly("acx4", seed=1, blocks=("heads",)).flight


def test_a_map_shows_every_exposure_strip_and_control_point(flight):
    block = flight.heads
    fig = drawn(block_maps(block, None))
    assert_labelled(fig)
    assert_texts_apart(fig)
    (ax,) = panels(fig)
    assert len(ax.get_title(loc="left")) > 0
    lines = [len(line.get_xdata()) for line in ax.lines]
    assert sorted(n for n in lines if n > 2) == sorted([10, 7, 7, 7, len(block.control)])
    outlined = [c for c in ax.collections if isinstance(c, PolyCollection)]
    assert sorted(len(c.get_paths()) for c in outlined) == [4, 4, len(block.images)]
    assert legend(fig) == ["higher strips", "lower strips", "control points"]
    assert ax.get_aspect() == 1.0


def test_maps_of_a_single_camera_stand_beside_each_other():
    flight = fly("single-head", seed=1).flight
    fig = drawn(block_maps(flight.calibration, flight.validation))
    assert_labelled(fig)
    assert_texts_apart(fig)
    assert [ax.get_title(loc="left") for ax in panels(fig)] == ["calibration", "validation"]
    assert "check points" in legend(fig)


def test_exposures_without_strips_are_not_joined(flight):
    images = replace(flight.heads.images, strips=("",) * len(flight.heads.images))
    fig = drawn(block_maps(replace(flight.heads, images=images)))
    (exposures,) = (line for line in panels(fig)[0].lines if len(line.get_xdata()) == 31)
    assert exposures.get_linestyle() == "None"
    assert "exposures" in legend(fig)


def test_a_map_without_surveyed_points_has_no_footprints(flight):
    block = flight.heads
    bare = replace(block, control=block.control[:0], check=block.check[:0])
    fig = drawn(block_maps(bare))
    assert legend(fig) == ["higher strips", "lower strips"]
    assert "124 images" in [text.get_text() for text in panels(fig)[0].texts]
    (text,) = drawn(control_maps(bare)).axes[0].texts
    assert "No surveyed point" in text.get_text()


def test_surveyed_points_have_their_names(flight):
    fig = drawn(control_maps(flight.heads, None))
    assert_labelled(fig)
    names = {flight.heads.points[i] for i in flight.heads.control.point_idx}
    assert names <= {text.get_text() for text in panels(fig)[0].texts}
    assert [ax.get_xlabel() for ax in fig.axes if ax not in panels(fig)] == ["height (m)"]


def test_a_flight_without_a_block_gets_a_sentence():
    (text,) = drawn(block_maps(None)).axes[0].texts
    assert text.get_text() == "The flight has no such block."
