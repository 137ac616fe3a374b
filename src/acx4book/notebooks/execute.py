"""Execution of one parametrised notebook, such that two runs give equal bytes."""

from __future__ import annotations

import ast
import hashlib
import re
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import nbformat
import papermill

from acx4book.notebooks import interpreter
from acx4book.notebooks.runner import NOTEBOOKS_PATH, Step
from acx4lib.errors import Acx4Error, AdjustmentError, FlightError, OutputError, unsolvable
from acx4lib.flight.reader import Flight
from acx4lib.results import provenance
from acx4lib.results.provenance import EXECUTED, FAILED
from acx4lib.results.table_files import NOTEBOOKS
from acx4lib.results.whole_files import write


class NotebookError(Acx4Error):
    """A notebook failed.

    Attributes
    ----------
    notebook : str
        Its name.
    cell : int
        Number of the code cell, from 1.
    message : str
        Last line of the error.
    """

    def __init__(self, notebook: str, cell: int, message: str) -> None:
        self.notebook = notebook
        self.cell = cell
        self.message = message
        super().__init__(f"notebook {notebook}, cell {cell}: {message}")

    def __reduce__(self) -> tuple[type[NotebookError], tuple[str, int, str]]:
        """Return class and arguments, from which the calling process rebuilds the error."""
        return NotebookError, (self.notebook, self.cell, self.message)


