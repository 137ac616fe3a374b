import cv2
import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from acx4tools.measuring.pictures import views as v
from acx4tools.measuring.pictures.ground import Surface

CAMERA = Camera(name="C", width_px=40, height_px=27, pixel_mm=0.1, interior=Interior(f=50.0))


def test_pixels_and_ground_are_inverse_to_each_other(views, surface, rng):
    view = views[0]
    size = [view.camera.width_px - 1, view.camera.height_px - 1]
    colrow = rng.uniform(0, 1, (50, 2)) * size
    x_m = v.ground_of(view, surface, colrow)
    np.testing.assert_allclose(x_m[:, 2], surface.heights(x_m[:, :2]), atol=0.05)
    np.testing.assert_allclose(v.pixels_of(view, x_m), colrow, atol=1e-6)


def test_there_and_back_is_where_one_was(views, surface, rng):
    middle = np.array([views[0].camera.width_px, views[0].camera.height_px]) / 2
    colrow = middle + rng.uniform(-150, 150, (50, 2))
    there = v.transferred(views[0], views[2], surface, colrow)
    back = v.transferred(views[2], views[0], surface, there)
    np.testing.assert_allclose(back, colrow, atol=0.02)


def test_a_ray_to_the_sky_meets_nothing(views):
    high = Surface(origin=np.zeros(2), cell_m=1.0, z=np.full((1, 1), 9e3))
    assert np.isnan(v.ground_of(views[0], high, np.array([[10.0, 10.0]]))).all()


def test_the_size_of_the_matching_changes_no_place(views):
    colrow = np.array([[100.0, 40.0], [0.0, 0.0]])
    small = v.seen_at(views[0], 32)
    np.testing.assert_allclose(small.full(small.own(views[0].full(colrow))), views[0].full(colrow))
    assert small.camera.width_px == 11608 // 32


@pytest.mark.parametrize("shrink", [1, 2, 3, 5])
def test_a_smaller_picture_has_its_middle_in_the_middle(tmp_path, shrink):
    ramp = np.add.outer(3 * np.arange(27), np.arange(40)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "p.png"), ramp)
    small = v.pixels(tmp_path / "p.png", (40, 27), shrink)
    assert small.shape[:2] == (27 // shrink, 40 // shrink)
    assert np.mean(small) == pytest.approx(
        3 * 13 + 19.5, abs=1e-4
    )  # of a plane, that in the middle


def test_the_size_of_a_file_is_checked(tmp_path):
    cv2.imwrite(str(tmp_path / "half.png"), np.zeros((13, 20), np.uint8))
    assert v.size_on_file(tmp_path / "half.png", CAMERA) == 2
    cv2.imwrite(str(tmp_path / "other.jpg"), np.zeros((30, 20), np.uint8))
    with pytest.raises(FlightError, match=r"other.jpg: has 20 x 30 px; C has 40 x 27"):
        v.size_on_file(tmp_path / "other.jpg", CAMERA)


def test_a_damaged_or_missing_file_is_named(tmp_path):
    (tmp_path / "bad.jpg").write_bytes(b"\xff\xd8\xff nothing")
    with pytest.raises(FlightError, match=r"bad.jpg: is damaged"):
        v.size_on_file(tmp_path / "bad.jpg", CAMERA)
    with pytest.raises(FlightError, match=r"gone.jpg: there is no such file"):
        v.size_on_file(tmp_path / "gone.jpg", CAMERA)


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_a_picture_that_is_cut_in_half_is_refused(tmp_path, suffix, rng):
    path, cut = tmp_path / f"whole.{suffix}", tmp_path / f"cut.{suffix}"
    cv2.imwrite(str(path), rng.integers(0, 255, (27, 40)).astype(np.uint8))
    assert v.pixels(path, (40, 27), 1).shape == (27, 40, 1)
    cut.write_bytes(path.read_bytes()[: 2 * path.stat().st_size // 3])
    with pytest.raises(FlightError, match="is cut off, its pixels have no end"):
        v.pixels(cut, (40, 27), 1)
