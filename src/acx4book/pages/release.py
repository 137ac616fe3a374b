"""A release: the wheel, the archive of the book, and the notebooks that readers download."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import nbformat

from acx4book.notebooks import runner
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.pages import reproducibility
from acx4lib.errors import Acx4Error
from acx4lib.flight import settings
from acx4lib.results import own_folder, whole_files

# --- What is given away: ``python -m acx4book.pages.release HTML FOLDER``
#
# The wheel is built from the last commit, and the book is packed as it was built. The same commit
# and the same book give the same bytes: all dates are those of the commit.


LIST = Path("FILES.txt")
"""List of files in an archive of the project; a clone has none."""

FILE, LINK = 0o100644, 0o120777
"""File modes in an archive."""


class ReleaseError(Acx4Error):
    """Something is missing for a release."""


def _git(*arguments: str) -> bytes:
    """Return the output of git in the current folder."""
    try:
        done = subprocess.run(["git", *arguments], capture_output=True, check=False)
    except OSError as error:
        msg = f"git: {error.strerror}"
        raise ReleaseError(msg) from None
    if done.returncode:
        msg = f"git {arguments[0]}: {done.stderr.decode().strip()}"
        raise ReleaseError(msg)
    return done.stdout


def problems(changelog: str, version: str) -> list[str]:
    """Return a sentence on each entry about a version that the changelog lacks.

    Parameters
    ----------
    changelog : str
        Text of CHANGELOG.md.
    version : str
        The version to be released.
    """
    _, _, newest = changelog.partition("\n## ")
    heading, _, entry = newest.partition("\n")
    entry = entry.partition("\n## ")[0]
    missing = []
    if heading.partition(",")[0] != version:
        missing.append(f"CHANGELOG.md begins with {heading!r}; the version is {version}")
    elif "unreleased" in heading:
        missing.append(f"CHANGELOG.md calls {version} unreleased: write the date of the release")
    for kind, number in (("flights", settings.FORMAT), ("results", own_folder.FORMAT)):
        if not re.search(rf"[Ff]ormat\s+of\s+{kind}\s+is\s+{number}\b", entry):
            missing.append(
                f'CHANGELOG.md does not say "The format of {kind} is {number}" and what older '
                "ones are still read"
            )
    return missing


def _wheel(folder: Path, seconds: int) -> None:
    """Build the wheel of the last commit."""
    with tempfile.TemporaryDirectory() as scratch:
        with tarfile.open(fileobj=BytesIO(_git("archive", "HEAD"))) as sources:
            sources.extractall(scratch, filter="data")
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps"]
        done = subprocess.run(
            [*command, "--no-build-isolation", "--wheel-dir", folder, scratch],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "SOURCE_DATE_EPOCH": str(seconds)},
        )
    if done.returncode:
        raise ReleaseError(done.stderr.strip())


def offered(generated: Path, seconds: int) -> str:
    """Pack the project for readers of the book, and return a link to it as MyST text."""
    archive = generated / "acx4lib.zip"
    try:
        _project(archive, seconds)
    except ReleaseError:
        return "This copy of the book was not made from a clone, and has no program to download.\n"
    size = f"{archive.stat().st_size / 1e6:.0f} MB"
    link = "{download}`acx4lib.zip </_generated/acx4lib.zip>`"
    return f"{link} ({size}) is the whole project of this book.\n"


def _project(archive: Path, seconds: int) -> None:
    """Pack the files of the working copy in the current folder, all that builds the project."""
    names = _listed()
    with _packed(archive, seconds) as add:
        for path in sorted(Path(name) for name in names if os.path.lexists(name)):
            if path.is_symlink():
                add(path.as_posix(), os.fsencode(path.readlink()), LINK)
            else:
                add(path.as_posix(), path.read_bytes(), FILE | path.stat().st_mode & 0o111)
        add(LIST.as_posix(), "\n".join([*names, ""]).encode(), FILE)


def _listed() -> list[str]:
    """Name the files of the working copy."""
    if LIST.is_file():
        return LIST.read_text("utf-8").splitlines()
    return sorted(_git("ls-files", "-z").decode().split("\0")[:-1])


@contextmanager
def _packed(archive: Path, seconds: int) -> Iterator[Callable[[str, bytes, int], None]]:
    """Open a new archive; yield a function that adds a file by name, content and mode."""
    date = time.gmtime(seconds)[:6]

    def add(name: str, content: bytes, mode: int) -> None:
        entry = zipfile.ZipInfo(f"{archive.stem}/{name}", date)
        entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, mode << 16
        packed.writestr(entry, content, compresslevel=9)

    with (
        whole_files.opened_new(archive) as new,
        zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as packed,
    ):
        yield add


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
    if changed := _git("status", "--porcelain").decode().splitlines():
        msg = f"{len(changed)} files differ from the last commit; commit them, and release then"
        raise ReleaseError(msg)
    version = reproducibility.footer(Path("CITATION.cff"))["version"]
    seconds = int(_git("log", "-1", "--format=%ct"))
    folder.mkdir(parents=True, exist_ok=True)
    for old in [*folder.glob("acx4lib-*.whl"), *folder.glob("acx4lib-book-*.zip")]:
        old.unlink()
    _wheel(folder, seconds)
    _pack(html, folder / f"acx4lib-book-{version}.zip", seconds)
    sums = (f"{hashlib.sha256(p.read_bytes()).hexdigest()}  {p}" for p in sorted(folder.iterdir()))
    missing = problems(Path("CHANGELOG.md").read_text(encoding="utf-8"), version)
    return [
        f"acx4lib {version}, commit {_git('rev-parse', 'HEAD').decode().strip()}",
        *sums,
        *missing,
    ]


def _pack(content: Path, archive: Path, seconds: int) -> None:
    """Pack a folder into an archive, below one folder with the archive's name."""
    with _packed(archive, seconds) as add:
        for path in sorted(path for path in content.rglob("*") if path.is_file()):
            add(path.relative_to(content).as_posix(), path.read_bytes(), FILE)


