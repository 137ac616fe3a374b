"""Time bases of events."""

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import Line
from acx4tools.exchange.trajectories import times
from acx4tools.exchange.trajectories.times import read_events


def stamp(base, *cells):
    line = Line(file="e.txt", number=3, cells=cells)
    return times.stamp(line, base, time=0, week=1 if len(cells) > 1 else None)


def test_every_base():
    assert stamp("gps-week-sow", "100.5", "2300") == (2300.0, 100.5)
    assert stamp("gps-sow", "100.5")[1] == 100.5
    # GPS week 2300 began on Sunday, 4 February 2024; a Monday follows
    assert stamp("iso-8601", "2024-02-05T00:00:01.25Z") == (2300.0, 86_401.25)
    assert stamp("iso-8601", "2024-02-05T02:00:01+02:00") == (2300.0, 86_401.0)
    assert stamp("iso-8601-gps", "2024-02-04 00:00:02") == (2300.0, 2.0)


@pytest.mark.parametrize(
    ("base", "cells", "says"),
    [
        ("gps-sow", ("700000",), "e.txt:3: time: '700000'; must be seconds of the week"),
        ("gps-week-sow", ("1", "1.5"), "must be the GPS week"),
        ("iso-8601", ("2024-02-05T00:00:01",), "needs a zone, such as Z; or declare --time iso-"),
        ("iso-8601-utc", ("2024-02-05T00:00:01Z",), "must have no zone"),
        ("iso-8601", ("5.2.2024",), "must be a date with its time"),
    ],
)
def test_other_cells_are_refused(base, cells, says):
    with pytest.raises(FlightError) as raised:
        stamp(base, *cells)
    assert says in str(raised.value)


def test_events_are_placed_beyond_the_end_of_the_week():
    track = times.continued(np.array([604_798.0, 604_799.0, 0.0, 1.0, 2.0]))
    assert track.tolist() == [604_798, 604_799, 604_800, 604_801, 604_802]
    seconds, weeks = np.array([604_799.5, 1.5]), np.array([2299.0, 2300.0])
    expected = [604_799.5, 604_801.5]
    for own, week in ((np.full(2, np.nan), None), (weeks, None), (weeks, 2299)):
        stamps = times.Stamps(seconds=seconds, weeks=own)
        assert times.on_clock(stamps, track, ahead=0.0, week=week).tolist() == expected
    utc = times.Stamps(seconds=seconds - 18, weeks=weeks)
    assert times.on_clock(utc, track, ahead=18.0, week=2299).tolist() == expected
    other = times.Stamps(seconds=seconds, weeks=weeks + 1)
    assert (times.on_clock(other, track, ahead=0.0, week=2299) > 1_000_000).all()


# --- Lists of events


def read(text, *, base="gps-sow", columns=""):
    source = Opened(file="e.txt", data=text.encode())
    return read_events(source, columns=columns, separator="", base=base)


def test_columns_by_heading_or_by_declaration():
    for text, columns in (
        ("filename;gps_time\nA;1.5\nB;2.5\n", ""),
        ("# log\n7 A 1.5\n8 B 2.5\n", "skip image time"),
        ("no\tphoto\twhen\n7\tA\t1.5\n8\tB\t2.5\n", "skip image time"),
    ):
        found = read(text, columns=columns)
        assert found.names == ["A", "B"]
        assert found.stamps.seconds.tolist() == [1.5, 2.5]


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        ("image,time\nA,1\nA,2\n", {}, "e.txt:3: image: 'A' stands in line 2 already"),
        ("image,time\n=A,1\n", {}, "would be computed as a formula"),
        ("image,time\nA,x\n", {}, "e.txt:2: time: 'x'; must be a finite number"),
        ("image,time\n", {}, "has a heading and no rows"),
        ("image,week,time\nA,1,1\n", {}, "'week' is there; needs --time gps-week-sow"),
        ("image,time\nA,1\n", {"base": "gps-week-sow"}, "'week' is missing"),
        ("A,1\nB,2\n", {}, "e.txt:1: columns: is no heading: 'A 1'; declare them by --columns"),
        ("A,1\n", {"columns": "image tme"}, "column 'tme' is not known (did you mean 'time'?)"),
        ("image,time\nB,1\nA\n", {}, "e.txt:3: time: is missing, the line has 1 cells"),
    ],
)
def test_other_lists_are_refused(text, options, says):
    with pytest.raises(FlightError) as raised:
        read(text, **options)
    assert says in str(raised.value)
