"""The interpreter of a notebook: IPython in a process of its own, with its libraries loaded.

A Jupyter kernel starts Python and imports everything anew for each notebook, which takes longer
than most notebooks. On Linux the process here is a copy of the present one; elsewhere, where copies
of a process that has computed are not safe, it is a new one.
"""

from __future__ import annotations

import base64
import io
import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt  # loaded before the copy
import nbformat
import papermill
from IPython.core.display import DisplayObject, TextDisplayObject
from IPython.core.displayhook import DisplayHook
from IPython.core.displaypub import DisplayPublisher
from IPython.core.interactiveshell import InteractiveShell
from matplotlib.figure import Figure
from papermill.engines import Engine, NotebookExecutionManager, papermill_engines
from papermill.exceptions import PapermillExecutionError
from papermill.iorw import LocalHandler, papermill_io
from threadpoolctl import threadpool_limits
from traitlets.config import Config

import acx4lib.stages.mounting  # noqa: F401 loaded before the copy
from acx4book.typesetting import style
from acx4book.typesetting.svg import vector
from acx4lib import system
from acx4lib.results import whole_files

ENGINE = "acx4"
"""Name by which papermill knows the interpreter."""

SAVED_EVERY = 5
"""Seconds between savings of a running notebook, in case its process dies."""

OnCell = Callable[[int], None]
"""Function called with the index of each cell that starts."""


class Failed(Exception):
    """A notebook did not come to its end.

    Attributes
    ----------
    index : int
        Index of the cell that was running.
    name, message : str
        Of its error; the name is empty if the process of the notebook ended.
    """

    def __init__(self, index: int, name: str, message: str) -> None:
        self.index, self.name, self.message = index, name, message
        super().__init__(index, name, message)


def execute(
    notebook: str, executed: str, *, parameters: Mapping[str, Any], home: str, on_cell: OnCell
) -> None:
    """Execute a notebook with papermill, in a process of its own.

    Parameters
    ----------
    notebook, executed : str
        Paths as papermill reads them, the second one from the root.
    parameters : mapping
    home : str
        Folder for IPython's own files.
    on_cell : callable

    Raises
    ------
    Failed
        A cell failed, or the process ended.
    """
    method: Any = "fork" if sys.platform == "linux" else "spawn"
    context = multiprocessing.get_context(method)
    ours, its = context.Pipe(duplex=False)
    arguments = (notebook, executed, dict(parameters), home, its)
    process = context.Process(target=_run, args=arguments, daemon=True)
    with system.uninterrupted():  # until the process has its own answer to it
        process.start()
    its.close()
    index = 0
    try:
        while isinstance(message := ours.recv(), int):
            index = message
            on_cell(index)
    except EOFError:
        process.join()
        raise Failed(index, "", _ended(process.exitcode)) from None
    finally:
        process.kill()
        process.join()
        ours.close()
    if message:
        raise Failed(index, *message)


def _ended(status: int | None) -> str:
    """Describe the end of a process; a negative exit status is the number of a signal."""
    if status is not None and status < 0:
        return f"its process was ended by signal {-status} ({signal.strsignal(-status)})"
    return f"its process ended with status {status}"


def _run(
    notebook: str, executed: str, parameters: dict[str, Any], home: str, parent: Connection
) -> None:
    """Execute a notebook in this process, which does nothing else."""
    _alone(home)
    try:
        with threadpool_limits(1, user_api="blas"):
            papermill.execute_notebook(
                notebook,
                executed,
                parameters=parameters,
                engine_name=ENGINE,
                kernel_name="python3",
                language="python",
                progress_bar=False,
                autosave_cell_every=SAVED_EVERY,
                on_cell=parent.send,
            )
        error = None
    except PapermillExecutionError as failed:
        error = failed.ename, failed.evalue
    except Exception as failed:  # of IPython or papermill: the parent reports it
        error = type(failed).__name__, str(failed)
    parent.send(error)


def _alone(home: str) -> None:
    """Reset the state that a copied process inherits: signals, streams, paths and figures."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    system.hear_interruptions()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    working_folders = {"", str(Path.cwd())}
    sys.path[:] = [folder for folder in sys.path if folder not in working_folders]
    os.environ["IPYTHONDIR"] = home
    plt.close("all")  # figures that it left open would be shown under the first cell that draws
    TextDisplayObject.__init__ = _of_text  # type: ignore[method-assign,assignment] # IPython's
    warnings.resetwarnings()
    for category in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
        warnings.simplefilter("ignore", category)
    warnings.filterwarnings("default", category=DeprecationWarning, module="__main__")


def _of_text(
    shown: TextDisplayObject, data: object = None, url: object = None, **options: Any
) -> None:
    """Take text that a cell shows as text.

    IPython would show the file of this name, if there is one in the working folder, or ask for the
    address.
    """
    text = data if isinstance(data, str) else None
    DisplayObject.__init__(shown, None if text is not None else data, url, **options)
    if text is not None:
        shown.data = text


class Interpreter(Engine):
    """Papermill's engine: every cell in IPython, in this process."""

    @classmethod
    def execute_managed_notebook(
        cls,
        nb_man: NotebookExecutionManager,
        kernel_name: str,  # noqa: ARG003 of papermill's interface
        *,
        on_cell: OnCell,
        **_: Any,
    ) -> None:
        """Run all cells, to the first that fails."""
        InteractiveShell.clear_instance()
        shell = Shell.instance(
            config=Config({"HistoryManager": {"enabled": False}}),
            displayhook_class=Result,
            display_pub_class=Publisher,
        )
        for stream in ("stdout", "stderr"):
            setattr(sys, stream, Stream(shell, stream))
        shell.enable_matplotlib("inline")
        _show_as_drawings(shell)
        for index, cell in enumerate(nb_man.nb.cells):
            on_cell(index)
            if cell.cell_type == "code" and cell.source.strip():
                shell.into, cell.execution_count = cell.outputs, shell.execution_count
                shell.run_cell(cell.source, store_history=True)
                nb_man.autosave_cell()
                if any(output.output_type == "error" for output in cell.outputs):
                    break


