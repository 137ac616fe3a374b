"""Maps of a flight: every exposure, strip and point has its place."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from numpy.testing import assert_allclose

from acx4book.typesetting import maps, style
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


def test_the_map_of_one_point_shows_the_flight_around_it(flight):
    block = flight.heads
    fig = drawn(control_maps(replace(block, control=block.control[:1], check=block.check[:0])))
    (ax,) = panels(fig)
    exposures = block.frame.to_grid(block.trajectory.T_m_b.r)[:, :2] / 1000
    low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
    assert np.all(low < exposures.min(axis=0))
    assert np.all(high > exposures.max(axis=0))
    assert any(t.get_text().startswith("1 point in ") for t in ax.texts)


def test_names_of_near_points_do_not_lie_over_each_other(flight):
    block = flight.heads
    x_m = block.control.x_m.copy()
    x_m[1:4] = x_m[0]
    fig = drawn(control_maps(replace(block, control=replace(block.control, x_m=x_m))))
    assert_texts_apart(fig)


def test_a_long_block_has_a_map_that_is_wide_enough_for_its_axes(flight):
    block = flight.heads
    far = block.trajectory.T_m_b.r.copy()
    far[::2, 1] += 300_000.0
    trajectory = replace(block.trajectory, T_m_b=replace(block.trajectory.T_m_b, r=far))
    fig = drawn(block_maps(replace(block, trajectory=trajectory)))
    assert_texts_apart(fig)
    (ax,) = panels(fig)
    assert np.ptp(ax.get_xlim()) > 0.35 * np.ptp(ax.get_ylim())


def test_a_flight_without_a_block_gets_a_sentence():
    (text,) = drawn(block_maps(None)).axes[0].texts
    assert text.get_text() == "The flight has no such block."


EAST, NORTH, UP = np.eye(3)


def test_from_straight_above_one_sees_the_map():
    seen = maps.view(0, 90)
    assert_allclose(seen.apply([EAST, NORTH])[:, :2], np.eye(2), atol=1e-15)


@pytest.mark.parametrize(("from_deg", "right"), [(0, EAST), (90, NORTH), (180, -EAST)])
def test_from_the_horizon_up_is_up_and_what_is_right_depends_on_where_one_stands(from_deg, right):
    seen = maps.view(from_deg, 0)
    assert_allclose(seen.apply([right, UP])[:, :2], np.eye(2), atol=1e-15)


def test_a_frame_has_a_name_at_every_tip_also_at_one_that_points_at_the_reader():
    with style.applied():
        fig, ax = plt.subplots()
        maps.triad(ax, maps.view(0, 90), np.zeros(3), np.eye(3), ("x", "y", "z"), "black")
        maps.blank(fig)
    texts = [text.get_text() for text in drawn(fig).axes[0].texts if text.get_text()]
    assert texts == ["x", "y", "z"]


def test_a_scene_has_limits_equal_scales_and_no_frame():
    with style.applied():
        _, ax = style.subplots(figsize=(3.0, 2.0))
        maps.scene(ax, (-1.0, 2.0), (0.0, 1.0))
    assert (ax.get_xlim(), ax.get_ylim(), ax.get_aspect()) == ((-1.0, 2.0), (0.0, 1.0), 1.0)
    assert not ax.axison
