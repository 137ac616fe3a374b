"""What one camera takes up of the pattern of the synthetic image."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.beyond.image_quality import one_camera
from acx4lib.geometry.camera import Camera, Interior, xy_from_colrow

CAMERA = Camera(
    name="SYN", width_px=10000, height_px=15200, pixel_mm=0.006, interior=Interior(f=73.8)
)


@pytest.fixture(scope="module")
def pattern():
    return one_camera.pattern(CAMERA)


def models(pattern):
    radial = one_camera.effects(pattern, one_camera.RADIAL)
    waves = one_camera.waves(pattern)
    brown = one_camera.effects(pattern, one_camera.BROWN)
    return brown, np.concatenate([radial, waves], axis=2)


def rms(d):
    return np.sqrt(np.mean(d**2))


def test_what_a_camera_can_do_is_taken_up(pattern):
    """A longer lens, and a lever arm 10 cm off along x, at both heights."""
    xy = xy_from_colrow(CAMERA, pattern.colrow)
    lever = 0.1 * CAMERA.interior.f / pattern.height_m / CAMERA.pixel_mm
    d = 1e-4 * xy / CAMERA.pixel_mm * [1, -1] + np.stack([lever, 0 * lever], axis=1)
    assert rms(d) > 0.1
    for A in models(pattern):
        assert rms(one_camera.left(d, A)) < 1e-9


def test_a_wave_is_taken_up_by_waves_alone(pattern):
    """One pixel to the right on the left and right borders, one to the left in the middle."""
    u = 2 * np.pi * (pattern.colrow[:, 0] / CAMERA.width_px - 0.5)
    d = np.stack([-np.cos(u), 0 * u], axis=1)
    brown, fourier = (rms(one_camera.left(d, A)) for A in models(pattern))
    assert fourier < 1e-9
    assert brown > 0.1


def test_smooth_models_leave_most_of_the_seams_and_four_cameras_nearly_nothing(pattern):
    low = pattern.height_m == pattern.height_m.min()
    before = rms(pattern.d_px[low])
    brown, fourier = models(pattern)
    for A in (brown, fourier):
        assert 0.7 * before < rms(one_camera.left(pattern.d_px, A)[low]) <= before
    assert rms(one_camera.left_by_heads(pattern, brown)[low]) < 0.1 * before


def test_the_table_has_a_row_for_each_fit_and_a_column_for_each_height(pattern):
    fields = {"nothing": pattern.d_px, "all": 0 * pattern.d_px}
    table = one_camera.left_table(pattern, fields)
    assert [*table.columns] == ["From 1000 m (px)", "From 1500 m (px)"]
    np.testing.assert_allclose(
        table.loc["nothing"].iloc[0], rms(pattern.d_px[pattern.height_m == 1000])
    )
    assert not table.loc["all"].any()


def test_arrows_are_drawn_at_the_lower_height_in_the_colours_of_the_heads(pattern):
    other = replace(pattern, d_px=2 * pattern.d_px)
    fig = one_camera.left_figure(pattern, {"a": pattern.d_px, "b": other.d_px})
    one, two = (ax.collections[0] for ax in fig.axes)
    np.testing.assert_allclose(np.array(two.U), 2 * np.array(one.U))
    assert len(np.unique(one.get_facecolor(), axis=0)) == 4
