"""Files of tables beside those that pandas and the module csv write."""

import csv
import io
import os

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acx4lib.errors import FlightError
from acx4lib.results import table_files

NAMES = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\0"), max_size=4)
NUMBERS = st.floats() | st.integers(-(10**6), 10**6).map(float)
ROWS = st.lists(st.tuples(NAMES, NAMES, NAMES, NUMBERS, NAMES), min_size=1, max_size=6)


def rejected(rows):
    """A table with names and numbers."""
    cells = [("mounting", "rig", *names, number, last) for *names, number, last in rows]
    return pd.DataFrame(cells, columns=list(table_files.COLUMNS["rejected"]))


def text_of(name, frame):
    return b"".join([table_files.header(name), *table_files.lines(name, frame)])


@given(ROWS)
def test_rows_are_written_as_the_module_csv_does(rows):
    frame = rejected(rows).replace("\r", "\n", regex=True)  # csv writes that without quotes
    out = io.StringIO(newline="")
    numbers = [repr(x) if np.isfinite(x) else "" for x in frame["statistic"].tolist()]
    cells = frame.assign(statistic=numbers).itertuples(index=False)
    csv.writer(out, lineterminator="\n").writerows(cells)
    assert b"".join(table_files.lines("rejected", frame)).decode() == out.getvalue()


@given(ROWS)
def test_categories_are_written_as_their_names(rows):
    frame = rejected(rows)
    coded = frame.astype({c: "category" for c in frame.columns if frame[c].dtype != float})
    assert text_of("rejected", coded) == text_of("rejected", frame)


def test_more_rows_than_are_written_together_are_those_of_pandas(rng, monkeypatch):
    monkeypatch.setattr(table_files, "ROWS", 64)
    n = 1000
    names = np.array(["E0", "", "a,b", 'the "one"', "ö"], dtype=object)
    frame = pd.DataFrame(
        {
            **{c: names[rng.integers(0, 5, n)] for c in table_files.COLUMNS["residuals"][:6]},
            **{c: rng.normal(size=n) for c in table_files.COLUMNS["residuals"][6:]},
        }
    )
    frame.loc[::7, "w"] = np.nan
    expected = frame.to_csv(index=False, lineterminator="\n").encode()
    assert text_of("residuals", frame) == expected
    counts = pd.DataFrame(
        [["heads", "bundle", "P", k, *rng.normal(size=6)] for k in range(20)],
        columns=list(table_files.COLUMNS["check_points"]),
    )
    expected = counts.to_csv(index=False, lineterminator="\n").encode()
    assert text_of("check_points", counts) == expected


