import cv2
import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from acx4tools.measuring import views as measuring_views
from acx4tools.measuring.views import Surface

CAMERA = Camera(name="C", width_px=40, height_px=27, pixel_mm=0.1, interior=Interior(f=50.0))


def test_pixels_and_ground_are_inverse_to_each_other(views, surface, rng):
    view = views[0]
    size = [view.camera.width_px - 1, view.camera.height_px - 1]
    colrow = rng.uniform(0, 1, (50, 2)) * size
    x_m = measuring_views.ground_of(view, surface, colrow)
    np.testing.assert_allclose(x_m[:, 2], surface.heights(x_m[:, :2]), atol=0.05)
    np.testing.assert_allclose(measuring_views.pixels_of(view, x_m), colrow, atol=1e-6)


def test_there_and_back_is_where_one_was(views, surface, rng):
    middle = np.array([views[0].camera.width_px, views[0].camera.height_px]) / 2
    colrow = middle + rng.uniform(-150, 150, (50, 2))
    there = measuring_views.transferred(views[0], views[2], surface, colrow)
    back = measuring_views.transferred(views[2], views[0], surface, there)
    np.testing.assert_allclose(back, colrow, atol=0.02)


def test_a_ray_to_the_sky_meets_nothing(views):
    high = Surface(origin=np.zeros(2), cell_m=1.0, z=np.full((1, 1), 9e3))
    assert np.isnan(measuring_views.ground_of(views[0], high, np.array([[10.0, 10.0]]))).all()


def test_the_size_of_the_matching_changes_no_place(views):
    colrow = np.array([[100.0, 40.0], [0.0, 0.0]])
    small = measuring_views.seen_at(views[0], 32)
    np.testing.assert_allclose(small.full(small.own(views[0].full(colrow))), views[0].full(colrow))
    assert small.camera.width_px == 11608 // 32


@pytest.mark.parametrize("shrink", [1, 2, 3, 5])
def test_a_smaller_picture_has_its_middle_in_the_middle(tmp_path, shrink):
    ramp = np.add.outer(3 * np.arange(27), np.arange(40)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "p.png"), ramp)
    small = measuring_views.pixels(tmp_path / "p.png", (40, 27), shrink)
    assert small.shape[:2] == (27 // shrink, 40 // shrink)
    assert np.mean(small) == pytest.approx(
        3 * 13 + 19.5, abs=1e-4
    )  # of a plane, that in the middle


def test_the_size_of_a_file_is_checked(tmp_path):
    cv2.imwrite(str(tmp_path / "half.png"), np.zeros((13, 20), np.uint8))
    assert measuring_views.size_on_file(tmp_path / "half.png", CAMERA) == 2
    cv2.imwrite(str(tmp_path / "other.jpg"), np.zeros((30, 20), np.uint8))
    with pytest.raises(FlightError, match=r"other.jpg: has 20 x 30 px; C has 40 x 27"):
        measuring_views.size_on_file(tmp_path / "other.jpg", CAMERA)


def test_a_damaged_or_missing_file_is_named(tmp_path):
    (tmp_path / "bad.jpg").write_bytes(b"\xff\xd8\xff nothing")
    with pytest.raises(FlightError, match=r"bad.jpg: is damaged"):
        measuring_views.size_on_file(tmp_path / "bad.jpg", CAMERA)
    with pytest.raises(FlightError, match=r"gone.jpg: there is no such file"):
        measuring_views.size_on_file(tmp_path / "gone.jpg", CAMERA)


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_a_picture_that_is_cut_in_half_is_refused(tmp_path, suffix, rng):
    path, cut = tmp_path / f"whole.{suffix}", tmp_path / f"cut.{suffix}"
    cv2.imwrite(str(path), rng.integers(0, 255, (27, 40)).astype(np.uint8))
    assert measuring_views.pixels(path, (40, 27), 1).shape == (27, 40, 1)
    cut.write_bytes(path.read_bytes()[: 2 * path.stat().st_size // 3])
    with pytest.raises(FlightError, match="is cut off, its pixels have no end"):
        measuring_views.pixels(cut, (40, 27), 1)


def test_a_plane_has_its_height_everywhere():
    assert (
        measuring_views.level(430.0).heights(np.array([[0.0, 0.0], [1e4, -1e4]])).tolist()
        == [430.0] * 2
    )


def test_a_slope_is_followed_and_ends_level(rng):
    x_m = rng.uniform(0, 1000, (3000, 3))
    x_m[:, 2] = 100 + 0.05 * x_m[:, 0] - 0.02 * x_m[:, 1]
    surface = measuring_views.through(x_m)
    inner = rng.uniform(150, 850, (200, 2))
    expected = 100 + 0.05 * inner[:, 0] - 0.02 * inner[:, 1]
    assert np.max(np.abs(surface.heights(inner) - expected)) < 2.5  # a cell has 21 m
    edge = surface.heights(np.array([[3000.0, 500.0], [5000.0, 500.0]]))
    assert edge[0] == edge[1]


def test_a_few_points_far_off_their_neighbours_hardly_count(rng):
    x_m = rng.uniform(0, 100, (20000, 3))
    x_m[:, 2] = 5.0
    x_m[::40, 2] = 80.0
    off = np.abs(measuring_views.through(x_m).heights(x_m[:, :2]) - 5.0)
    assert np.mean(off > 1e-3) < 0.05  # two of them in one cell


def test_holes_are_filled_from_around(rng):
    x_m = rng.uniform(0, 100, (4000, 3))
    x_m[:, 2] = 7.0
    x_m = x_m[np.hypot(*(x_m[:, :2] - 50).T) > 30]
    assert (
        np.max(np.abs(measuring_views.through(x_m).heights(np.array([[50.0, 50.0]])) - 7.0)) < 1e-6
    )


def test_one_point_is_a_plane():
    assert measuring_views.through(np.array([[1.0, 2.0, 3.0]])).heights(np.zeros((1, 2)))[0] == 3.0
