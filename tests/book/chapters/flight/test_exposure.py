"""One exposure in space: measures of the scene, and the view on it."""

import numpy as np
from matplotlib.text import Text
from numpy.testing import assert_allclose

from acx4book.chapters.flight import exposure
from support.figures import drawn


def texts(fig):
    return [text.get_text() for text in drawn(fig).findobj(Text)]


def test_the_scene_is_the_middle_of_the_lowest_strips_in_the_axes_of_the_flight(flight):
    found = exposure.scene(flight)
    assert_allclose(found.centre, [0, 0, 1600], atol=15)
    assert np.all(np.diff(found.places[:, 0]) > 0)  # along the flight
    assert np.ptp(found.places[:, 1]) < 0.05 * np.ptp(found.places[:, 0])
    assert_allclose(found.images[..., 2], 0, atol=1e-6)
    assert_allclose(found.images.mean(axis=(0, 1)), 0, atol=200)


def test_a_footprint_is_as_large_as_the_sensor_over_the_focal_length_says(flight):
    """Tilted by some 19 degrees, a head sees more ground than straight down."""
    found = exposure.scene(flight)
    x, y = found.images[..., 0], found.images[..., 1]
    area = np.abs(np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)) / 2
    straight = 8984 * 6732 * (0.006 / 74 * found.centre[2]) ** 2
    tilt = np.arccos(np.cos(np.radians(14.9)) * np.cos(np.radians(11.3)))
    assert_allclose(area / straight, 1 / np.cos(tilt) ** 3, rtol=0.1)


def test_straight_lines_stay_straight_and_what_is_nearer_is_larger(flight):
    look = exposure.Look.at(exposure.scene(flight))
    line = np.linspace([-300.0, 200.0, 0.0], [400.0, -500.0, 700.0], 5)
    off = look(line) - look(line)[0]
    assert_allclose(off[:, 0] * off[-1, 1], off[:, 1] * off[-1, 0], atol=1e-6)
    near, far = (np.ptp(look(np.array([[0.0, y, 0.0], [1.0, y, 0.0]]))[:, 0]) for y in (-500, 500))
    assert near > far
    up = look(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 500.0]]))
    assert up[1, 1] > up[0, 1]


def test_every_head_and_the_synthetic_image_are_named(flight):
    said = texts(exposure.exposure(flight))
    assert {"CAM1", "CAM2", "CAM3", "CAM4"} <= set(said)
    assert any("synthetic image" in text for text in said)
    assert "4 heads take 4 images at once, 1599 m above" in exposure.caption(flight)


def test_without_ground_there_is_a_sentence(flight, without_ground):
    assert exposure.scene(without_ground) is None
    assert exposure.caption(without_ground) == ""
    assert any("where the ground is" in t for t in texts(exposure.exposure(without_ground)))
