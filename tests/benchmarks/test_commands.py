"""Whole commands are timed as a user calls them, and imports say what is stored."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.pages.build import BENCHMARKS
from acx4files.flight import reader
from acx4lib.geometry.camera import inside
from benchmarks import commands, harness, imports
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
    assert rows["command"].tolist() == ["check"] * 2
    assert rows["run"].tolist() == [1, 2]
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
