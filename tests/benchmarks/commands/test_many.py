"""What is timed for the page on speed: many flights, imports, measuring."""

import pandas as pd
import pytest

from acx4book.pages.build import BENCHMARKS
from benchmarks.commands import imports, many, measuring
from support.helpers import ROOT, needs

# --- many flights are timed in every way, and their bytes compared ---------------------------


@pytest.mark.slow
@pytest.mark.repeats
def test_a_row_for_every_way(tmp_path):
    rows = list(many.measured(tmp_path, 1))
    assert [row["way"] for row in rows] == ["one process", "two processes", "cluster"]
    assert all(row["flights"] == 1 and row["worker_mb"] > 50 for row in rows)
    assert all(row["wall_s"] > 0 and row["cpu_s"] > 0 for row in rows)
    assert set(many.left(tmp_path / "cluster")) == {
        "flights.csv",
        "single-head-1/.acx4.json",
    }


def test_other_bytes_end_it(tmp_path, monkeypatch):
    bytes_left = iter([{"a": b"1"}, {"a": b"1"}, {"a": b"2"}, {"a": b"1"}])
    monkeypatch.setattr(many, "left", lambda _: next(bytes_left))
    monkeypatch.setattr(many.harness, "timed", lambda *_: {"wall_s": 1.0})
    monkeypatch.setattr(many.harness, "called", lambda *_: "")
    for way in many.WORKERS:
        (tmp_path / way).mkdir()
        (tmp_path / way / "times.csv").write_text("cpu_s,peak_mb\n1,100\n")
    found = many.measured(tmp_path, 1)
    assert next(found)["cpu_s"] == 1
    with pytest.raises(SystemExit, match="two processes leaves other bytes than one process"):
        next(found)


# --- what imports say of real files is what is stored ----------------------------------------


QUICK = ("sbet", "orientations")


def same(names):
    known = pd.read_csv(ROOT / BENCHMARKS / "imports.csv")
    expected = known[known["kind"].isin(names)]["line"].tolist()
    assert [row["line"] for row in imports.said(names)] == expected


@needs("ign-uce-m3")
@needs("applanix_pdal")
def test_quick_imports_say_what_is_stored():
    same(QUICK)


@pytest.mark.repeats
@needs("formats")
def test_all_imports_say_what_is_stored():
    same([name for name in imports.RUNS if name not in QUICK])


def test_a_command_that_fails_is_told():
    with pytest.raises(RuntimeError, match="nowhere:1: file: is not there"):
        imports.printed("acx4 import orientations nowhere --out f")


# --- what there is to measure is counted as the command counts it ----------------------------


def test_pairs_and_levels_of_a_block(exact_block):
    n = len(exact_block.images.names)
    small, large = (measuring.counted(exact_block, k) for k in (16, 1))
    assert small["pictures"] == large["pictures"] == n
    assert 0 < small["pairs"] == large["pairs"] <= n * (n - 1) / 2
    assert 0 < small["levels"] < large["levels"]
    assert large["megapixels"] > 200 * small["megapixels"]


def test_the_library_alone_measures_nothing():
    alone = measuring.work(0, 0, 1, 0.0)
    assert not any(alone[name] for name in ("pictures", "pairs", "levels", "megapixels"))
