"""Campaigns read by their folders, and named by what differs in their paths."""

from pathlib import Path

import pytest

from acx4book.report.campaigns import study
from acx4lib.errors import FlightError


def test_names_are_the_shortest_ends_that_differ():
    assert study.names_of(["/x/a", "/x/b"]) == ["a", "b"]
    assert study.names_of(["/x/a/results", "/x/b/results"]) == ["a/results", "b/results"]
    assert study.names_of(["/x/a", "/x/a"]) == ["a", "a"]
    assert study.names_of([Path("a")]) == ["a"]


def test_campaigns_are_read_with_date_and_temperature(folders):
    found = study.read(folders)
    assert [c.name for c in found] == ["year2021", "year2024"]
    assert [str(c.session.date) for c in found] == ["2021-05-01", "2024-05-01"]
    assert [c.session.temperature_c for c in found] == [8.0, 32.0]
    methods = [c.method for c in study.read(folders, methods=["two_step"])]
    assert methods == ["two_step", "two_step"]
    methods = [c.method for c in study.read(folders, methods=["single_step", "two_step"])]
    assert methods == ["single_step", "two_step"]


def test_everything_wrong_is_told_at_once(folders, tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(FlightError) as error:
        study.read([tmp_path / "empty", folders[0], tmp_path / "none"])
    assert len(error.value.problems) == 2


def test_a_study_knows_what_has_changed(three):
    assert three.title(three.found[0]) == "2022-05 - 2021-05"
    assert all(map(three.changed, three.found))
    assert three.ground.height_m == 610.0
    assert len(study.study(three.comparison.campaigns, against="first").found) == 2
