"""Reading and writing that never follows a link: a mutation stays in its flight."""

from __future__ import annotations

import os
from pathlib import Path


def is_here(path: Path) -> bool:
    """Tell whether a path leads through no link and to none."""
    return os.path.realpath(path) == os.fspath(path)


def data_of(path: Path) -> bytes:
    """Return what a regular file holds, nothing of anything else."""
    return path.read_bytes() if is_here(path) and path.is_file() else b""


def write(path: Path, data: bytes) -> None:
    """Write a regular file, or nothing where something else stands."""
    if is_here(path) and path.parent.is_dir() and (path.is_file() or not os.path.lexists(path)):
        path.write_bytes(data)
