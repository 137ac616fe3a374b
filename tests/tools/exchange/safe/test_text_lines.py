"""Lines of text are cut into cells that know their place."""

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.flight.problems import Range
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import Cursor, cut, lines, records

SMALL = Range(-1.0, 1.0)


def read(text, **options):
    return list(lines(Opened(file="a.txt", data=text.encode()), **options))


@pytest.mark.parametrize(
    ("text", "separator", "cells"),
    [
        ("a  1\t2", None, ("a", "1", "2")),
        ("'a b' \"c d\" 2", None, ("a b", "c d", "2")),
        ("a , 1,,2", ",", ("a", "1", "", "2")),
        ('"a, b", 1, "", 2', ",", ("a, b", "1", "", "2")),
        ('"a;b";1', ";", ("a;b", "1")),
    ],
)
def test_cells(text, separator, cells):
    assert cut(text, separator) == cells


def test_lines_keep_their_numbers_and_comments_are_left_out():
    found = read("# x\r\n\r\na 1 2\rb 3 4\n", comment="#")
    assert [(line.number, line.cells[0]) for line in found] == [(3, "a"), (4, "b")]
    assert found[1].numbers(1, None, "x y").tolist() == [3, 4]
    assert found[1].whole_at(2, "y") == 4


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (lambda x: x.number_at(1, "east"), "a.txt:1: east: '1,5'; must be a finite number"),
        (lambda x: x.number_at(2, "east"), "a.txt:1: east: 'inf'; must be a finite number"),
        (lambda x: x.number_at(3, "north"), "a.txt:1: north: is missing, the line has 3 cells"),
        (lambda x: x.numbers(1, 3, "x y"), "a.txt:1: x y: '1,5'; must be a finite number"),
        (lambda x: x.whole_at(0, "id"), "a.txt:1: id: 'a'; must be a whole number"),
        (lambda x: x.numbers(3, 5, "x", SMALL), "a.txt:1: x: '9'; must lie between -1 and 1"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(do, says):
    (line,) = read("a 1,5 inf 0.5 9" if "'9'" in says else "a 1,5 inf")
    with pytest.raises(FlightError) as raised:
        do(line)
    assert says in str(raised.value)


# --- Binary files are read within their size


def test_records_of_one_layout():
    found = records(Opened(file="a", data=bytes([1, 0, 2, 0])), np.dtype("<u2"))
    assert found.tolist() == [1, 2]
    with pytest.raises(FlightError, match="a:1: file: has 3 bytes; must be a multiple of 2"):
        records(Opened(file="a", data=bytes(3)), np.dtype("<u2"))


def test_values_one_after_another():
    cursor = Cursor(source=Opened(file="a", data=b"\x01\x02ab\0\x03\0\x04\0"))
    assert cursor.take("<BB", "id") == (1, 2)
    assert cursor.text("name") == "ab"
    assert cursor.array(np.dtype("<u2"), 2, "points").tolist() == [3, 4]
    assert cursor.left == 0


@pytest.mark.parametrize(
    ("do", "says"),
    [
        (lambda c: c.take("<Q", "id"), "a:1: id: at byte 0: 8 bytes, 3 are left; must be complete"),
        (lambda c: c.array(np.dtype("<u8"), 2**60, "points"), "3 are left"),
        (lambda c: c.array(np.dtype("<u8"), -1, "points"), "must be complete"),
        (lambda c: c.text("name"), "a:1: name: text at byte 0 has no end"),
    ],
)
def test_what_is_cut_off_is_refused(do, says):
    with pytest.raises(FlightError) as raised:
        do(Cursor(source=Opened(file="a", data=b"abc")))
    assert says in str(raised.value)
