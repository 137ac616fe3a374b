"""Rows as Python's module csv reads them, whether commas alone cut a text or not."""

import csv
import io

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acx4lib.flight.tables import read_header, read_rows

CELLS = st.text(alphabet=" 1ü\x0b\x85\u2028", max_size=3)
END = st.sampled_from(["\n", "\r\n", "\r"])


@given(rows=st.lists(st.tuples(CELLS, CELLS, CELLS), max_size=30), end=END, quoted=st.booleans())
def test_rows_are_those_of_the_module_csv(rows, end, quoted):
    header = '"a",b,c' if quoted else "a,b,c"
    text = end.join([header, *map(",".join, rows)])
    found, problems = read_rows(text, "t.csv", width=3, wanted={"a": 0, "c": 2}, names=["a"])
    _, *expected = csv.reader(io.StringIO(text, newline=""))
    while expected and not any(map(str.strip, expected[-1])):
        expected.pop()
    assert not problems
    assert list(zip(found.columns["a"], found.columns["c"], strict=True)) == [
        (first, last) for first, _, last in expected
    ]
    assert list(found.lines) == list(range(2, 2 + len(expected)))


@pytest.mark.parametrize("quote", ["", '"'])
def test_a_long_cell_is_named_with_its_line_and_long_tables_are_read_in_parts(quote):
    longest = csv.field_size_limit()
    rows = [f"{k},{'x' * 1000}" for k in range(longest // 500)]
    text = "\n".join([f"{quote}a{quote},b", *rows])
    found, problems = read_rows(text, "t.csv", width=2, wanted={"a": 0})
    assert not problems
    assert found.columns["a"] == [str(k) for k in range(len(rows))]
    _, (problem,) = read_rows(f"{text}\n{'y' * (longest + 1)},", "t.csv", width=2, wanted={"a": 0})
    assert (problem.line, problem.found) == (len(rows) + 2, "a cell is too long")


def test_a_quoted_header_may_have_more_than_one_line():
    assert read_header('"a\nb",c\n1,2\n', "t.csv") == (["a\nb", "c"], ())
    assert read_header("a,b\n1,2\n", "t.csv") == (["a", "b"], ())
