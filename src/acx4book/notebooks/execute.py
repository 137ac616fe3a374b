"""Execution of one parametrised notebook, such that two runs give equal bytes."""

from __future__ import annotations

import ast
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import nbformat
import papermill

from acx4book.notebooks import interpreter
from acx4lib.errors import Acx4Error, AdjustmentError, FlightError, OutputError, unsolvable
from acx4lib.results.own_folder.whole_files import write


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
