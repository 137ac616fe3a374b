"""What the cells of the report's notebook show, computed in this process.

The notebook is the project's own and only looks up: the interpreter that other notebooks have, in a
process of its own, takes longer to load than the report takes to make.
"""

from __future__ import annotations

import ast
import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from acx4book.report.shown import Text


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the report.

    Attributes
    ----------
    content : Text or Figure
    told : mapping
        What the notebook tells of a figure: its label, caption, and words in its place.
    """

    content: Text | Figure
    told: Mapping[str, Any] = field(default_factory=dict)


def parts(
    notebook: Path, names: dict[str, Any], on_cell: Callable[[int, int], None]
) -> Iterator[Part]:
    """Run a notebook and yield its texts and what its cells show, in their order.

    Parameters
    ----------
    notebook : Path
    names : dict
        The parameters, in place of the cell with the defaults; the cells add what they define.
    on_cell : callable
        Called with the number of finished cells, and of all cells.

    Raises
    ------
    Exception
        Whatever a cell raises.
    """
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    with threadpool_limits(1, user_api="blas"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as a page shows none
        for number, cell in enumerate(cells):
            on_cell(number, len(cells))
            content = _content(cell, names)
            if isinstance(content, Text | Figure):
                yield Part(content=content, told=cell["metadata"].get("mystnb", {}))
    on_cell(len(cells), len(cells))


def _content(cell: Mapping[str, Any], names: dict[str, Any]) -> Any:
    """Return the text of a cell, or the value of its last line after running it."""
    source = "".join(cell["source"])
    if cell["cell_type"] != "code":
        return Text(source)
    if "parameters" in cell["metadata"].get("tags", ()):
        return None
    *before, last = ast.parse(source).body
    if not isinstance(last, ast.Expr):
        exec(source, names)
        return None
    exec(compile(ast.Module(before, []), "cell", "exec"), names)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)
