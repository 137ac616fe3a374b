"""Folders outside the project in which other programs keep things, and whether one may."""

from __future__ import annotations

import os
from pathlib import Path


def is_writable(folder: Path) -> bool:
    """Tell whether files can be made in a folder, which is made where it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def user_folder(variable: str, default: str) -> Path | None:
    """Return a folder of the user; None where there is no home.

    Parameters
    ----------
    variable : str
        Environment variable that names it, such as ``XDG_CACHE_HOME``.
    default : str
        Below the home, where the variable says nothing.
    """
    named = Path(os.environ.get(variable) or os.path.expanduser(f"~/{default}"))  # noqa: PTH111 Path's raises
    return named if named.is_absolute() else None
