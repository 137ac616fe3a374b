import csv
import io
import json
import time

import numpy as np
import pandas as pd
import pytest

from acx4files.results import folder as results
from acx4lib.errors import FlightError

THIRD = 1e-14 / 3
HEADER = ",".join(results.COLUMNS["parameters"])


def parameters(*rows):
    columns = results.COLUMNS["parameters"]
    return pd.DataFrame([dict(zip(columns, row, strict=True)) for row in rows], columns=columns)


def heads(value=THIRD):
    row = ("heads", "bundle", "001", "k1", value, 0.1, "mm^-2", 0.0)
    return {
        "tables": {"parameters": parameters(row)},
        "summary": {"heads/bundle/001": {"redundancy": 7}},
    }


def mounting(method, value):
    row = ("mounting", method, "NA", "f_mm", value, np.nan, "mm", np.nan)
    return {
        "tables": {"parameters": parameters(row)},
        "summary": {f"mounting/{method}": {"redundancy": 1}},
    }


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_every_file_is_there_with_its_header_where_it_has_no_rows(tmp_path):
    results.replace(tmp_path / "new" / "folder", [], tables={}, summary={})
    written = contents(tmp_path / "new" / "folder")
    assert sorted(written) == sorted(results.FILES)
    assert [*json.loads(written["summary.json"])] == [results.RUN]
    header = b"stage,method,camera,parameter,value,sigma,unit,sigma_before\n"
    assert written["parameters.csv"] == header
    assert written["validation.csv"].decode().split(",")[:4] == [
        "method",
        "point",
        "image_a",
        "image_b",
    ]


def test_values_come_back_to_the_last_bit_and_names_as_text(tmp_path):
    results.replace(tmp_path, ["heads"], **heads())
    results.replace(tmp_path, ["mounting"], **mounting("two_step", 74.1 / 3))
    found = results.read(tmp_path)
    assert results.parameters(found, "heads/bundle", "001").loc["k1", "value"] == THIRD
    f = results.parameters(found, "mounting/two_step", "NA").loc["f_mm"]
    assert f["value"] == 74.1 / 3
    assert np.isnan(f["sigma"])
    assert f["unit"] == "mm"


def test_only_the_rows_of_what_is_replaced_go(tmp_path):
    results.replace(tmp_path, ["mounting"], **mounting("two_step", 1.0))
    results.replace(tmp_path, ["mounting/two_step_gnss"], **mounting("two_step_gnss", 2.0))
    results.replace(tmp_path, ["mounting/two_step"], **mounting("two_step", 3.0))
    found = results.read(tmp_path)
    assert found.parameters["value"].tolist() == [2.0, 3.0]
    assert set(found.summary) == {"mounting/two_step", "mounting/two_step_gnss"}
    results.replace(tmp_path, ["mounting"], tables={}, summary={})
    assert not results.has(results.read(tmp_path), "mounting")


def test_stages_stand_in_the_papers_order_however_they_were_run(tmp_path):
    for order in ("ab", "ba"):
        for which in order:
            new = heads() if which == "a" else mounting("two_step", 1.0)
            results.replace(tmp_path / order, ["heads" if which == "a" else "mounting"], **new)
    assert contents(tmp_path / "ab") == contents(tmp_path / "ba")
    assert results.read(tmp_path / "ab").parameters["stage"].tolist() == ["heads", "mounting"]


def test_numbers_that_are_not_finite_are_null_or_empty(tmp_path):
    summary = {
        "heads/bundle/A": {"p": np.float64("nan"), "rms": np.array([1.0, np.inf]), "n": np.int64(3)}
    }
    tables = {"parameters": parameters(("heads", "bundle", "A", "k1", 1.0, np.inf, "mm^-2", 0.0))}
    results.replace(tmp_path, ["heads"], tables=tables, summary=summary)
    text = (tmp_path / "summary.json").read_text()
    assert json.loads(text)["heads/bundle/A"] == {"p": None, "rms": [1.0, None], "n": 3}
    assert (tmp_path / "parameters.csv").read_text().endswith("k1,1.0,,mm^-2,0.0\n")


def test_validation_belongs_to_its_stage_though_no_column_says_so(tmp_path):
    row = dict.fromkeys(results.COLUMNS["validation"], 0.5) | {
        "method": "single_step",
        "point": "P1",
        "image_a": "1",
        "image_b": "2",
    }
    tables = {"validation": pd.DataFrame([row])}
    results.replace(tmp_path, ["validation"], tables=tables, summary={"validation/single_step": {}})
    results.replace(tmp_path, ["heads"], **heads())
    found = results.read(tmp_path)
    assert results.rows(found, "validation", "validation/single_step")["d_east_m"].tolist() == [0.5]
    with pytest.raises(
        FlightError, match="no results of validation/two_step; run stage validation"
    ):
        results.rows(found, "validation", "validation/two_step")


