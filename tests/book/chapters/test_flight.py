"""A flight without surveyed points."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import flight as chapter
from acx4book.paper import printed
from acx4lib.design import level_table
from support.figures import drawn

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


# --- One exposure in space: measures of the scene, and the view on it


def test_a_footprint_is_as_large_as_the_sensor_over_the_focal_length_says(flight):
    """Tilted by some 19 degrees, a head sees more ground than straight down."""
    found = chapter.scene(flight)
    x, y = found.images[..., 0], found.images[..., 1]
    area = np.abs(np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)) / 2
    straight = 8984 * 6732 * (0.006 / 74 * found.centre[2]) ** 2
    tilt = np.arccos(np.cos(np.radians(14.9)) * np.cos(np.radians(11.3)))
    assert_allclose(area / straight, 1 / np.cos(tilt) ** 3, rtol=0.1)


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
