"""Write errors of simulated flights for their page: ``python coverage.py BENCHMARKS FOLDER``."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

from acx4book.pages import sigma
from acx4book.pages.figure_sigma import normalised_errors


def main(benchmarks: Path, folder: Path) -> None:
    """Write coverage.md, coverage-shares.md and coverage.svg."""
    errors = sigma.read(benchmarks)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "coverage.md").write_text(sigma.page(errors), encoding="utf-8")
    (folder / "coverage-shares.md").write_text(sigma.shares(errors), encoding="utf-8")
    own = [t[t["method"] == sigma.MAIN] for t in (errors.parameters, errors.points)]
    with mpl.rc_context({"svg.hashsalt": "acx4lib"}):
        normalised_errors(*own).savefig(folder / "coverage.svg", metadata={"Date": None})


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:3]))
