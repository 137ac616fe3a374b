"""The target and its image: areas of a disc."""

import numpy as np
import pytest
from matplotlib.text import Text

from acx4book.chapters.flight.figures import target
from support.figures import drawn


@pytest.mark.parametrize("diameter", [2.0, 5.3, 8.0])
def test_pixels_sum_to_the_area_of_the_disc(diameter):
    shares = target.pixels(diameter, np.array([0.23, -0.17]), half=6)
    assert shares.sum() == pytest.approx(np.pi / 4 * diameter**2, rel=0.01)
    assert shares.min() == 0
    assert shares.max() == 1


def test_the_disc_is_where_its_middle_is():
    shares = target.pixels(4.0, np.array([1.0, -2.0]), half=5)
    row, col = np.indices(shares.shape) - 5
    assert (shares * col).sum() / shares.sum() == pytest.approx(1.0, abs=1e-3)
    assert (shares * row).sum() / shares.sum() == pytest.approx(-2.0, abs=1e-3)


def test_each_flying_height_has_a_panel(flight):
    said = [text.get_text() for text in drawn(target.target(flight)).findobj(Text)]
    assert "60 cm" in said
    assert {"from 1596 m", "from 2597 m"} <= set(said)


def test_targets_of_another_flight_are_not_known(other):
    fig = drawn(target.target(other))
    assert any("not described" in text.get_text() for text in fig.findobj(Text))