# --- The notebooks for download: without outputs, ready to run anywhere
#
# In the project a notebook reads the flight simulated by make. A copy by itself has other
# defaults, and a cell that simulates a missing flight and runs missing earlier stages.


FOLDER = Path("downloads", "notebooks")
"""Folder of the copies in the built book."""

NEEDS = (
    "> This notebook comes from the book. Where `acx4lib` is not installed, as at a host, put the "
    "book's `acx4lib.zip` beside it: the first cell unpacks and installs it, with its extra "
    "`book`, for which it needs the network once. References such as {numref} are written in MyST "
    "Markdown, which the book shows as links."
)
"""Note for the reader at the top of a copy."""

INSTALL = """\
import importlib.util
import subprocess
import sys

if importlib.util.find_spec("acx4lib") is None:  # some minutes, once
    pip = f'"{sys.executable}" -m pip install -q -c acx4lib/environment.lock'
    subprocess.run(f"unzip -qo acx4lib.zip && {pip} './acx4lib[book]'", shell=True, check=True)
    importlib.invalidate_caches()"""
"""Cell that installs the library if it is missing."""


@dataclass(frozen=True, kw_only=True)
class _Before:
    """Flight, of `acx4sim.DESIGNS`, and stages needed before a notebook can run."""

    design: str = "acx4"
    stages: tuple[str, ...] = ()


ALL = ("heads", "synthetic", "mounting", "validation")
BEFORE: Mapping[str, _Before] = {
    "00-flight": _Before(),
    "01-head-calibration": _Before(),
    "02-synthetic-image": _Before(stages=ALL[:1]),
    "03-mounting-calibration": _Before(design="acx4-ideal"),
    "04-validation": _Before(design="acx4-ideal", stages=("mounting",)),
    "06-errata": _Before(stages=ALL),
    "08-rig": _Before(stages=ALL[:1]),
    "09-weights": _Before(design="acx4-ideal", stages=("mounting",)),
    "16-error-budget": _Before(design="acx4-ideal", stages=("mounting",)),
    "study": _Before(design="acx4-ideal"),
}
"""Notebooks that need a flight: the one shown on their pages."""

PAGES = ("[0-9]*.ipynb", "foundations/*.ipynb", "template/study.ipynb")
"""The notebooks that are pages of the book, below their folder."""


def write(folder: Path) -> None:
    """Write a copy of every notebook, at the same relative path below a folder."""
    for source in _sources():
        name = source.relative_to(NOTEBOOKS_PATH)
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        text: str = nbformat.writes(_copy(source, name.stem))  # type: ignore[no-untyped-call] # untyped
        whole_files.write(path, f"{text}\n")


def _sources() -> list[Path]:
    """Return the notebooks that are pages of the book."""
    matches = (NOTEBOOKS_PATH.glob(pattern) for pattern in PAGES)
    return sorted(path for paths in matches for path in paths)


def _copy(source: Path, name: str) -> nbformat.NotebookNode:
    """Return a copy of a notebook that runs outside the project."""
    notebook: nbformat.NotebookNode = nbformat.read(source, as_version=4)  # type: ignore[no-untyped-call] # untyped
    notebook.cells[0].source += f"\n\n{NEEDS}"
    notebook.cells.insert(1, nbformat.v4.new_code_cell(INSTALL, id="install"))  # type: ignore[no-untyped-call] # untyped
    if name in BEFORE:
        flight, results = _places(name)
        index = next(
            i for i, c in enumerate(notebook.cells) if "parameters" in c.metadata.get("tags", [])
        )
        parameters = notebook.cells[index]
        parameters.source = _with_default(parameters.source, "flight_path", flight)
        parameters.source = _with_default(parameters.source, "results_path", results)
        cell = nbformat.v4.new_code_cell(_start(name, parameters.source), id="start")  # type: ignore[no-untyped-call] # untyped
        notebook.cells.insert(index + 1, cell)
    return notebook


def _with_default(source: str, name: str, value: str) -> str:
    """Replace the default of a text parameter in a cell, if the cell has the parameter."""
    return re.sub(rf'^({name}: str = )"[^"]*"', rf'\1"{value}"', source, flags=re.MULTILINE)


def _places(name: str) -> tuple[str, str]:
    """Return the folders of the flight and of the results of a notebook."""
    return runner.flight_of(BEFORE[name].design), f"results-{name}"


def _start(name: str, parameters: str) -> str:
    """Return the code that simulates the flight and runs earlier stages if they are missing.

    A notebook that has no flight among its parameters makes its own results alone.
    """
    before, (flight, results) = BEFORE[name], _places(name)
    path = "flight_path" if "flight_path:" in parameters else f'"{flight}"'
    stages = repr(before.stages)
    if "calibration_path:" in parameters:
        stages = f"() if calibration_path else {stages}"
    call = f'alone.prepare(\n    {path}, results_path, design="{before.design}", stages={stages}\n)'
    if path != "flight_path":
        call = call.replace("\n", "\n    ")
        call = f'if results_path == "{results}":  # others are there, or a mistake\n    {call}'
    return (
        "from acx4book.notebooks import runner as alone\n\n"
        "# simulates the flight and runs the stages before this one, where they are not there\n"
        f"{call}"
    )


if __name__ == "__main__":
    try:
        lines = make(*map(Path, sys.argv[1:3]))
    except ReleaseError as error:
        sys.exit(str(error))
    sys.stdout.write("\n".join([*lines, ""]))
