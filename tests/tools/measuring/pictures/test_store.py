import numpy as np
import pytest

from acx4lib.results import own_folder
from acx4tools.measuring.pictures.corners import corners
from acx4tools.measuring.pictures.pairs import MatchOptions, PairJob
from acx4tools.measuring.pictures.store import FOLDER, Matching


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
