"""The cells of a notebook run as a reader does who changes one of them and runs all below."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nbformat
from threadpoolctl import threadpool_limits

from acx4book.notebook import End
from support.helpers import ROOT


def changed(
    name: str, changes: Mapping[str, str] | None = None, **parameters: Any
) -> dict[str, Any]:
    """Run the code cells of a notebook one after the other, and return what they define.

    Parameters
    ----------
    name : str
        The beginning of the file's name, such as ``"03"``.
    changes : mapping of str to str, optional
        New text by old text, which must stand in one open cell, once.
    **parameters
        Values of parameters; the others have their defaults.

    Returns
    -------
    dict
        The names of the cells; ``ended`` is the sentence with which the notebook ended early.
    """
    (path,) = (ROOT / "notebooks").glob(f"{name}*.ipynb")
    sources = _changed(path, changes or {})
    names: dict[str, Any] = {}
    with threadpool_limits(1, user_api="blas"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for number, source in enumerate(sources):
            try:
                exec(compile(source, f"{path.name}, cell {number}", "exec"), names)
            except End as end:
                return names | {"ended": str(end)}
            if number == 0:
                assert parameters.keys() <= names.keys()
                names |= {
                    key: str(v) if isinstance(v, Path) else v for key, v in parameters.items()
                }
    return names


def _changed(path: Path, changes: Mapping[str, str]) -> list[str]:
    cells = nbformat.read(path, as_version=4).cells
    code = [cell for cell in cells if cell.cell_type == "code"]
    shown = ["hide-input" not in cell.metadata.get("tags", []) for cell in code]
    sources = [cell.source for cell in code]
    for old, new in changes.items():
        found = [
            source.count(old) if seen else 0 for source, seen in zip(sources, shown, strict=True)
        ]
        assert sum(found) == 1, f"{old!r} stands {sum(found)} times in the open cells"
        at = found.index(1)
        sources[at] = sources[at].replace(old, new)
    return sources
