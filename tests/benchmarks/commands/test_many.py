"""Many flights are timed in every way, and their bytes compared."""

import pytest

from benchmarks.commands import many


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
