import numpy as np
import pytest

from acx4lib.geometry.frames import Pose, exp
from acx4lib.results import own_folder
from acx4tools.measuring.levels import corners
from acx4tools.measuring.pairs import (
    FOLDER,
    Matching,
    MatchOptions,
    PairJob,
    agree,
    distances,
    found_in,
    laid_patches,
    own_patches,
)
from acx4tools.measuring.views import View, ground_of, pixels_of, pixels_of_view, transferred


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


def test_a_pair_keeps_what_agrees_in_both_directions(views, surface, tmp_path):
    at = [corners(view, number=60, margin=13) for view in views[:2]]
    job = PairJob(
        a=views[0], b=views[1], surface=surface, at_a=at[0], at_b=at[1], options=MatchOptions()
    )
    with own_folder.claim(tmp_path / "out", command="acx4 measure") as own:
        ((there, back),) = Matching(own=own).run([job], lambda *_: None)
    assert len(there) > 10
    assert len(back) > 10


def test_no_corner_is_no_match(views, surface):
    empty = np.zeros((0, 2), np.intp)
    assert len(found_in(views[0], views[1], surface, empty, MatchOptions())) == 0


def test_options_are_checked():
    with pytest.raises(ValueError, match="search_px"):
        MatchOptions(search_px=0)


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


def test_a_few_matches_are_not_believed(views, surface, rng):
    a, b = seen(views, surface, rng, n=8)
    assert not agree(views[0], views[1], a, b, least_px=0.5).any()


AT = np.array([[700, 500], [600, 420]])


def test_sides_are_odd_and_reach_far_enough():
    """By whole steps of 8 px: windows, search and splines reach 24 px, 25 px and 29 px."""
    assert [MatchOptions(search_px=n).side for n in (1, 2, 6)] == [49, 65, 65]


def test_own_patches_are_the_pixels_themselves(views):
    patches = own_patches(views[0], np.array([[700, 500], [3, 2]]), 17)
    image = pixels_of_view(views[0]).mean(axis=2)
    np.testing.assert_allclose(patches.grey[:17], image[492:509, 692:709], rtol=1e-6)
    assert np.isnan(patches.grey[17:][:6]).all()  # beyond the border
    np.testing.assert_allclose(patches.grey[17:][6:, 5:], image[:11, :12], rtol=1e-6)


def test_a_picture_laid_on_a_crossing_one_shows_the_same(views, surface):
    """The strips cross at other heights: without being turned nothing would correlate."""
    a, b = views[0], views[2]
    own, laid = own_patches(a, AT, 33), laid_patches(a, b, surface, AT, 33)
    seen = np.isfinite(laid.grey)
    assert seen.mean() > 0.9
    assert np.corrcoef(own.grey[seen], laid.grey[seen])[0, 1] > 0.7
    np.testing.assert_allclose(laid.scale, 0.6, atol=0.05)  # 600 m to 1000 m above ground


def test_the_middle_of_a_patch_has_the_grey_value_of_its_place(views, surface):
    a, b = views[1], views[0]
    laid = laid_patches(a, b, surface, AT, 17)
    grey = pixels_of_view(b).mean(axis=2)
    for (col, row), (x, y) in zip(
        laid.middles, transferred(a, b, surface, AT.astype(float)), strict=True
    ):
        near = grey[int(y) - 1 : int(y) + 3, int(x) - 1 : int(x) + 3]
        assert near.min() - 500 <= laid.grey[row, col] <= near.max() + 500


@pytest.fixture
def job(views, surface):
    at = [corners(view, number=40, margin=13) for view in views[:2]]
    return PairJob(
        a=views[0], b=views[1], surface=surface, at_a=at[0], at_b=at[1], options=MatchOptions()
    )


class Forbidden:
    """An executor to which nothing may be given."""

    def submit(self, *_):
        raise AssertionError("matched again")


def test_a_pair_that_was_matched_is_not_matched_again(job, tmp_path):
    told = []
    with own_folder.claim(tmp_path / "out", command="acx4 measure") as own:
        (first,) = Matching(own=own).run([job], lambda *n: told.append(n))
    assert told == [(0, 1), (1, 1)]
    with own_folder.claim(tmp_path / "out", command="acx4 measure") as own:
        matching = Matching(own=own, executor=Forbidden())
        (again,) = matching.run([job], lambda *n: told.append(n))
        assert told[2:] == [(1, 1)]
        for a, b in zip(first, again, strict=True):
            np.testing.assert_array_equal(a.colrow, b.colrow)
        matching.forget()
    assert not (tmp_path / "out" / FOLDER).exists()


def test_a_damaged_pair_is_matched_again(job, tmp_path):
    with own_folder.claim(tmp_path / "out", command="acx4 measure") as own:
        (first,) = Matching(own=own).run([job], lambda *_: None)
        (path,) = (own.path / FOLDER).iterdir()
        path.write_bytes(path.read_bytes()[:100])
        (again,) = Matching(own=own).run([job], lambda *_: None)
    np.testing.assert_array_equal(first[0].colrow, again[0].colrow)
