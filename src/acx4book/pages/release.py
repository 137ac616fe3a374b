"""A release: the wheel of the last commit, and the built book in one archive.

Run by ``python -m acx4book.pages.release HTML FOLDER`` in the working copy.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from acx4book.pages import reproducibility
from acx4lib.errors import Acx4Error


class ReleaseError(Acx4Error):
    """Something is missing for a release."""


def _run(*command: str | Path) -> str:
    """Return the output of a program."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except OSError as error:
        msg = f"{command[0]}: {error.strerror}"
        raise ReleaseError(msg) from None
    except subprocess.CalledProcessError as error:
        msg = f"{command[0]} {command[1]}: {error.stderr.strip()}"
        raise ReleaseError(msg) from None
    return done.stdout


def program(archive: Path) -> str:
    """Pack the last commit for readers of the book, and return a link to it as MyST text."""
    try:
        _run("git", "archive", "--format=zip", "--prefix=acx4lib/", "--output", archive, "HEAD")
    except ReleaseError:
        return "This copy of the book was not made from a clone, and has no program to download.\n"
    size = f"{archive.stat().st_size / 1e6:.0f} MB"
    link = f"{{download}}`acx4lib.zip </_generated/{archive.name}>`"
    return f"{link} ({size}) is the whole project of this book.\n"


def make(html: Path, folder: Path) -> list[str]:
    """Make a release of the working copy in the current folder, and return its messages.

    Parameters
    ----------
    html : Path
        The built book.
    folder : Path
        Where the files go.

    Raises
    ------
    ReleaseError
        Where files differ from the last commit, or the wheel cannot be built.
    """
    if changed := _run("git", "status", "--porcelain").splitlines():
        msg = f"{len(changed)} files differ from the last commit; commit them, and release then"
        raise ReleaseError(msg)
    version = reproducibility.footer(Path("CITATION.cff"))["version"]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation")
    with tempfile.TemporaryDirectory() as clone:
        _run("git", "clone", "--quiet", ".", clone)
        _run(*pip, "--wheel-dir", folder, clone)
    shutil.make_archive(str(folder / f"acx4lib-book-{version}"), "zip", html)
    sums = (f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p}" for p in sorted(folder.iterdir()))
    return [f"acx4lib {version}, commit {_run('git', 'rev-parse', 'HEAD').strip()}", *sums]


if __name__ == "__main__":
    try:
        lines = make(*map(Path, sys.argv[1:3]))
    except ReleaseError as error:
        sys.exit(str(error))
    sys.stdout.write("\n".join([*lines, ""]))
