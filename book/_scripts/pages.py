"""Bring a run's pages into the book: ``python pages.py FLIGHT RESULTS BOOK``.

The executed notebooks of the stages are copied, with the code of every cell that shows something
folded; a stage that the flight does not have gets a page that says so. The notebooks that hang on
no stage are run here. The scorecard is written, and what a simulated flight was given.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import nbformat

import acx4sim
from acx4book.chapters.mounting import determination
from acx4book.notebooks import execute, stages
from acx4book.pages import simulation
from acx4book.paper import scorecard_page
from acx4lib import flight
from acx4lib.errors import Acx4Error
from acx4lib.results import folder as results
from acx4lib.results import provenance
from acx4lib.results.own_folder import claims

ALWAYS = (
    "05-reference-data",
    "06-errata",
    "07-report",
    "09-weights",
    "10-synthetic-quality",
    "11-surround-rig",
)


def main(flight_path: Path, results_path: Path, book: Path) -> None:
    """Fill ``_executed``; write scorecard.md, simulation.md, geometry.md into ``_generated``."""
    claims.verify(results_path, cure="run acx4 run again")
    executed, generated = book / "_executed", book / "_generated"
    for name in stages.NOTEBOOKS.values():
        done, source = (
            folder / f"{name}.ipynb"
            for folder in (results_path / "notebooks", stages.NOTEBOOKS_PATH)
        )
        if done.is_file():
            fold(done, executed / done.name)
        else:
            text = f"{title(source)}\n\nThis flight has no data for this stage.\n"
            (executed / f"{name}.md").write_text(text, encoding="utf-8")
    for name in ALWAYS:
        source = stages.NOTEBOOKS_PATH / f"{name}.ipynb"
        values = execute.with_defaults(source, {"results_path": str(results_path)})
        execute.execute(source, executed / source.name, parameters=values, on_cell=_silent)
        execute.scrub(executed / source.name)
        fold(executed / source.name, executed / source.name)
    flown = flight.read_kept(results_path / provenance.KEPT)
    found = results.read(results_path)
    truth_path = acx4sim.truth_path(flight_path)
    truth = json.loads(truth_path.read_text("utf-8")) if truth_path.is_file() else None
    for name, text in (
        ("scorecard", scorecard_page.page(found, flown, simulated=truth is not None)),
        ("simulation", simulation.page(flown, truth)),
        ("geometry", determination.geometry_page()),
    ):
        (generated / f"{name}.md").write_text(text, encoding="utf-8")


def fold(executed: Path, page: Path) -> None:
    """Write an executed notebook as a page: the code of a cell that shows something is folded."""
    notebook = nbformat.read(executed, as_version=4)
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if cell.cell_type == "code" and cell.outputs and "hide-input" not in tags:
            cell.metadata["tags"] = [*tags, "hide-input"]
    page.write_text(nbformat.writes(notebook), encoding="utf-8")


def title(notebook: Path) -> str:
    """Return the title of a notebook, as Markdown."""
    return nbformat.read(notebook, as_version=4).cells[0].source.splitlines()[0]


def _silent(_done: int, _total: int) -> None:
    """Show no progress."""


if __name__ == "__main__":
    try:
        main(*map(Path, sys.argv[1:4]))
    except Acx4Error as error:  # results that were changed, a notebook that failed
        sys.exit(str(error))
