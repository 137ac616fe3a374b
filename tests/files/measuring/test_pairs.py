"""Pairs of pictures are matched, by views of the ground."""

import cv2
import numpy as np
import pytest

from acx4files.measuring import views as measuring_views
from acx4files.measuring.levels import corners
from acx4files.measuring.pairs import (
    MatchOptions,
    PairJob,
    agree,
    distances,
    found_in,
    laid_patches,
    match_pair,
    own_patches,
)
from acx4files.measuring.views import (
    View,
    ground_of,
    pixels_of,
    transferred,
)
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, exp


@pytest.mark.parametrize("other", [1, 2])
def test_opposite_and_crossing_strips_match(views, surface, other):
    at = corners(views[0], number=150, margin=13)
    found = found_in(views[0], views[other], surface, at, MatchOptions())
    assert len(found) > 25
    predicted = transferred(views[0], views[other], surface, at[found.which].astype(float))
    assert np.median(np.hypot(*(found.colrow - predicted).T)) < 1.5
    assert np.all(found.sigma_px < 0.6)


def test_there_and_back_is_the_same_place(views, surface):
    at = corners(views[0], number=60, margin=20)
    there = found_in(views[0], views[1], surface, at, MatchOptions())
    whole = np.rint(there.colrow).astype(int)
    back = found_in(views[1], views[0], surface, whole, MatchOptions())
    part = (there.colrow - whole)[back.which]  # the whole pixel beside the place was matched
    here = transferred(views[1], views[0], surface, whole[back.which] + part)
    moved = here - transferred(views[1], views[0], surface, whole[back.which].astype(float))
    off = back.colrow + moved - at[there.which[back.which]]
    assert np.median(np.hypot(*off.T)) < 0.1


def test_a_pair_keeps_what_agrees_in_both_directions(views, surface):
    at = [corners(view, number=60, margin=13) for view in views[:2]]
    job = PairJob(
        a=views[0], b=views[1], surface=surface, at_a=at[0], at_b=at[1], options=MatchOptions()
    )
    there, back = match_pair(job)
    assert len(there) > 10
    assert len(back) > 10


def seen(views, surface, rng, n=200):
    size = [views[0].camera.width_px - 1, views[0].camera.height_px - 1]
    x_m = ground_of(views[0], surface, rng.uniform(0.1, 0.9, (n, 2)) * size)
    x_m[:, 2] += rng.uniform(-10, 10, n)  # relief that the surface does not know
    return pixels_of(views[0], x_m), pixels_of(views[1], x_m)


def turned(view, by):
    T = Pose(R=view.T_m_c.R @ exp(np.array([by])), r=view.T_m_c.r)
    return View(**{**view.__dict__, "T_m_c": T})


def test_points_of_one_plane_with_both_cameras_have_no_distance(views, surface, rng):
    a, b = seen(views, surface, rng)
    assert np.max(np.abs(distances(views[0], views[1], a, b))) < 1e-6


def test_a_shift_across_the_line_is_its_distance(views, surface, rng):
    a, b = seen(views, surface, rng)
    off = [distances(views[0], views[1], a, b + step)[:, 0] for step in ([2.0, 0], [0, 2.0])]
    both = np.hypot(*off)
    assert np.all((both > 1.2) & (both < 2.05))  # across lines that are not quite straight


def test_a_wrong_orientation_is_no_false_match(views, surface, rng):
    a, b = seen(views, surface, rng)
    wrong = turned(views[1], [0.003, -0.004, 0.005])
    assert np.max(np.abs(distances(views[0], wrong, a, b))) > 2
    assert agree(views[0], wrong, a, b, least_px=0.5).all()


def test_false_matches_are_found_beside_a_wrong_orientation(views, surface, rng):
    a, b = seen(views, surface, rng)
    false = rng.random(len(a)) < 0.2
    b = b + rng.normal(0, 0.05, b.shape)
    b[false] += rng.uniform(3, 12, (false.sum(), 2))
    near = agree(views[0], turned(views[1], [0.003, -0.004, 0.005]), a, b, least_px=0.5)
    assert np.all(near[~false])
    across = np.abs(distances(views[0], views[1], a, b)[:, 0])
    assert not np.any(near & (across > 2.0))


AT = np.array([[700, 500], [600, 420]])


def test_a_picture_laid_on_a_crossing_one_shows_the_same(views, surface):
    """The strips cross at other heights: without being turned nothing would correlate."""
    a, b = views[0], views[2]
    own, laid = own_patches(a, AT, 33), laid_patches(a, b, surface, AT, 33)
    seen = np.isfinite(laid.grey)
    assert seen.mean() > 0.9
    assert np.corrcoef(own.grey[seen], laid.grey[seen])[0, 1] > 0.7
    np.testing.assert_allclose(laid.scale, 0.6, atol=0.05)  # 600 m to 1000 m above ground


# --- Views


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


def test_a_damaged_or_missing_file_is_named(tmp_path):
    (tmp_path / "bad.jpg").write_bytes(b"nothing")
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


def test_a_slope_is_followed_and_ends_level(rng):
    x_m = rng.uniform(0, 1000, (3000, 3))
    x_m[:, 2] = 100 + 0.05 * x_m[:, 0] - 0.02 * x_m[:, 1]
    surface = measuring_views.through(x_m)
    inner = rng.uniform(150, 850, (200, 2))
    expected = 100 + 0.05 * inner[:, 0] - 0.02 * inner[:, 1]
    assert np.max(np.abs(surface.heights(inner) - expected)) < 2.5  # a cell has 21 m
    edge = surface.heights(np.array([[3000.0, 500.0], [5000.0, 500.0]]))
    assert edge[0] == pytest.approx(edge[1], abs=1e-9)
