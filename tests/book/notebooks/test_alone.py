"""What a notebook makes that runs by itself."""

import re

import pytest

from acx4book.notebooks import alone
from acx4lib.errors import FlightError
from acx4lib.flight import reader
from acx4lib.results import folder
from support.helpers import ROOT


def test_pictures_are_those_of_the_books_flight():
    makefile = (ROOT / "Makefile").read_text("utf-8")
    images = re.search(r"^IMAGES +\?= (\S+)$", makefile, re.MULTILINE)[1]
    reduce = re.search(r"^REDUCE +\?= (\S+)$", makefile, re.MULTILINE)[1]
    assert (",".join(alone.PICTURES), str(alone.REDUCE)) == (images, reduce)


@pytest.mark.slow
def test_the_flight_and_the_stages_before_are_made_once(tmp_path):
    flight, results = tmp_path / "flight-single-head", tmp_path / "results"
    given = {"design": "single-head", "stages": ("mounting",)}
    alone.prepare(flight, results, **given)
    assert "mounting" in {name.partition("/")[0] for name in folder.read(results).summary}
    assert set(reader.read(flight).blocks) >= {"calibration"}
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    alone.prepare(flight, results, **given)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == made


def test_what_is_there_stays(tmp_path):
    (tmp_path / "flight").mkdir()
    alone.prepare(tmp_path / "flight", tmp_path / "results")
    assert list(tmp_path.rglob("*")) == [tmp_path / "flight"]


def test_a_flight_of_ones_own_that_is_not_there_is_not_simulated(tmp_path):
    with pytest.raises(FlightError, match="my_flihgt:1: folder: is no folder"):
        alone.prepare(tmp_path / "my_flihgt", tmp_path / "results", stages=("mounting",))
    assert not list(tmp_path.iterdir())
