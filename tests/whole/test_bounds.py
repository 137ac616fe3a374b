"""Files of strangers take time in proportion to their size, and less memory than a gigabyte.

Every file here once took seconds or minutes, or gigabytes.
"""

import time

import pytest

from acx4lib.exchange.programs.micmac import files
from support import swelling
from support.limits import told

SECONDS = 20
"""Of processor time: each takes one or two here, and took minutes when it grew with the square."""

LESS = 9.0
"""Quotient of the times of a file and one four times as large: about 4, or 16 with the square."""


def imported(folder, kind, write, n):
    folder.mkdir()
    source, options = write(folder, n)
    return told("import", kind, source, "--out", folder.with_name(f"{folder.name}-out"), *options)


@pytest.mark.parametrize(
    ("kind", "write", "n"),
    [
        ("orientations", swelling.spaces_in_orientations, 600),
        ("orientations", swelling.spaces_in_orientations, 2_000),
        ("orientations", swelling.spaces_in_orientations, 100_000),
        ("orientations", swelling.spaces_between_commas, 100_000),
        ("pospac-text", swelling.spaces_in_pospac, 100_000),
        ("opensfm", swelling.spaces_in_tracks, 100_000),
        ("opensfm", swelling.brackets, 40_000),
        ("orientations", swelling.columns, 40_000),
        ("pospac-text", swelling.columns_of_pospac, 40_000),
        ("opf", swelling.named_again, 3_000),
        ("metashape", swelling.chunks, 300),
        ("opf", swelling.meshes, 30_000),
    ],
)
def test_what_wants_much_is_refused_or_read_quickly(tmp_path, kind, write, n):
    found = imported(tmp_path / "source", kind, write, n)
    assert found.status in (0, 2), found
    assert "mistake" not in found.err
    assert found.err.count("\n") <= 1
    assert found.seconds < SECONDS


@pytest.mark.parametrize(
    ("kind", "write", "n"),
    [
        ("odm-control", swelling.control, 5_000),
        ("micmac", swelling.surveyed, 5_000),
        ("opensfm", swelling.shots, 5_000),
        ("orientations", swelling.columns, 10_000),
    ],
)
def test_four_times_as_much_takes_four_times_as_long(tmp_path, kind, write, n):
    few, many = (imported(tmp_path / f"{m}", kind, write, m) for m in (n, 4 * n))
    assert {few.status, many.status} <= {0, 2}, (few.err, many.err)
    assert few.status == many.status
    assert many.seconds < LESS * few.seconds
    assert many.seconds < SECONDS


def test_interior_orientations_of_each_image_are_told_apart_in_linear_time(tmp_path):
    seconds = []
    for n in (250, 1_000):
        folder, _ = swelling.interiors(tmp_path / f"{n}", n)
        start = time.process_time()
        found = files.files_of(folder)
        seconds.append(time.process_time() - start)
        assert len(found.interior) == n
    assert seconds[1] < LESS * seconds[0]
