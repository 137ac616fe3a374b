"""A flight without surveyed points."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from numpy.testing import assert_allclose

import acx4
from acx4book.chapters import flight as chapter
from acx4book.paper import printed
from acx4lib.design import level_table, without_control
from support.figures import drawn
from support.flights import planned


@pytest.fixture(scope="session")
def without_ground(flight):
    block = flight.heads
    nothing = np.zeros(len(block.control), dtype=bool)
    return replace(flight, blocks={"heads": replace(block, control=block.control[nothing])})


# --- The system and the target: directions of the flight, areas of a disc, names of the paper


def texts(flight):
    return " ".join(text.get_text() for text in drawn(chapter.system(flight)).findobj(Text))


def test_the_parts_are_named(flight):
    said = texts(flight)
    assert all(head in said for head in ("CAM1", "CAM2", "CAM3", "CAM4"))
    assert "POS-AV510" in said
    assert "8984 × 6732 px" in said


def test_another_system_has_no_part_of_the_papers(other):
    assert "POS-AV510" not in texts(other)


def test_labels_of_heads_that_look_one_way_do_not_lie_over_each_other(tmp_path):
    parallel = acx4.read(planned.write("parallel heads", tmp_path))
    fig = drawn(chapter.system(parallel))
    at = [t.get_window_extent() for t in fig.findobj(Text) if t.get_text() in parallel.cameras]
    assert len(at) == 4
    assert not [(a, b) for a, b in combinations(at, 2) if a.overlaps(b)]


# --- the target ------------------------------------------------------------------------------


def test_pixels_sum_to_the_disc_where_its_middle_is(flight):
    diameter = printed.statement("target_diameter_m")
    shown = [ax.images[0] for ax in drawn(chapter.target(flight)).axes if ax.images]
    for image in shown:
        shares = np.asarray(image.get_array())
        gsd = np.ptp(image.get_extent()[:2]) / len(shares)
        assert shares.sum() * gsd**2 == pytest.approx(np.pi / 4 * diameter**2, rel=0.01)
        assert (shares.min(), shares.max()) == (0, 1)
        row, col = np.indices(shares.shape) - len(shares) // 2
        middle = [(shares * at).sum() / shares.sum() for at in (col, row)]
        assert middle == pytest.approx(chapter.OFF, abs=0.02)  # of a twentieth of a pixel


def test_each_flying_height_has_a_panel(flight):
    said = [text.get_text() for text in drawn(chapter.target(flight)).findobj(Text)]
    assert "60 cm" in said
    assert {"from 1596 m", "from 2597 m"} <= set(said)


def test_targets_of_another_flight_are_not_known(other):
    assert chapter.target(other) is None


def test_heights_that_are_not_known_have_no_panel(flight):
    unknown = replace(flight, blocks={"heads": without_control(flight.heads)})
    said = [text.get_text() for text in drawn(chapter.target(unknown)).findobj(Text)]
    assert "60 cm" in said
    assert not [text for text in said if text.startswith("from ")]


# --- One exposure in space: measures of the scene, and the view on it


def exposure_texts(fig):
    return [text.get_text() for text in drawn(fig).findobj(Text)]


def test_the_scene_is_the_middle_of_the_lowest_strips_in_the_axes_of_the_flight(flight):
    found = chapter.scene(flight)
    assert_allclose(found.centre, [0, 0, 1600], atol=15)
    assert np.all(np.diff(found.places[:, 0]) > 0)  # along the flight
    assert np.ptp(found.places[:, 1]) < 0.05 * np.ptp(found.places[:, 0])
    assert_allclose(found.images[..., 2], 0, atol=1e-6)
    assert_allclose(found.images.mean(axis=(0, 1)), 0, atol=200)


def test_a_footprint_is_as_large_as_the_sensor_over_the_focal_length_says(flight):
    """Tilted by some 19 degrees, a head sees more ground than straight down."""
    found = chapter.scene(flight)
    x, y = found.images[..., 0], found.images[..., 1]
    area = np.abs(np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)) / 2
    straight = 8984 * 6732 * (0.006 / 74 * found.centre[2]) ** 2
    tilt = np.arccos(np.cos(np.radians(14.9)) * np.cos(np.radians(11.3)))
    assert_allclose(area / straight, 1 / np.cos(tilt) ** 3, rtol=0.1)


def test_straight_lines_stay_straight_and_what_is_nearer_is_larger(flight):
    look = chapter.Look.at(chapter.scene(flight))
    line = np.linspace([-300.0, 200.0, 0.0], [400.0, -500.0, 700.0], 5)
    off = look(line) - look(line)[0]
    assert_allclose(off[:, 0] * off[-1, 1], off[:, 1] * off[-1, 0], atol=1e-6)
    near, far = (np.ptp(look(np.array([[0.0, y, 0.0], [1.0, y, 0.0]]))[:, 0]) for y in (-500, 500))
    assert near > far
    up = look(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 500.0]]))
    assert up[1, 1] > up[0, 1]


def test_every_head_and_the_synthetic_image_are_named(flight):
    said = exposure_texts(chapter.exposure(flight))
    assert {"CAM1", "CAM2", "CAM3", "CAM4"} <= set(said)
    assert any("synthetic image" in text for text in said)
    assert "4 heads take 4 images at once, 1599 m above" in chapter.caption(flight)


def test_without_ground_there_is_a_sentence(flight, without_ground):
    assert chapter.scene(without_ground) is None
    assert chapter.caption(without_ground) == ""
    assert any("where the ground is" in t for t in exposure_texts(chapter.exposure(without_ground)))


# --- What flew, above the paper's numbers where it is the paper's flight


def flown(flight):
    return pd.concat({n: level_table(flight.mounted(n)) for n in flight.blocks}, names=["block"])


def test_the_papers_flight_stands_above_the_papers_numbers(flight):
    table = chapter.beside_paper(flown(flight), flight)
    high, said, low, said_low = (row for _, row in table.iterrows())
    assert list(table.index.get_level_values("of")) == ["this book", "paper"] * 2
    heights = [row["height above ground (m)"] for row in (high, said, low, said_low)]
    assert [round(height) for height in heights] == [2597, 2600, 1596, 1600]
    assert (round(high["ground pixel (cm)"], 1), said["ground pixel (cm)"]) == (21.1, 22)
    assert (low["strips"], said_low["strips"]) == (3, 3)
    assert pd.isna(high["side overlap (%)"])
    assert said_low["side overlap (%)"] == 50
    (held,) = chapter.printed_contents(flight).to_dict("records")
    assert held == {"paper: images each": 31, "paper: surveyed": 56}


def test_every_statement_that_is_shown_is_transcribed():
    names = [name for said in chapter.PRINTED.values() for name in said.values()]
    names += [*chapter.PRINTED_IMAGES.values(), *chapter.PRINTED_POINTS.values()]
    assert all(printed.statement(name) > 0 for name in names)
    keys = {key for said in chapter.PRINTED.values() for key in said}
    assert keys == {key for key, _ in chapter.COLUMNS.values()}


def test_other_flights_stand_alone(other):
    alone = flown(other)
    pd.testing.assert_frame_equal(chapter.beside_paper(alone, other), alone)
    contents = other.table()
    assert list(contents.join(chapter.printed_contents(other))) == list(contents)
