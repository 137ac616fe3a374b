"""Names and folders of many flights."""

import re
from pathlib import Path

import pytest

from acx4book.command import runs

SETTINGS = runs.Settings(stages=("mounting",))


def named(*paths):
    return [job.name for job in runs.of_flights([Path(p) for p in paths], Path("out"), SETTINGS)]


def test_names_are_those_of_the_folders_and_longer_only_where_they_clash():
    assert named("/a/north", "/b/south") == ["north", "south"]
    assert named("/x/a/flight", "/x/b/flight", "/x/other") == ["a-flight", "b-flight", "other"]
    assert named("/x/a/1/f", "/x/b/1/f", "/x/b/2/f") == ["a-1-f", "b-1-f", "2-f"]
    assert named("/f", "/a/f") == ["f", "a-f"]


def test_a_name_is_that_of_the_folder_however_it_is_called(tmp_path, monkeypatch):
    flight = tmp_path / "real"
    flight.mkdir()
    (tmp_path / "link").symlink_to(flight)
    monkeypatch.chdir(flight)
    assert named(".", "../link", "../other/") == ["real", "link", "other"]
    (job, *_) = runs.of_flights([Path()], Path("../out"), SETTINGS)
    assert (job.flight, job.results) == (flight, tmp_path / "out" / "real")


@pytest.mark.parametrize(
    ("paths", "says"),
    [
        (["/a/f", "/a/../a/f"], "/a/f: is given twice"),
        (["/a/b-f", "/a-b/f", "/c/f", "/c/b-f"], "another flight would be called a-b-f"),
        (["/a/flights.csv"], "a folder of results cannot be called 'flights.csv'; rename"),
        (["/a/.hidden"], "cannot be called '.hidden'"),
        (["/"], "cannot be called ''"),
        (["/a/=1+1"], "'=1+1' would be computed as a formula by a spreadsheet; rename"),
        (["/a/b\nc"], "holds the character U+000A; rename"),
    ],
)
def test_flights_that_cannot_be_named_are_refused(paths, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        named(*paths)


def test_seeds_are_of_every_design_and_have_places_for_their_flights(tmp_path):
    found = runs.of_seeds(["acx4", "single-head", "acx4"], [2, 5], tmp_path, SETTINGS)
    assert [job.name for job in found] == ["acx4-2", "acx4-5", "single-head-2", "single-head-5"]
    assert (found[3].design, found[3].seed) == ("single-head", 5)
    assert found[3].flight == tmp_path / "simulated" / "single-head-5"
    assert found[3].results == tmp_path / "single-head-5"


def test_plans_that_would_have_one_name_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"/a/p\.toml: another flight would be called p-1, too"):
        runs.of_seeds(["/a/p.toml", "/b/p.toml"], [1], tmp_path, SETTINGS)


def test_seeds_are_ranges_and_numbers_each_once():
    assert runs.seeds_of("1-3") == [1, 2, 3]
    assert runs.seeds_of("7, 1-3,2,0") == [7, 1, 2, 3, 0]


@pytest.mark.parametrize("text", ["", "1-", "-1", "3-1", "1.5", "1,,2", "a", "²", "1-2-3"])
def test_what_names_no_seeds_is_refused(text):
    with pytest.raises(ValueError, match="names no seeds; give whole numbers, as in 1-200"):
        runs.seeds_of(text)
