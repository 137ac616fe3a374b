import numpy as np
import pytest

from acx4tools.measuring.pictures.corners import corners
from acx4tools.measuring.pictures.pairs import MatchOptions, PairJob, found_in, match_pair
from acx4tools.measuring.pictures.views import transferred


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


def test_no_corner_is_no_match(views, surface):
    empty = np.zeros((0, 2), np.intp)
    assert len(found_in(views[0], views[1], surface, empty, MatchOptions())) == 0


def test_options_are_checked():
    with pytest.raises(ValueError, match="search_px"):
        MatchOptions(search_px=0)
