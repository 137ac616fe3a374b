"""Calls of a notebook besides the library: its beginning, and its early end.

It works in any kernel, also under plain papermill. Outside of IPython nothing is shown.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from IPython.core.getipython import get_ipython
from IPython.display import display
from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from acx4book.typesetting import style, tables
from acx4book.typesetting.myst import say
from acx4book.typesetting.svg import vector
from acx4files.flight.reader import Flight
from acx4files.stages import order
from acx4lib.errors import visible

__all__ = ["begin", "end", "needs", "say"]

INJECTED = "# Parameters\n"
"""First line of papermill's cell of parameters, which stands below the notebook's own."""


ENDS = "This notebook ends here: "
"""Beginning of the sentence that ends a notebook early."""


class End(Exception):
    """The notebook ends here, and nothing is wrong."""


def begin() -> None:
    """Begin a notebook: check its parameters, show tables, and figures as vectors.

    Linear algebra then has one thread, as in ``acx4 run``, so that results are equal byte by byte.

    Raises
    ------
    ValueError
        Where papermill was given a parameter that the notebook does not have, which it would
        ignore, or a value of another type than the default.
    """
    shell: Any = get_ipython()
    if shell is None:
        return
    _check_parameters(shell.user_ns.get("In", []))
    tables.register(shell)
    formatters = shell.display_formatter.formatters
    formatters["image/png"].for_type(Figure, lambda _: None)
    formatters["image/svg+xml"].for_type(Figure, vector)
    formatters["image/svg+xml"].for_type(style.Nothing, lambda _: None)
    threadpool_limits(1, user_api="blas")


def _check_parameters(cells: Sequence[str]) -> None:
    """Compare the parameters injected last by papermill with the cell of defaults before them."""
    injected = max((i for i, cell in enumerate(cells) if cell.startswith(INJECTED)), default=0)
    defaults = _assigned(cells[injected - 1]) if injected else {}
    if not defaults:
        return
    for name, value in _assigned(cells[injected]).items():
        if name not in defaults:
            msg = f"unknown parameter {name}; this notebook has {', '.join(defaults)}"
            raise ValueError(msg)
        wanted = type(defaults[name])
        if type(value) is not wanted and (wanted, type(value)) != (float, int):
            hint = f"; papermill takes text as it is by -r {name}" if wanted is str else ""
            msg = f"parameter {name}: {value!r}; must be {wanted.__name__}{hint}"
            raise ValueError(msg)


def _assigned(cell: str) -> dict[str, object]:
    """Return the constants that a cell assigns, by name; empty where a cell does more."""
    values: dict[str, object] = {}
    try:
        for node in ast.parse(cell).body:
            target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", 0)
            if not isinstance(target, ast.Name):
                return {}
            values[target.id] = ast.literal_eval(getattr(node, "value", None) or "None")
    except (SyntaxError, ValueError):
        return {}
    return values


def needs(flight: Flight, stage: str) -> None:
    """End the notebook in one sentence where a flight has no data for a stage.

    Parameters
    ----------
    flight : Flight
    stage : str
        As `acx4files.stages.order.missing` takes it.

    Raises
    ------
    End
        Which no notebook shows as an error.
    """
    if reason := order.missing(flight, stage):
        end(reason)


def end(reason: str) -> None:
    """End the notebook in one sentence.

    Cells below do nothing where a program runs the notebook; where a reader does, they wait.

    Parameters
    ----------
    reason : str
        Why there is nothing more to show.

    Raises
    ------
    End
        Which no notebook shows as an error.
    """
    sentence = f"{ENDS}{visible(reason)}."
    shell: Any = get_ipython()
    if shell is not None:
        display({"text/markdown": sentence, "text/plain": sentence}, raw=True)  # type: ignore[no-untyped-call] # IPython's
        _end(shell)
    raise End(sentence)


def _end(shell: Any) -> None:
    """Let `End` stop the cell that runs, without an error among its outputs.

    A reader's other cells are not run after it, and can be, one by one. A program would take this
    for a failure: for it the cell has ended well, and those below are empty.
    """
    shell.set_custom_exc((End,), lambda *_, **__: None)
    if not _is_read(shell):
        shell.events.register("post_run_cell", _ended_well)
        shell.input_transformers_cleanup.append(lambda _: [])


def _is_read(shell: Any) -> bool:
    """Tell whether a reader runs the cells, whom a cell may ask for input."""
    kernel = getattr(shell, "kernel", None)
    request = {} if kernel is None else kernel.get_parent("shell")
    return bool(request.get("content", {}).get("allow_stdin"))


def _ended_well(result: Any) -> None:
    if isinstance(result.error_in_exec, End):
        result.error_in_exec = None
