"""Files of a results folder: regular ones, which lie in the folder itself, links resolved."""

from __future__ import annotations

import os
from pathlib import Path

from acx4lib.errors import FlightError
from acx4lib.flight.problems import Problem
from acx4lib.flight.text.files import read_text

MOST_BYTES = 200_000_000
"""Largest JSON file of results; a thousand heads have a hundredth of it."""


def is_there(path: Path, folder: Path | None = None) -> bool:
    """Tell whether a file of results is there.

    Parameters
    ----------
    path : Path
    folder : Path, optional
        That of the results; by default the one that the path names.

    Raises
    ------
    FlightError
        Where something else is in its place, or it is a link that leads out of the folder.
    """
    # the end of a link is looked at by name before anything is opened there
    if not is_inside(path, folder or path.parent):
        raise FlightError([_wrong(path, "is a link that leads out of the results")])
    if path.is_file():
        return True
    if os.path.lexists(path):  # reading a pipe would wait without end
        found = "is a link to nothing" if path.is_symlink() else "is no regular file"
        raise FlightError([_wrong(path, found)])
    return False


def is_inside(path: Path, folder: Path) -> bool:
    """Tell whether a path leads to a place below a folder, whatever links are on the way."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def _wrong(path: Path, found: str) -> str:
    expected = "must be a file that a run wrote; remove it and run again"
    return str(Problem(file=str(path), line=1, column="file", found=found, expected=expected))


def text_of(path: Path) -> str:
    """Return the text of a file that is there.

    Raises
    ------
    FlightError
        Where it is no text, or too large.
    """
    text, _, problems = read_text(path, str(path), needed_by="a report", most=MOST_BYTES)
    if problems:
        raise FlightError([f"{problem}; remove it and run again" for problem in problems])
    return text
