"""What a long run leaves is written whole, and read by the book."""

import json

import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.pages.benchmarks import stored as read_by_the_book
from benchmarks import harness


def test_the_book_reads_what_is_written(tmp_path):
    points = pd.DataFrame({"name": ["A"], "x": [1 / 3]})
    harness.write(tmp_path, "runs", {"points": points}, {"cores": 2}, digits=4)
    about, (found,) = read_by_the_book.read(tmp_path, "runs", "points")
    assert about["cores"] == 2
    assert "date" in about
    assert_allclose(found["x"], 0.3333, rtol=0)


def test_files_are_replaced_whole_or_not_at_all(tmp_path):
    harness.write(tmp_path, "runs", {"": pd.DataFrame({"x": [1]})}, {})
    with pytest.raises(TypeError):
        harness.write(tmp_path, "runs", {"": pd.DataFrame({"x": [2]})}, {"cannot": object()})
    assert (tmp_path / "runs.csv").read_text() == "x\n1\n"
    assert "cannot" not in json.loads((tmp_path / "runs.json").read_text())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["runs.csv", "runs.json"]
