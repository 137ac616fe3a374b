"""Execution of one parametrised notebook by papermill, such that two runs give equal bytes."""

from __future__ import annotations

import hashlib
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, ClassVar

import nbformat
import papermill
from ipykernel.kernelspec import RESOURCES, get_kernel_dict
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from jupyter_core.utils import ensure_event_loop
from nbclient.exceptions import DeadKernelError
from papermill.exceptions import PapermillExecutionError
from traitlets import Unicode
from traitlets.config import Config

from acx4files.results.whole_files import write
from acx4lib.errors import Acx4Error, AdjustmentError, FlightError, OutputError, unsolvable


class NotebookError(Acx4Error):
    """A notebook failed; the message has its name, the number of the code cell, and the reason."""


class Kernel(AsyncKernelManager):
    """The usual kernel of this Python, whose files are all in one folder.

    Modules and settings in the working folder are not for it, and what it writes on the terminal is
    not shown.
    """

    home = Unicode(config=True)
    """Folder for its files."""

    running: ClassVar[set[Kernel]] = set()
    """Those that have been started and have not ended."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.transport = "ipc"
        self.connection_file = str(Path(self.home, "kernel.json"))

    @property
    def kernel_spec(self) -> KernelSpec:
        """How it is started: not as kernels are in the user's settings."""
        return KernelSpec(resource_dir=RESOURCES, **get_kernel_dict())

    async def start_kernel(  # type: ignore[override] # the base is asynchronous, too
        self, *, extra_arguments: Iterable[str], **options: Any
    ) -> None:
        """Start it."""
        arguments = [*extra_arguments, "--InteractiveShellApp.ignore_cwd=True"]
        env = {
            **os.environ,
            "IPYTHONDIR": self.home,
            "MPLBACKEND": "module://matplotlib_inline.backend_inline",
            "PYTHONHASHSEED": "0",  # of the order of sets
            "PYTHONSAFEPATH": "1",
        }
        nowhere = subprocess.DEVNULL
        streams = {"stdout": nowhere, "stderr": nowhere}
        self.running.add(self)
        await super().start_kernel(extra_arguments=arguments, env=env, **streams, **options)

    async def cleanup_resources(  # type: ignore[override] # likewise
        self, restart: bool = False
    ) -> None:
        """Remove what it leaves behind."""
        self.running.discard(self)
        await super().cleanup_resources(restart)


def end_all() -> None:
    """End the notebooks that run, as where the command is interrupted."""
    for kernel in [*Kernel.running]:
        if pid := getattr(kernel.provisioner, "pid", None):
            with suppress(ProcessLookupError):  # it has just ended by itself
                os.kill(pid, signal.SIGTERM if sys.platform == "win32" else signal.SIGKILL)


def execute(
    notebook: Path,
    executed: Path,
    *,
    parameters: Mapping[str, Any],
    on_cell: Callable[[int, int], None] = lambda *_: None,
    hidden: str = "",
) -> None:
    """Execute a notebook in the current folder, with the present Python interpreter.

    Parameters
    ----------
    notebook, executed : Path
        The notebook, and the executed notebook to write; if a cell fails, it ends there.
    parameters : mapping
        Values of parameters; those that the notebook does not have are ignored.
    on_cell : callable
        Called with the number of finished cells, and of all cells.
    hidden : str
        Name of a folder to remove from all paths in the executed one; no folder if empty.

    Raises
    ------
    FlightError, AdjustmentError, OutputError
        If the notebook raised them; AdjustmentError for a failure of linear algebra, too.
    NotebookError
        For any other error.
    """
    executed.parent.mkdir(exist_ok=True)
    n_code, total = 0, len(_read(notebook).cells) + 1  # one more cell, with the parameters

    def start(*, cell: Any, cell_index: int) -> None:
        nonlocal n_code
        n_code += cell.cell_type == "code"
        on_cell(cell_index, total)

    known = papermill.inspect_notebook(_literal(notebook))
    given = {name: value for name, value in parameters.items() if name in known}
    with tempfile.TemporaryDirectory(prefix="acx4-") as home:
        try:
            papermill.execute_notebook(
                _literal(notebook),
                _literal(executed.absolute()),
                parameters=given,
                kernel_name="python3",
                language="python",
                progress_bar=False,
                kernel_manager_class=Kernel,
                config=Config({"Kernel": {"home": home}}),
                shutdown_kernel="immediate",
                coalesce_streams=True,
                on_cell_start=start,
            )
        except PapermillExecutionError as error:
            number = n_code - bool(given)  # as it is in the notebook itself
            raise _translated(notebook.stem, number, error.ename, error.evalue) from None
        except DeadKernelError:
            number = n_code - bool(given)
            raise _failed(notebook.stem, number, "its process was ended") from None
        finally:
            loop = ensure_event_loop()  # of this thread, which papermill leaves open
            if not loop.is_running():
                loop.close()
            if executed.is_file():
                _scrub(executed, hidden)
    on_cell(total, total)


def _scrub(executed: Path, hidden: str) -> None:
    """Remove from an executed notebook what differs from run to run."""
    notebook = _read(executed)
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python", "pygments_lexer": "ipython3"},
    }
    for number, cell in enumerate(notebook.cells, 1):
        cell["id"] = f"cell-{number:02d}"
        for key in ("papermill", "execution"):
            cell.metadata.pop(key, None)
    text: str = nbformat.writes(nbformat.from_dict(notebook))  # type: ignore[no-untyped-call] # untyped
    # from the beginning of a word on: pictures are words of a million letters
    text = re.sub(r"(?<![^\s\"])[^\s\"]*ipykernel_\d+/\d+\.py", "<cell>", text)
    if hidden:
        text = text.replace(f"/{hidden}", "").replace(hidden, ".")
    write(executed, text)


def _read(notebook: Path) -> nbformat.NotebookNode:
    read: nbformat.NotebookNode = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call] # untyped
    return read


def _literal(path: Path) -> str:
    """Return a path with its braces escaped, because papermill formats it."""
    return str(path).replace("{", "{{").replace("}", "}}")


def _failed(notebook: str, cell: int, reason: str) -> NotebookError:
    return NotebookError(f"notebook {notebook}, cell {cell}: {reason}")


def _translated(notebook: str, cell: int, name: str, message: str) -> Acx4Error:
    """Return the error of a notebook as an error of this library."""
    if name == FlightError.__name__:
        return FlightError(message.splitlines())
    for kind in (AdjustmentError, OutputError):
        if name == kind.__name__:
            return kind(message)
    if name == "LinAlgError":
        return unsolvable(message, f"the equations of notebook {notebook}, cell {cell},")
    last = re.sub(r"\(\d+\.py, (line \d+)\)", r"(\1)", message).strip().splitlines()[-1:]
    return _failed(notebook, cell, ": ".join(part for part in (name, *last) if part))


def digest(notebook: Path, sources: Path, data: Iterable[Path]) -> str:
    """Return the SHA-256 of a notebook, of all sources and of its data: files, not their places."""
    total = hashlib.sha256()
    for path in (notebook, *sorted(sources.rglob("*.py")), *sorted(data)):
        total.update(f"{path.name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()
