"""The code of a page, run from top to bottom, and what it prints."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from typing import NamedTuple

FENCE = re.compile(r"^```(python|shell)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)

ACX4 = (sys.executable, "-c", "from acx4book.command.acx4 import main; main()")
"""The command of this installation, whatever the path of programs has."""

COLUMNS = "78"
"""Width of the terminal on which a page shows commands, so that its lines fit on the page."""


class Piece(NamedTuple):
    """A piece of code on a page: its language, python or shell, and its lines."""

    language: str
    code: str


def snippets(page: str) -> list[Piece]:
    """Return the code of a page that is run, piece by piece; fences of ``bash`` are not."""
    return [Piece(*found) for found in FENCE.findall(page)]


def outputs(pieces: Iterable[Piece]) -> Iterator[str]:
    """Run pieces of code one after the other, in an empty folder; yield what each prints.

    Raises
    ------
    subprocess.CalledProcessError
        Where a command fails.
    """
    names: dict[str, object] = {"__name__": "example"}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for number, (language, code) in enumerate(pieces, 1):
            if language == "shell":
                yield "".join(_printed(line) for line in code.splitlines())
                continue
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(code, f"<piece {number} of the page>", "exec"), names)
            yield said.getvalue()


def _printed(line: str) -> str:
    """Return what a command prints that begins with ``acx4``."""
    arguments = shlex.split(line)[1:]
    narrow = os.environ | {"COLUMNS": COLUMNS}
    done = subprocess.run(
        [*ACX4, *arguments], capture_output=True, text=True, check=True, env=narrow
    )
    return done.stdout
