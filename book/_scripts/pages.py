"""Bring a run's pages into the book: ``python pages.py FLIGHT RESULTS BOOK``.

The executed notebooks of the stages are copied; a stage that the flight does not have gets a page
that says so. The notebooks that hang on no stage are run here. The scorecard is written.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from acx4lib import flight, notebooks, results, runner, scorecard_page

ALWAYS = ("05-reference-data", "06-errata")
TITLES = {
    "heads": "Calibration of the heads",
    "synthetic": "The synthetic image",
    "mounting": "Interior orientation, boresight and lever arm",
    "validation": "Validation on an independent block",
}


def main(flight_path: Path, results_path: Path, book: Path) -> None:
    """Fill ``_executed`` and write ``_generated/scorecard.md``."""
    executed, generated = book / "_executed", book / "_generated"
    for stage, name in runner.NOTEBOOKS.items():
        source = results_path / "notebooks" / f"{name}.ipynb"
        if source.is_file():
            shutil.copyfile(source, executed / source.name)
        else:
            text = f"# {TITLES[stage]}\n\nThis flight has no data for this stage.\n"
            (executed / f"{name}.md").write_text(text, encoding="utf-8")
    for name in ALWAYS:
        source = runner.NOTEBOOKS_PATH / f"{name}.ipynb"
        values = notebooks.with_defaults(source, {"results_path": str(results_path)})
        notebooks.execute(source, executed / source.name, parameters=values, on_cell=_silent)
        notebooks.scrub(executed / source.name)
    found = results.read(results_path)
    text = scorecard_page.page(found, flight.read(flight_path))
    (generated / "scorecard.md").write_text(text, encoding="utf-8")


def _silent(_done: int, _total: int) -> None:
    """Show no progress."""


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))
