import numpy as np
import pytest

from acx4book.foundations.drawings.georeferencing import moved_on_ground
from acx4book.foundations.explorers import boresight

XY = np.array([[0.0, 0.0], [16.0, -12.0], [-16.0, 9.0]])


@pytest.mark.parametrize("azimuth", [90.0, 270.0, 0.0, 180.0])
@pytest.mark.parametrize("k", range(6))
def test_derivatives_agree_with_differences(azimuth, k):
    step = np.eye(6)[k] * boresight.SLIDERS[k].step
    high, low = (boresight.on_ground(azimuth, 500.0, XY, way * step) for way in (1, -1))
    found = boresight.derivatives(azimuth, 500.0, XY)[:, :, k]
    assert found == pytest.approx((high - low) / (2 * step[k]), abs=1e-3)


def test_derivatives_are_those_of_the_closed_form_above_flat_ground():
    """Flown east, body axes are those of the map."""
    at = XY * 500.0 / 50.0
    for k, shift, turned in (
        *((axis, np.zeros(3), np.eye(3)[axis]) for axis in range(3)),
        *((3 + axis, np.eye(3)[axis], np.zeros(3)) for axis in range(3)),
    ):
        expected = moved_on_ground(at, 500.0, shift, turned) * boresight.UNITS[k]
        found = boresight.derivatives(90.0, 500.0, XY)[:, :, k]
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_matrix_is_enough_up_to_the_ends_of_all_sliders():
    worst = np.array([slider.high for slider in boresight.SLIDERS])
    exact = boresight.on_ground(0.0, 500.0, XY, worst) - boresight.on_ground(
        0.0, 500.0, XY, 0 * worst
    )
    assert boresight.derivatives(0.0, 500.0, XY) @ worst == pytest.approx(exact, abs=0.005)


def test_boresight_and_lever_arm_cancel_at_one_height_only():
    shown = boresight.explorer()
    cancelled = next(v for name, v in shown.presets.items() if "cancel" in name)
    for row in shown.readings(cancelled):
        assert row[:2] == ["0", "0"]
        assert row[2:] != ["0", "0"]
