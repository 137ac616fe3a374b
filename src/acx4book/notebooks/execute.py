"""Execution of one parametrised notebook, such that two runs give equal bytes."""

from __future__ import annotations

import ast
import os
import re
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from subprocess import DEVNULL
from typing import Any

import nbformat
import papermill
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from nbclient.exceptions import CellControlSignal
from papermill.exceptions import PapermillExecutionError

from acx4lib.compiling import is_writable, user_folder
from acx4lib.errors import Acx4Error, AdjustmentError, FlightError

LONGEST = 80
"""Largest number of bytes of a folder's path; the system allows 107 with the socket's name."""


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
    FlightError, AdjustmentError
        If the notebook raised them.
    NotebookError
        For any other error.
    """
    executed.parent.mkdir(exist_ok=True)
    total = len(_read(notebook).cells) + 1
    # a kernel that is ending may still write there
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as home:
        try:
            papermill.execute_notebook(
                _literal(notebook),
                _literal(executed),
                parameters=dict(parameters),
                kernel_name="python3",
                language="python",
                progress_bar=False,
                start_timeout=300,
                kernel_manager_class=_kernel_manager(home),
                on_cell_start=lambda cell_index, **_: on_cell(cell_index, total),
            )
        except PapermillExecutionError as error:
            raise _translated(notebook.stem, _cell(executed), error.ename, error.evalue) from None
        except (CellControlSignal, RuntimeError) as error:  # the kernel died, or does not answer
            raise _translated(notebook.stem, _cell(executed), "", str(error)) from None
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
    # a limit, as a picture is one word of a million letters: each would be tried as a start
    text = re.sub(r"[^\s\"]{0,200}ipykernel_\d+/\d+\.py", "cell.py", text)
    executed.write_text(text, encoding="utf-8")


def _kernel_manager(home: str) -> type[AsyncKernelManager]:
    """Return a manager that starts a kernel of this interpreter, whatever kernels are installed.

    The kernel has one thread, no start-up files of the user, no modules from the current folder.
    """
    threads = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA")
    spec = KernelSpec(
        argv=[sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"],
        display_name="Python 3",
        language="python",
        env={
            **{f"{name}_NUM_THREADS": "1" for name in threads},
            **_folders(home),
            "MPLBACKEND": "module://matplotlib_inline.backend_inline",
            "PYTHONHASHSEED": "0",
            "PYTHONSAFEPATH": "1",
        },
    )

    # sockets of the file system need no network at all, but short paths
    near = len(os.fsencode(home)) <= LONGEST
    transport = {"transport": "ipc", "ip": f"{home}/kernel"} if near else {}

    class ThisInterpreter(AsyncKernelManager):
        """The kernel manager."""

        def __init__(self, **kwargs: Any) -> None:
            super().__init__(**kwargs, **transport, connection_file=f"{home}/kernel.json")

        @property
        def kernel_spec(self) -> KernelSpec:
            """Return the specification above."""
            return spec

        async def start_kernel(  # type: ignore[override] # the base is declared synchronous
            self, **kwargs: Any
        ) -> None:
            """Start it; output of cells comes in messages, its own warnings are dropped."""
            await super().start_kernel(**kwargs, stdout=DEVNULL, stderr=DEVNULL)

    return ThisInterpreter


def _folders(home: str) -> dict[str, str]:
    """Return the folders of a kernel; one for matplotlib only if the user's is not writable."""
    names = ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR")
    own = dict.fromkeys(names, home)
    if "MPLCONFIGDIR" in os.environ:
        fonts = [Path(os.environ["MPLCONFIGDIR"])]
    else:
        users = (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache"))
        fonts = [Path(user_folder(*user) or "/dev/null", "matplotlib") for user in users]
    return own if all(map(is_writable, fonts)) else {**own, "MPLCONFIGDIR": home}


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
    if name == AdjustmentError.__name__:
        return AdjustmentError(message)
    last = re.sub(r"\(\d+\.py, (line \d+)\)", r"(\1)", message).strip().splitlines()[-1:]
    return NotebookError(notebook, cell, ": ".join(part for part in (name, *last) if part))


def _cell(executed: Path) -> int:
    """Return the number of the last code cell that was started, without that of the defaults."""
    started = [
        cell
        for cell in _read(executed).cells
        if cell.cell_type == "code" and cell.metadata.get("papermill", {}).get("start_time")
    ]
    return max(1, len(started) - 1)


def _renumber(notebook: nbformat.NotebookNode) -> None:
    """Count the executed cells from 1."""
    counted = [cell for cell in notebook.cells if cell.get("execution_count")]
    for number, cell in enumerate(counted, 1):
        for counts in (cell, *(o for o in cell.outputs if o.output_type == "execute_result")):
            counts["execution_count"] = number
