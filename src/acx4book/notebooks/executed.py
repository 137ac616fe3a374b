"""The way of the notebooks: every stage by its notebook, executed with parameters.

A notebook reads only the copy of the flight's tables in the results, and the pictures. Executed
notebooks have no date and no place, so two runs of one flight give equal bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from acx4book.notebooks import execute
from acx4book.notebooks.runner import NOTEBOOKS_PATH, Step
from acx4lib.errors import Acx4Error, OutputError
from acx4lib.flight.reader import Flight
from acx4lib.results import provenance
from acx4lib.results.files.schemas import NOTEBOOKS
from acx4lib.results.runs import EXECUTED, FAILED

GIVEN = {"flight_path", "pictures_path", "results_path", "calibration_path"}
"""Parameters of the notebooks that a run sets itself."""


@dataclass(frozen=True, kw_only=True)
class Notebooks:
    """Stages run by their notebooks; the notebook of the flight, which only shows it, comes first.

    Attributes
    ----------
    path : Path
        Their folder.
    parameters : mapping of str to object
        Values of further parameters, such as ``seed``; each notebook gets those that it has.
    """

    path: Path = field(default_factory=lambda: NOTEBOOKS_PATH)  # no place in its signature
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def steps(
        self, flight: Flight, folder: Path, stages: Sequence[str], calibration: str
    ) -> dict[str, Step]:
        """Return what runs each stage, as `runner.Way` has it.

        Raises
        ------
        ValueError
            A parameter that no notebook has, or that is of another type.
        FileNotFoundError
            A notebook is not there.
        """
        given = {
            **self.parameters,
            "flight_path": str(folder / provenance.KEPT),
            "pictures_path": str(flight.path),
            "calibration_path": calibration,
        }
        notebooks = {stage: self._notebook(stage) for stage in ("flight", *stages)}
        values = {s: execute.with_defaults(path, given) for s, path in notebooks.items()}
        _check_known(self.parameters, values)
        if calibration and "calibration_path" not in values.get("validation", {}):
            msg = f"{notebooks['validation'].stem}: has no parameter calibration_path"
            raise ValueError(msg)
        return {s: partial(_execute, path, values[s]) for s, path in notebooks.items()}

    def _notebook(self, stage: str) -> Path:
        notebook = self.path / f"{NOTEBOOKS[stage]}.ipynb"
        if not notebook.is_file():
            msg = f"{notebook}: no such notebook"
            raise FileNotFoundError(msg)
        return notebook


def _check_known(given: Mapping[str, Any], values: Mapping[str, Mapping[str, Any]]) -> None:
    known = {name for of_one in values.values() for name in of_one} - GIVEN
    if given.keys() - known:
        unknown = ", ".join(sorted(given.keys() - known))
        msg = f"no notebook has a parameter {unknown}; known: {', '.join(sorted(known))}"
        raise ValueError(msg)


def _execute(
    notebook: Path,
    values: Mapping[str, Any],
    staging: Path,
    on_cell: Callable[[int, int], None],
) -> None:
    """Execute a notebook in a copy of the results; if it fails, it is left in another folder."""
    executed = staging / EXECUTED / notebook.name
    given = {**values, "results_path": str(staging)}
    try:
        execute.execute(notebook, executed, parameters=given, on_cell=on_cell)
    except Acx4Error:
        if executed.is_file():
            executed.parent.rename(staging / FAILED)
            with suppress(OutputError):  # no space for it: the error says so
                execute.scrub(staging / FAILED / notebook.name, hidden=staging.name)
        raise
    execute.scrub(executed, hidden=staging.name)