def test_covariance_is_square_in_the_order_of_its_rows(tmp_path):
    pairs = [("B/f", "B/f", 4.0), ("B/f", "A/k", -1.0), ("A/k", "B/f", -1.0), ("A/k", "A/k", 9.0)]
    pairs.append(("C/f", "C/f", 16.0))
    long = pd.DataFrame(pairs, columns=["row", "column", "value"])
    tables = {"covariance": long.assign(stage="heads", method="bundle")}
    results.replace(tmp_path, ["heads/bundle"], tables=tables, summary={"heads/bundle/B": {}})
    square = results.covariance(results.read(tmp_path), "heads/bundle")
    assert square.index.tolist() == square.columns.tolist() == ["B/f", "A/k", "C/f"]
    np.testing.assert_array_equal(square, [[4, -1, 0], [-1, 9, 0], [0, 0, 16]])


def test_a_missing_stage_is_named_with_what_to_run(tmp_path):
    with pytest.raises(FlightError, match=r"no results of heads/bundle; run stage heads first"):
        results.parameters(results.read(tmp_path), "heads/bundle", "CAM1")


def test_a_method_that_was_left_out_says_why(tmp_path):
    summary = {"mounting/two_step": {"left_out": ["two_step: only two control points"]}}
    results.replace(tmp_path, ["mounting"], tables={}, summary=summary)
    found = results.read(tmp_path)
    assert results.cameras(found, "mounting/two_step") == ()
    assert results.covariance(found, "mounting/two_step").shape == (0, 0)
    with pytest.raises(FlightError, match="for camera SYN; two_step: only two control points"):
        results.parameters(found, "mounting/two_step", "SYN")


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("parameters.csv", "stage,method\nheads,bundle\n", "has the columns stage,method, not"),
        (
            "parameters.csv",
            f"{HEADER}\nheads,b,A,f,x,1,mm,0\n",
            "could not convert string to float: 'x'|Unable to parse",
        ),
        ("parameters.csv", f"{HEADER}\nx,heads,b,A,f,1,1,mm,0\n", "of another width"),
        ("summary.json", "{", "is not JSON"),
        ("summary.json", "[]", "must be one object"),
        ("summary.json", '{"mine": 1}', "mine is not of a stage"),
    ],
)
def test_a_file_that_is_no_result_is_named(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(FlightError, match=rf"{name}:.*({said}).* another folder"):
        results.read(tmp_path)


def test_numbers_and_names_are_written_as_python_and_its_csv_write_them(tmp_path):
    """Whatever their bits and characters are, in one part or in several."""
    rng = np.random.default_rng(1)
    bits = rng.integers(0, 2**64, 20_000, dtype=np.uint64, endpoint=False).view(float)
    numbers = np.concatenate([bits, rng.normal(size=1000), [0.0, -0.0, 5e-324, 1e16, 1e-5, 123.0]])
    names = np.array(['A "quoted", name', "ÄÖ 北", " blank ", "NA"], dtype=object)
    text = dict.fromkeys(results.COLUMNS["residuals"][3:6])
    frame = pd.DataFrame(
        {
            "stage": "mounting",
            "method": pd.Categorical(["single_step"] * len(numbers)),
            "kind": "image_point",
            **{name: names[np.arange(len(numbers)) % 4] for name in text},
            **dict.fromkeys(("v", "sigma", "redundancy", "w"), numbers),
        }
    )
    for parts in (frame, [frame[:5000], frame[5000:]]):
        results.replace(tmp_path, ["mounting"], tables={"residuals": parts}, summary={})
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(results.COLUMNS["residuals"])
        for row in frame.itertuples(index=False):
            numbers_of_row = [repr(x) if np.isfinite(x) else "" for x in row[6:]]
            writer.writerow([*row[:6], *numbers_of_row])
        assert (tmp_path / "residuals.csv").read_text() == buffer.getvalue()
    found = results.read(tmp_path).residuals
    assert found["point"].tolist() == frame["point"].tolist()
    np.testing.assert_array_equal(found["v"], np.where(np.isfinite(numbers), numbers, np.nan))


@pytest.mark.slow
def test_a_million_residuals_are_written_in_three_seconds(tmp_path):
    rng, n = np.random.default_rng(1), 1_000_000
    names = [f"P{i:06d}" for i in range(200_000)]
    frame = pd.DataFrame(
        {
            **{name: pd.Categorical([name]).repeat(n) for name in results.COLUMNS["residuals"][:6]},
            **{name: rng.normal(size=n) for name in results.COLUMNS["residuals"][6:]},
        }
    )
    frame["stage"] = pd.Categorical(["mounting"]).repeat(n)
    frame["point"] = pd.Categorical.from_codes(rng.integers(0, len(names), n), names)
    before = time.process_time()
    results.replace(tmp_path, ["mounting"], tables={"residuals": frame}, summary={})
    assert time.process_time() - before < 6.0  # three, on a machine that does nothing else
