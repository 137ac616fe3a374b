import numpy as np
import pytest

from acx4book.foundations.explorers import distortion
from acx4book.paper import printed
from acx4lib.geometry import camera


def test_the_start_is_the_head_of_table_1():
    shown = distortion.explorer()
    interior = printed.interior(1, distortion.HEAD)
    principal = np.array([interior.xp, interior.yp])
    for row, corner in zip(
        shown.readings(shown.start), printed.corners(distortion.HEAD)[[0, 2]], strict=False
    ):
        expected = np.linalg.norm(camera.distortion(interior, corner[None] + principal))
        assert float(row[0]) == pytest.approx(1000 * expected, abs=0.06)
        assert float(row[1]) == pytest.approx(
            expected / printed.pixel_mm(distortion.HEAD), abs=0.06
        )
        assert float(row[2]) == pytest.approx(1600 * expected / interior.f, abs=0.006)


def test_any_lens_is_the_sum_of_its_coefficients():
    values, xy = (
        np.array([1.5, -2.0, 0.7, 3.0, -5.0, 120.0]),
        np.array([[20.0, -11.0], [-3.0, 16.0]]),
    )
    expected = distortion.moved(values, xy).ravel()
    assert distortion.response(xy) @ values == pytest.approx(expected, rel=1e-12)


def test_a_longer_f_moves_ideal_points_as_rays_say():
    """The same ray with another f."""
    values, f = np.array([0, 0, 0, 0, 0, 100.0]), printed.interior(1, distortion.HEAD).f
    xy = np.array([[20.0, -11.0]])
    assert distortion.moved(values, xy) == pytest.approx(xy - xy * (f + 0.1) / f, rel=1e-9)


def test_a_balanced_f_leaves_a_quarter_in_the_corner():
    shown = distortion.explorer()
    alone, balanced = (
        shown.readings(shown.presets[name])[0][0] for name in ("only k₁", "k₁ and a balanced f")
    )
    assert float(balanced) == pytest.approx(float(alone) / 4, rel=0.05)
