import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.foundations.drawings import distortion
from acx4book.paper import printed
from acx4lib.geometry.camera import Interior, distort
from acx4lib.geometry.camera import distortion as of_library
from support.figures import assert_texts_apart, drawn, panels, quivers


def test_radial_distortion_is_that_of_the_library_along_the_x_axis():
    lens = Interior(f=74.0, k1=2.4e-7, k2=-9.3e-11, k3=2.1e-14)
    r = np.linspace(0, 56, 9)
    along = of_library(lens, np.stack([r, 0 * r], axis=1))
    assert_allclose(distortion.radial(lens, r), along[:, 0], rtol=1e-14)


def test_the_border_value_is_about_what_the_paper_says():
    first = printed.interior(1, "CAM1")
    corner = distortion.radial(first, np.array([distortion.border("CAM1")]))[0]
    said = printed.statement("head_border_distortion_px")
    assert corner / printed.pixel_mm("CAM1") == pytest.approx(said, abs=1)


def test_the_balance_leaves_a_quarter_inside_and_at_the_border():
    k1, far = 2e-6, 33.0
    r = np.linspace(0, far, 10_001)
    left = k1 * r**3 - distortion.balance(k1, far) * r
    assert_allclose([left.max(), left.min()], np.array([1, -1]) * k1 * far**3 / 4, rtol=1e-6)


def test_mistakes_are_of_the_order_that_the_series_gives():
    k1, r = 2e-6, np.array([10.0, 20.0])
    found = distortion.mistaken(k1, r)
    assert_allclose(found["sign"], 2 * k1 * r**3, rtol=1e-2)
    assert_allclose(found["direction"], 3 * k1**2 * r**5, rtol=1e-2)
    assert_allclose(found["direction, two terms"], 12 * k1**3 * r**7, rtol=2e-2)
    at = distort(Interior(f=74.0, k1=k1), np.stack([r, 0 * r], axis=1))[:, 0]
    assert_allclose(found["direction"], at - (r + k1 * r**3), rtol=1e-6)


def test_the_figures_draw():
    for fig in (
        distortion.curves(),
        distortion.balanced("CAM1"),
        distortion.directions("CAM1"),
        distortion.terms("single_step"),
    ):
        assert_texts_apart(drawn(fig))
    fig = drawn(distortion.vectors("CAM1"))
    for ax in panels(fig):
        (quiver,) = quivers(ax)
        lower_right = (quiver.X > 20) & (quiver.Y < -12)
        assert np.all(quiver.U[lower_right] > 0)  # radial and decentring go the same way
        assert np.all(quiver.V[lower_right] < 0)
