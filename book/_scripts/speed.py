"""Write the measured speed for its page: ``python speed.py BENCHMARKS FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

from acx4lib import plot, speed_page


def main(benchmarks: Path, folder: Path) -> None:
    """Write speed.md and speed.svg."""
    benchmark = speed_page.read(benchmarks)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "speed.md").write_text(speed_page.page(benchmark), encoding="utf-8")
    (folder / "speed-growth.md").write_text(speed_page.growth(benchmark), encoding="utf-8")
    figure = plot.seconds_by_points(benchmark.sweep)
    with mpl.rc_context({"svg.hashsalt": "acx4lib"}):
        figure.savefig(folder / "speed.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
