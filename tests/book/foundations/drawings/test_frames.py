"""The Earth, its heights and the projection as they are drawn."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.foundations.drawings import frames as drawings


@pytest.mark.parametrize("latitude", [0.0, 40.0, 90.0])
def test_the_point_is_on_the_ellipse_and_its_normal_is_normal(latitude):
    at, up = drawings.on_ellipsoid(np.radians(latitude))
    assert_allclose(at[0] ** 2 + (at[1] / drawings.FLAT) ** 2, 1.0)
    gradient = at / np.array([1.0, drawings.FLAT]) ** 2
    assert_allclose(up, gradient / np.hypot(*gradient), atol=1e-12)


def test_the_heights_are_named():
    left, right = drawings.earth().axes
    assert {"$h_e$", "$B$", "north"} <= {t.get_text() for t in left.texts}
    assert {"$h_e$", "$h_0$", "$N$", "geoid"} <= {t.get_text() for t in right.texts}


def test_the_second_axis_is_the_focal_length_that_the_scale_causes():
    east = np.array([200_000.0, 500_000.0])
    curves = {0.0: (east, np.array([1.0007, 0.9996])), 900.0: (east, np.array([1.0, 0.9995]))}
    ax = drawings.projection(curves, focal_mm=74.0).axes[0]
    assert_allclose(ax.lines[0].get_ydata(), [700.0, -400.0], rtol=1e-9)
    to_um = ax.child_axes[0]._functions[0]
    # 74 mm / 0.9996 less 74 mm is 29.61 um; the axis leaves out the square of the scale
    assert_allclose(to_um(-400.0), 1000 * (74 / 0.9996 - 74), rtol=1e-3)
