"""Parallax of a small base."""

import numpy as np
import pytest

from acx4book.reference.heads.parallax import predicted_px


def test_the_shift_is_the_base_over_the_size_of_a_pixel_on_the_ground():
    assert predicted_px(0.03, height_m=60.0, f_px=1500.0) == pytest.approx(0.03 / (60.0 / 1500.0))


def test_free_places_bring_the_rotations_nearer_to_the_factory(stored):
    table = stored("ten_parallax")
    rms = [
        np.sqrt(np.mean(table[[f"x{way}_px", f"y{way}_px"]].to_numpy() ** 2))
        for way in ("", "_left")
    ]
    assert rms[1] < 0.65 * rms[0]
    assert np.hypot(table["base_x_mm"], table["base_y_mm"]).max() < 60  # the camera is larger