class Whole(LocalHandler):
    """Writer for papermill: a notebook is written whole or not at all."""

    def write(self, buf: str, path: str) -> None:
        """Write a notebook."""
        whole_files.write(Path(path), buf)


papermill_engines.register(ENGINE, Interpreter)
papermill_io.register("/", Whole())


def _show_as_drawings(shell: InteractiveShell) -> None:
    """Let IPython show figures as vectors, no longer as pixels, and one of nothing as text."""
    formatters = shell.display_formatter.formatters  # type: ignore[union-attr] # always there
    formatters["image/png"].for_type(Figure, lambda _: None)
    formatters["image/svg+xml"].for_type(Figure, vector)
    formatters["image/svg+xml"].for_type(style.Nothing, lambda _: None)


class Stream(io.TextIOBase):
    """Standard output or standard error of the cells."""

    encoding = "utf-8"

    def __init__(self, shell: Shell, name: str) -> None:
        self._shell, self._name = shell, name

    def writable(self) -> bool:
        """Return that text can be written."""
        return True

    def write(self, text: str) -> int:
        """Add text to the outputs of the cell, to the last of them if that is text, too."""
        into = self._shell.into
        if into and into[-1].get("name") == self._name:
            into[-1].text += text
        elif text:
            into.append(nbformat.v4.new_output("stream", name=self._name, text=text))
        return len(text)


class Publisher(DisplayPublisher):
    """What cells display."""

    def publish(  # type: ignore[override] # the first name is the base's
        self,
        data: Mapping[str, Any],
        metadata: Mapping[str, Any] | None = None,
        *,
        transient: Mapping[str, Any] | None = None,
        update: bool = False,
        **_: Any,
    ) -> None:
        """Add something to the outputs of the cell, or replace what has its name."""
        shell, name = self.shell, (transient or {}).get("display_id")
        output = _bundle("display_data", data, metadata)
        if update:
            for shown in shell.named.get(name, ()):
                shown.update(data=output.data, metadata=output.metadata)
        else:
            shell.into.append(output)
            shell.named.setdefault(name, []).append(output)

    def clear_output(self, wait: bool = False) -> None:  # noqa: ARG002 of the base's interface
        """Remove the outputs of the cell."""
        self.shell.into.clear()


class Result(DisplayHook):
    """The value of the last expression of a cell."""

    shell: Shell

    def write_output_prompt(self) -> None:
        """Write no prompt."""

    def write_format_data(
        self, format_dict: Mapping[str, Any], md_dict: Mapping[str, Any] | None = None
    ) -> None:
        """Add the value to the outputs of the cell."""
        output = _bundle("execute_result", format_dict, md_dict)
        output.execution_count = self.prompt_count
        self.shell.into.append(output)


class Shell(InteractiveShell):
    """IPython whose outputs are those of a notebook's cell.

    Attributes
    ----------
    into : list
        The outputs of the cell that is running.
    named : dict
        Outputs by the name that later ones may use to replace them.
    """

    def __init__(self, **options: Any) -> None:
        self.into: list[Any] = []
        self.named: dict[Any, list[Any]] = {}
        super().__init__(**options)

    def _showtraceback(self, etype: type, evalue: BaseException, stb: list[str]) -> None:
        self.into.append(
            nbformat.v4.new_output(
                "error", ename=etype.__name__, evalue=str(evalue), traceback=list(stb)
            )
        )

    def enable_gui(self, gui: str | None = None) -> None:
        """Need no window system."""

    def show_usage_error(self, exc: BaseException) -> None:
        """Add the wrong use of one of IPython's own commands to the outputs."""
        self._showtraceback(type(exc), exc, [f"UsageError: {exc}"])


def _bundle(kind: str, data: Mapping[str, Any], metadata: Mapping[str, Any] | None) -> Any:
    """Return an output whose binary parts are text."""
    text = {
        mime: base64.encodebytes(part).decode() if isinstance(part, bytes) else part
        for mime, part in data.items()
    }
    return nbformat.v4.new_output(kind, data=text, metadata=dict(metadata or {}))