@given(ROWS)
def test_what_is_written_comes_back(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("files") / "rejected.csv"
    frame = rejected(rows)
    path.write_bytes(text_of("rejected", frame))
    back = table_files.read(path)
    assert back["statistic"].equals(frame["statistic"].replace([np.inf, -np.inf], np.nan))
    names = [column for column in frame.columns if column != "statistic"]
    assert back[names].to_numpy().tolist() == frame[names].to_numpy().tolist()


def test_numbers_come_back_to_the_last_bit(tmp_path, rng):
    bits = rng.integers(0, 1 << 64, 20_000, dtype=np.uint64).view(float)
    values = np.concatenate([bits[np.isfinite(bits)], rng.normal(size=20_000)])
    names = dict.fromkeys(("stage", "method", "row", "column"), "nan")
    frame = pd.DataFrame({**names, "value": values}, index=range(len(values)))
    path = tmp_path / "covariance.csv"
    path.write_bytes(text_of("covariance", frame))
    back = table_files.read(path)
    np.testing.assert_array_equal(back["value"].to_numpy().view(np.uint64), values.view(np.uint64))
    assert set(back["stage"]) == {"nan"}


OLD = [
    ("heads", "bundle", "A"),
    ("mounting", "rig", 'a "b"'),
    ("mounting", "rig", "two\nmounting,rig,lines"),
    ("mounting", "rig_calibration", "C"),
    ("validation", "given", "two\r\nheads,bundle"),
]


@pytest.mark.parametrize("at_a_time", [1, 40, 4_000_000])
@pytest.mark.parametrize(
    ("gone", "left"),
    [
        ([], [0, 1, 2, 3, 4]),
        (["mounting"], [0, 4]),
        (["mounting/rig"], [0, 3, 4]),
        (["heads", "validation/given"], [1, 2, 3]),
        (["heads/bundle/A", "synthetic"], [0, 1, 2, 3, 4]),
    ],
)
def test_rows_that_stay_are_copied_as_they_are(tmp_path, monkeypatch, at_a_time, gone, left):
    monkeypatch.setattr(table_files, "BYTES", at_a_time)
    columns = table_files.COLUMNS["parameters"]
    frame = pd.DataFrame([(*row, "f_mm", 0.1, np.nan, "mm") for row in OLD], columns=list(columns))
    path = tmp_path / "parameters.csv"
    path.write_bytes(text_of("parameters", frame))
    begin = table_files.begins("parameters", gone)
    kept = list(table_files.others(path, begin))
    rows = b"".join(table_files.lines("parameters", frame.iloc[left]))
    assert b"".join(text for _, text in kept) == rows
    assert list(dict.fromkeys(cell for cell, _ in kept)) == list(
        dict.fromkeys(OLD[k][0] for k in left)
    )
    if len(left) < len(OLD):
        assert table_files.holds(path, begin)


@pytest.mark.parametrize(
    ("name", "gone", "begin"),
    [
        ("validation", ["validation"], (b"",)),
        ("validation", ["validation/given"], (b"given,",)),
        ("validation", ["mounting/given"], ()),
        ("synthetic_points", ["synthetic"], (b"",)),
        ("synthetic_points", ["synthetic/points"], (b"",)),
        ("synthetic_points", ["synthetic/refined"], ()),
        ("residuals", ["heads", "mounting/rig"], (b"heads,", b"mounting,rig,")),
    ],
)
def test_tables_without_columns_for_it_are_of_one_stage(name, gone, begin):
    assert table_files.begins(name, gone) == begin


def test_a_table_without_rows_holds_nothing(tmp_path):
    path = tmp_path / "validation.csv"
    path.write_bytes(table_files.header("validation"))
    assert not table_files.holds(path, (b"",))
    assert list(table_files.others(path, ())) == []
    assert len(table_files.read(path)) == 0


def test_what_is_no_table_is_said_with_its_cure(tmp_path):
    path = tmp_path / "covariance.csv"
    path.write_text("stage,method,value,row,column\n")
    with pytest.raises(FlightError, match=r":1: header: .*; must be stage,method,row"):
        table_files.holds(path, (b"mounting,",))
    path.write_text("stage,method\n")
    with pytest.raises(FlightError, match=r":1: header: 'stage,method'; must be stage,method,row"):
        table_files.read(path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(FlightError, match=r":1: file: is no regular file; .*remove it and run"):
        table_files.read(path)


def test_the_rows_of_a_method_are_those_of_the_whole_table(tmp_path):
    path = tmp_path / "rejected.csv"
    cells = [("a\nb", "", '"', 1.0, ""), ("2", "", "é", np.nan, "x"), ("3", "", "", 2.0, "")]
    frame = rejected([cell for cell in cells for _ in range(3)])
    frame["method"] = [*3 * ["two_step"], *2 * ["rig"], "two_step", "rig", *2 * ["single_step"]]
    path.write_bytes(text_of("rejected", frame))
    whole = table_files.read(path)
    for method, first, last in (("two_step", 0, 5), ("rig", 3, 6), ("single_step", 7, 8)):
        begin = table_files.begins("rejected", [f"mounting/{method}"])
        expected = whole.loc[first:last].reset_index(drop=True)
        pd.testing.assert_frame_equal(table_files.read_some(path, begin), expected)


def test_a_table_that_was_written_otherwise_is_read_whole(tmp_path):
    path = tmp_path / "rejected.csv"
    frame = rejected([("1", "", "", 1.0, ""), ("2", "", "", 2.0, "")])
    frame.to_csv(path, index=False, quoting=csv.QUOTE_NONNUMERIC)
    text = path.read_bytes().split(b"\n", 1)[1]
    path.write_bytes(table_files.header("rejected") + text)
    begin = table_files.begins("rejected", ["mounting/rig"])
    assert len(table_files.read_some(path, begin)) == 2
