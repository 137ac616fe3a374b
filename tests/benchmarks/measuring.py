"""Runs of ``acx4 measure`` with eight pictures at three sizes.

Beside them stands, without a time, how much fifty pictures of full size are: the page computes it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acx4book.chapters.from_pictures import EXPOSURES
from acx4files.flight.reader import read
from acx4files.measuring import views as measuring_views
from acx4files.measuring.levels import overlapping, sizes_of
from acx4files.measuring.views import declared_views, seen_at
from acx4lib.block import Block, select_images
from acx4lib.design import flying_heights
from benchmarks import harness

REDUCED = (8, 4, 2)
MANY = 50
"""Of the validation block, which has the overlaps of a mapping flight."""

LIBRARY = "import acx4files.measuring.measure"
"""What each run loads, timed alone."""


def rows(folder: Path, _repeat: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the library alone, every size, and what is only counted; nothing belongs to all."""
    return [*measured(folder)], {}


def measured(folder: Path, reduced: Sequence[int] = REDUCED) -> Iterator[dict[str, Any]]:
    """Yield the library alone, every size, and what is only counted.

    Parameters
    ----------
    folder : Path
        Where flights are made.
    reduced : sequence of int
        Sizes of the pictures: at 1/K.
    """
    yield work(0, 0, 1, 0.0) | harness.timed(sys.executable, "-c", LIBRARY)
    for k in reduced:
        flight = folder / f"at-{k}"
        options = ["--images", ",".join(EXPOSURES), "--reduce", str(k)]
        harness.called([harness.ACX4, "simulate", "single-head", *options, "--out", str(flight)])
        whole = read(flight)
        block = whole.block("calibration")
        here = np.isin(block.images.names, EXPOSURES)
        points = flight / "calibration" / "image_points.csv"
        points.write_text(points.read_text(encoding="utf-8").splitlines()[0], encoding="utf-8")
        call = [harness.ACX4, "measure", str(flight), "--out"]
        if k == reduced[0]:
            harness.called([*call, str(folder / "compiled")])
        yield counted(select_images(block, here), k) | harness.timed(*call, str(folder / f"of-{k}"))
    many = whole.block("validation")
    yield counted(select_images(many, np.arange(len(many.images.names)) < MANY), 1)


def counted(block: Block, reduced: int) -> dict[str, Any]:
    """Return how much there is to match in a block's pictures at 1/K of their size."""
    paths = [Path(name) for name in block.images.names]
    views = [seen_at(view, reduced) for view in declared_views(block, paths)]
    below = float(np.mean(block.trajectory.T_m_b.r[:, 2] - flying_heights(block)))
    pairs = overlapping(views, measuring_views.level(below))
    camera = views[0].camera
    pixels = camera.width_px * camera.height_px / 1e6
    return work(len(views), len(pairs), reduced, pixels, len(sizes_of(views, 1)))


def work(
    pictures: int, pairs: int, reduced: int, megapixels: float, levels: int = 0
) -> dict[str, Any]:
    """Return the columns that say what is measured."""
    return {
        "pictures": pictures,
        "reduced": reduced,
        "megapixels": megapixels,
        "levels": levels,
        "pairs": pairs,
    }
