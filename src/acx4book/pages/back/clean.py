"""The notebooks as readers download them: without outputs, and such that they run where they land.

In the project a notebook reads the flight that make simulated. A copy by itself has other defaults,
and a cell that simulates the flight and runs the stages before, where they are missing.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import nbformat

from acx4book.notebooks import alone
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4lib.results.own_folder import whole_files

FOLDER = Path("downloads", "notebooks")
"""Where the copies lie in the built book."""

NEEDS = (
    "> This notebook comes from the book. It needs the package `acx4lib` with its extra `book`: "
    "`pip install '.[book]'` in a copy of the project, or the wheel of a release. References such "
    "as {numref} are written in MyST Markdown, which the book shows as links."
)
"""What a reader is told at the top."""


@dataclass(frozen=True, kw_only=True)
class Before:
    """What has to be there before a notebook can run.

    Attributes
    ----------
    design : str
        The flight, of `acx4sim.DESIGNS`.
    stages : tuple of str
        Whose results it reads.
    """

    design: str = "acx4"
    stages: tuple[str, ...] = ()


ALL = ("heads", "synthetic", "mounting", "validation")
BEFORE: Mapping[str, Before] = {
    "00-flight": Before(),
    "01-head-calibration": Before(),
    "02-synthetic-image": Before(stages=ALL[:1]),
    "03-mounting-calibration": Before(design="acx4-ideal"),
    "04-validation": Before(design="acx4-ideal", stages=("mounting",)),
    "06-errata": Before(stages=ALL),
    "08-rig": Before(stages=ALL[:1]),
    "study": Before(design="acx4-ideal"),
}
"""The notebooks that need a flight, the one that their pages show; the others need none."""


PAGES = ("*.ipynb", "foundations/*.ipynb", "template/study.ipynb")
"""The notebooks that are pages of the book, below their folder."""


def sources() -> list[Path]:
    """Return the notebooks that are pages of the book."""
    found = (NOTEBOOKS_PATH.glob(pattern) for pattern in PAGES)
    return sorted(path for paths in found for path in paths)


def write(folder: Path) -> None:
    """Write a copy of every notebook below a folder, where it lies below that of the notebooks."""
    for source in sources():
        name = source.relative_to(NOTEBOOKS_PATH)
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text: str = nbformat.writes(copy(source, name.stem))  # type: ignore[no-untyped-call] # untyped
        whole_files.write(path, f"{text}\n")


def copy(source: Path, name: str) -> nbformat.NotebookNode:
    """Return a notebook that runs by itself."""
    notebook: nbformat.NotebookNode = nbformat.read(source, as_version=4)  # type: ignore[no-untyped-call] # untyped
    notebook.cells[0].source += f"\n\n{NEEDS}"
    if name in BEFORE:
        flight, results = _places(name)
        at = next(
            i for i, c in enumerate(notebook.cells) if "parameters" in c.metadata.get("tags", [])
        )
        parameters = notebook.cells[at]
        parameters.source = with_default(parameters.source, "flight_path", flight)
        parameters.source = with_default(parameters.source, "results_path", results)
        cell = nbformat.v4.new_code_cell(_start(name, parameters.source), id="start")  # type: ignore[no-untyped-call] # untyped
        notebook.cells.insert(at + 1, cell)
    return notebook


def with_default(source: str, name: str, value: str) -> str:
    """Return a cell of parameters in which a text has another default, where it is there."""
    return re.sub(rf'^({name}: str = )"[^"]*"', rf'\1"{value}"', source, flags=re.MULTILINE)


def _places(name: str) -> tuple[str, str]:
    """Return the folders of the flight and of the results of a notebook."""
    return alone.flight_of(BEFORE[name].design), f"results-{name}"


def _start(name: str, parameters: str) -> str:
    """Return the code that makes what is missing, for the flight that the parameters name.

    A notebook that has no flight among its parameters makes its own results alone.
    """
    before, (flight, results) = BEFORE[name], _places(name)
    path = "flight_path" if "flight_path:" in parameters else f'"{flight}"'
    stages = repr(before.stages)
    if "calibration_path:" in parameters:
        stages = f"() if calibration_path else {stages}"
    call = f'alone.prepare(\n    {path}, results_path, design="{before.design}", stages={stages}\n)'
    if path != "flight_path":
        call = call.replace("\n", "\n    ")
        call = f'if results_path == "{results}":  # others are there, or a mistake\n    {call}'
    return (
        "from acx4book.notebooks import alone\n\n"
        "# simulates the flight and runs the stages before this one, where they are not there\n"
        f"{call}"
    )
