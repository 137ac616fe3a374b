"""The two ways to run stages, of which that of the notebooks is loaded only where it is gone."""

from __future__ import annotations

from pathlib import Path

from acx4book.notebooks.functions import Functions
from acx4book.notebooks.runner import Way


def way_of(notebooks: Path | None) -> Way:
    """Return the way of the notebooks in a folder, or that of the functions for None.

    Raises
    ------
    ImportError
        The extra ``book`` is not installed, which notebooks need.
    """
    if notebooks is None:
        return Functions()
    from acx4book.notebooks.execute import Notebooks  # noqa: PLC0415 needs the extra book

    return Notebooks(path=notebooks)