def with_defaults(notebook: Path, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of all parameters of a notebook.

    Parameters
    ----------
    notebook : Path
    given : mapping
        They replace the defaults; names that the notebook does not have are ignored.

    Raises
    ------
    ValueError
        A value has another type than the default: ``"1e-7"`` is no number.
    NotebookError
        The notebook cannot be read, or a default is not a plain value.
    """
    try:
        declared = papermill.inspect_notebook(_literal(notebook))
        values = {name: ast.literal_eval(entry["default"]) for name, entry in declared.items()}
    except (ValueError, SyntaxError) as error:
        reason = str(error).splitlines()[0]
        raise NotebookError(notebook.stem, 1, f"no readable parameters ({reason})") from error
    for name in values.keys() & given.keys():
        default, value = values[name], given[name]
        whole_is_fine = type(default) is float and type(value) is int
        if type(value) is not type(default) and not whole_is_fine:
            msg = f"{notebook.stem}: {name} is {type(default).__name__}, got {value!r}"
            raise ValueError(msg)
        values[name] = value
    return values


def execute(
    notebook: Path,
    executed: Path,
    *,
    parameters: Mapping[str, Any],
    on_cell: Callable[[int, int], None],
) -> None:
    """Execute a notebook in the current folder, with the present Python interpreter.

    Parameters
    ----------
    notebook, executed : Path
        The notebook, and the executed notebook to write; if a cell fails, it ends there.
    parameters : mapping
        Values of the notebook's parameters.
    on_cell : callable
        Called with the number of finished cells, and of all cells.

    Raises
    ------
    FlightError, AdjustmentError, OutputError
        If the notebook raised them; AdjustmentError for a failure of linear algebra, too, and
        OutputError if there is no space for the executed one.
    NotebookError
        For any other error.
    """
    executed.parent.mkdir(exist_ok=True)
    is_code = [cell.cell_type == "code" for cell in _read(notebook).cells]
    total = len(is_code) + 1  # one more cell, with the parameters
    with tempfile.TemporaryDirectory() as home:
        try:
            interpreter.execute(
                _literal(notebook),
                _literal(executed.absolute()),
                parameters=parameters,
                home=home,
                on_cell=lambda index: on_cell(index, total),
            )
        except interpreter.Failed as failed:
            # with the cell of the parameters, and without that of the defaults
            number = max(1, sum(is_code[: failed.index]))
            raise _translated(notebook.stem, number, failed.name, failed.message) from None
    on_cell(total, total)


def scrub(executed: Path, *, hidden: str = "") -> None:
    """Remove from an executed notebook what differs from run to run, and the defaults.

    The cell of injected parameters has all parameters; its tag makes the book hide it.

    Parameters
    ----------
    executed : Path
        The notebook; it is rewritten.
    hidden : str
        Name of a folder to remove from all paths; no folder if empty.
    """
    notebook = _read(executed)
    notebook.cells = [c for c in notebook.cells if "parameters" not in c.metadata.get("tags", [])]
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python", "pygments_lexer": "ipython3"},
    }
    for number, cell in enumerate(notebook.cells, 1):
        cell["id"] = f"cell-{number:02d}"
        for key in ("papermill", "execution"):
            cell.metadata.pop(key, None)
        if "injected-parameters" in cell.metadata.get("tags", []):
            cell.metadata.tags.append("hide-input")
    _renumber(notebook)
    text: str = nbformat.writes(nbformat.from_dict(notebook))  # type: ignore[no-untyped-call] # untyped
    if hidden:
        text = text.replace(f"/{hidden}", "").replace(hidden, ".")
    write(executed, text)


def _read(notebook: Path) -> nbformat.NotebookNode:
    read: nbformat.NotebookNode = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call] # untyped
    return read


def _literal(path: Path) -> str:
    """Return a path with its braces escaped, because papermill formats it."""
    return str(path).replace("{", "{{").replace("}", "}}")


def _translated(notebook: str, cell: int, name: str, message: str) -> Acx4Error:
    """Return the error of a notebook as an error of this library."""
    if name == FlightError.__name__:
        return FlightError(message.splitlines())
    for kind in (AdjustmentError, OutputError):
        if name == kind.__name__:
            return kind(message)
    if name == "LinAlgError":
        return unsolvable(message, f"the equations of notebook {notebook}, cell {cell},")
    plain = re.sub(r"\(<ipython-input-\S+>, (line \d+)\)", r"(\1)", message)
    last = plain.strip().splitlines()[-1:]
    return NotebookError(notebook, cell, ": ".join(part for part in (name, *last) if part))


def _renumber(notebook: nbformat.NotebookNode) -> None:
    """Count the executed cells from 1."""
    counted = [cell for cell in notebook.cells if cell.get("execution_count")]
    for number, cell in enumerate(counted, 1):
        for counts in (cell, *(o for o in cell.outputs if o.output_type == "execute_result")):
            counts["execution_count"] = number


# --- A digest of all inputs of a notebook that depends on no flight


HOUSES = ("acx4lib", "acx4sim", "acx4book")
"""Packages whose modules are followed; all others have their version in environment.lock."""

SHOWS = "acx4book.typesetting.svg"
"""The module that shows figures; no notebook imports it."""


def digest(notebook: Path, sources: Path, data: Iterable[Path]) -> str:
    """Return the SHA-256 of a notebook, its data and all modules it imports, directly or not.

    Parameters
    ----------
    notebook : Path
    sources : Path
        Folder of the houses.
    data : iterable of Path
        Files; their contents and names count, and not where they lie.
    """
    total = hashlib.sha256()
    for path in (notebook, *sorted(modules(notebook, sources)), *sorted(data)):
        total.update(f"{path.name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()


def modules(notebook: Path, sources: Path) -> set[Path]:
    """Return the files of the project's modules that a notebook imports, directly or not.

    Packages above a module are included, but imports that they make on demand are not followed.
    """
    read = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call] # untyped
    cells = [cell.source for cell in read.cells if cell.cell_type == "code"]
    waiting = [SHOWS, *_imported("\n".join(cells))]
    names: set[str] = set()
    files: set[Path] = set()
    while waiting:
        name = waiting.pop()
        path = None if name in names else _file(name, sources)
        names.add(name)
        if path is None:
            continue
        files.add(path)
        above = name.split(".")[:-1]
        waiting += [".".join(above[:n]) for n in range(2, len(above) + 1)]
        if above:
            files.add(sources / above[0] / "__init__.py")
        waiting += _imported(path.read_text("utf-8"))
    return files


def _file(name: str, sources: Path) -> Path | None:
    """Return the file of a module, or None where the name is no module."""
    base = sources.joinpath(*name.split("."))
    return next((p for p in (base.with_suffix(".py"), base / "__init__.py") if p.is_file()), None)


@cache
def _imported(source: str) -> tuple[str, ...]:
    """Return possible names of the project's modules in the imports of a source."""
    candidates: list[str] = []
    waiting: list[ast.AST] = [ast.parse(source)]
    for node in waiting:
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        waiting += (n for n in ast.iter_child_nodes(node) if not isinstance(n, ast.expr))
        candidates += (name for name in names if name.partition(".")[0] in HOUSES)
    return tuple(candidates)


# --- The way of the notebooks: every stage by its notebook, executed with parameters
#
# A notebook reads only the copy of the flight's tables in the results, and the pictures. Executed
# notebooks have no date and no place, so two runs of one flight give equal bytes.


GIVEN = {"flight_path", "pictures_path", "results_path", "calibration_path"}
"""Parameters of the notebooks that a run sets itself."""


@dataclass(frozen=True, kw_only=True)
class Notebooks:
    """Stages run by their notebooks, after the notebook that shows the flight.

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
        """Return the step of each stage, as `runner.Way` requires.

        Raises
        ------
        ValueError
            A parameter that no notebook has, or that is of another type.
        FileNotFoundError
            A notebook is not there.
        """
        parameters = {
            **self.parameters,
            "flight_path": str(folder / provenance.KEPT),
            "pictures_path": str(flight.path),
            "calibration_path": calibration,
        }
        notebooks = {stage: self._notebook(stage) for stage in ("flight", *stages)}
        values = {s: with_defaults(path, parameters) for s, path in notebooks.items()}
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


def _check_known(parameters: Mapping[str, Any], values: Mapping[str, Mapping[str, Any]]) -> None:
    known = {name for of_one in values.values() for name in of_one} - GIVEN
    if parameters.keys() - known:
        unknown = ", ".join(sorted(parameters.keys() - known))
        msg = f"no notebook has a parameter {unknown}; known: {', '.join(sorted(known))}"
        raise ValueError(msg)


def _execute(
    notebook: Path,
    values: Mapping[str, Any],
    staging: Path,
    on_cell: Callable[[int, int], None],
) -> None:
    """Execute a notebook in a copy of the results; a failed one is kept in the folder `FAILED`."""
    executed = staging / EXECUTED / notebook.name
    parameters = {**values, "results_path": str(staging)}
    try:
        execute(notebook, executed, parameters=parameters, on_cell=on_cell)
    except Acx4Error:
        if executed.is_file():
            executed.parent.rename(staging / FAILED)
            with suppress(OutputError):  # no space for it: the error says so
                scrub(staging / FAILED / notebook.name, hidden=staging.name)
        raise
    scrub(executed, hidden=staging.name)
