"""Lists of events."""

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories.events import read_events


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
