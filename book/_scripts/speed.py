"""Write the measured speed for its page: ``python speed.py BENCHMARKS FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

from acx4lib import plot, rendering_goals, rendering_page, speed_page


def main(benchmarks: Path, folder: Path) -> None:
    """Write speed.md, speed-growth.md and speed.svg, and what the page on rendering includes."""
    benchmark = speed_page.read(benchmarks)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "speed.md").write_text(speed_page.page(benchmark), encoding="utf-8")
    (folder / "speed-growth.md").write_text(speed_page.growth(benchmark), encoding="utf-8")
    figure = plot.seconds_by_points(benchmark.sweep)
    with mpl.rc_context({"svg.hashsalt": "acx4lib"}):
        figure.savefig(folder / "speed.svg", metadata={"Date": None})
    rendered = rendering_goals.read(benchmarks)
    (folder / "rendering.md").write_text(rendering_page.page(rendered), encoding="utf-8")
    limits = rendering_page.limits(rendered)
    (folder / "rendering-limits.md").write_text(limits, encoding="utf-8")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
