"""Write the measured speed for its page: ``python speed.py BENCHMARKS FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

from acx4book.pages import rendering, rendering_goals, speed
from acx4book.pages.figure_speed import seconds_by_points


def main(benchmarks: Path, folder: Path) -> None:
    """Write speed.md, speed-growth.md and speed.svg, and what the page on rendering includes."""
    benchmark = speed.read(benchmarks)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "speed.md").write_text(speed.page(benchmark), encoding="utf-8")
    (folder / "speed-growth.md").write_text(speed.growth(benchmark), encoding="utf-8")
    figure = seconds_by_points(benchmark.sweep)
    with mpl.rc_context({"svg.hashsalt": "acx4lib"}):
        figure.savefig(folder / "speed.svg", metadata={"Date": None})
    rendered = rendering_goals.read(benchmarks)
    (folder / "rendering.md").write_text(rendering.page(rendered), encoding="utf-8")
    limits = rendering.limits(rendered)
    (folder / "rendering-limits.md").write_text(limits, encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
