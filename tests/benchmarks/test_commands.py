"""Whole commands are timed as a user calls them: large flights, many, imports, measuring."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.pages.build import BENCHMARKS
from acx4files.flight import reader
from acx4lib.calibration import mounting
from acx4lib.geometry.camera import inside
from benchmarks import commands, harness, imports, many, measuring
from benchmarks.adjusting import bench_blocks
from support.helpers import ROOT, needs

FLIGHT, MADE = Path("flight"), Path("made")


@pytest.mark.slow
@pytest.mark.repeats
@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("check", "check flight"),
        ("run", "run --results made/results flight"),
        ("run --numbers-only", "run --numbers-only --results made/numbers flight"),
        ("report", "report made/results"),
        (
            "render --exposures H3-04",
            "render --exposures H3-04 flight --results made/results --out made/images",
        ),
    ],
)
def test_a_command_is_spelt_out(text, arguments):
    assert commands.call(text, FLIGHT, MADE) == [harness.ACX4, *arguments.split()]


@pytest.mark.slow
@pytest.mark.repeats
def test_a_row_for_every_run(tmp_path):
    kind = commands.Kind(name="one head", make=commands.KINDS[0].make, commands=("check",))
    rows = pd.DataFrame(commands.measured(kind, tmp_path, 2))
    assert rows["command"].tolist() == ["imports", "check"] * 2
    assert rows["run"].tolist() == [1, 1, 2, 2]
    assert set(rows["images"]) == {97}
    assert (rows[["wall_s", "cpu_s", "tree_mb"]] > 0).all(axis=None)
    assert {p.name for p in tmp_path.iterdir()} == {"one-head", "one-head.truth.json"}


# --- the folder of a large flight is the block from which it was made --------------------------


@pytest.fixture(scope="module")
def made():
    strips = bench_blocks.parallel([40], base_m=commands.BASE_M)
    return bench_blocks.fly(strips, 40 * commands.TIES_PER_IMAGE, control=(6, 6), seed=1).block


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flight")
    commands.write_large(folder, 40)
    return reader.read(folder).calibration


@pytest.mark.slow
@pytest.mark.repeats
def test_poses_and_control_come_back(made, read):
    to_made = made.frame.from_grid(read.frame.to_grid(read.trajectory.T_m_b.r))
    assert_allclose(to_made, made.trajectory.T_m_b.r, atol=1e-5)
    axes = made.frame.grid_axes(to_made) @ made.trajectory.T_m_b.R  # in grid axes
    own = read.frame.grid_axes(read.trajectory.T_m_b.r) @ read.trajectory.T_m_b.R
    assert_allclose(own, axes, atol=1e-9)
    assert len(read.control) == len(made.control) == 36


@pytest.mark.slow
@pytest.mark.repeats
def test_all_measurements_on_the_sensor_come_back(made, read):
    on_sensor = inside(made.cameras[0], made.image_points.colrow)
    expected, found = by_name(made), by_name(read)
    assert 0.999 < on_sensor.mean() < 1
    assert sorted(found) == sorted(n for n, on in zip(expected, on_sensor, strict=True) if on)
    apart = [np.subtract(found[name], expected[name]) for name in found]
    assert_allclose(apart, 0, atol=1e-6)


def by_name(block):
    points = block.image_points
    images = (block.images.names[i] for i in points.image_idx)
    names = zip(images, (block.points[i] for i in points.point_idx), strict=True)
    return dict(zip(names, points.colrow, strict=True))


@pytest.mark.slow
@pytest.mark.repeats
def test_a_flight_less_in_order_is_calibrated_in_as_few_steps(tmp_path):
    commands.write_turned(tmp_path / "flight", 80)
    flight = reader.read(tmp_path / "flight")
    found = mounting.calibrate(flight.calibration, free=flight.estimate_mounting)
    for method in found.methods.values():
        assert method.bundle.solution.iterations <= 3
        assert abs(method.bundle.solution.sigma0_sq - 1) < 0.05


# --- what is timed for the page on speed: many flights, imports, measuring ---------------------


# --- many flights are timed in every way, and their bytes compared ---------------------------


@pytest.mark.slow
@pytest.mark.repeats
def test_a_row_for_every_way(tmp_path):
    rows = list(many.measured(tmp_path, 1))
    assert [row["way"] for row in rows] == ["one process", "two processes"]
    assert all(row["flights"] == 1 and row["worker_mb"] > 50 for row in rows)
    assert all(row["wall_s"] > 0 and row["cpu_s"] > 0 for row in rows)
    assert set(many.left(tmp_path / "two processes")) == {
        "flights.csv",
        "single-head-1/.acx4.json",
    }


def test_other_bytes_end_it(tmp_path, monkeypatch):
    bytes_left = iter([{"a": b"1"}, {"a": b"1"}, {"a": b"2"}, {"a": b"1"}])
    monkeypatch.setattr(many, "left", lambda _: next(bytes_left))
    took = {"wall_s": 1.0, "cpu_s": 1.0, "peak_mb": 100.0}
    monkeypatch.setattr(many.harness, "timed", lambda *_: took)
    monkeypatch.setattr(many.harness, "called", lambda *_: "")
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
