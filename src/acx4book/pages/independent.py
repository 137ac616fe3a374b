"""Chapters that depend on no flight: run when what they depend on has changed, and kept.

The book of the flight that ships has them all. That of another flight has those that are kept and
still hold; the others are neither run for it nor in its table of contents.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from acx4book.notebooks import execute, inputs
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.reference import data as reference

CHAPTERS: Mapping[str, tuple[str, ...]] = {
    "05-reference-data": ("data/reference/**/*.csv", "measured"),
    "09-weights": ("data/paper/*.csv",),
    "10-synthetic-quality": ("data/paper/*.csv",),
    "11-surround-rig": ("data/reference/**/*.csv", "measured"),
    "12-synthetic-cost": ("data/paper/*.csv", "data/benchmarks/closed_chain*"),
    "13-bad-starts": (),
}
"""The notebooks, and what files of the working copy they read; *measured* are the measurements of
others, wherever they are."""

KEPT = Path("build", "chapters")
"""Where the executed notebooks are kept, below the current folder: that of the working copy."""

CORES = 2
"""Notebooks that are run side by side."""


def bring(executed: Path, *, run: bool) -> list[str]:
    """Bring the chapters into the book, and return the names of those that are left out.

    Parameters
    ----------
    executed : Path
        Where the book has its executed notebooks.
    run : bool
        Whether those are run that are not kept, or do not hold any more.

    Raises
    ------
    NotebookError
        If a notebook fails.
    """
    kept = {name: KEPT / f"{name}-{_digest(name)[:16]}.ipynb" for name in CHAPTERS}
    missing = [path for path in kept.values() if not path.is_file()]
    if run and missing:
        KEPT.mkdir(parents=True, exist_ok=True)
        with ProcessPoolExecutor(min(CORES, len(missing))) as pool:
            list(pool.map(_run, missing))
    here = {name: path for name, path in kept.items() if path.is_file()}
    for name, path in here.items():
        shutil.copyfile(path, executed / f"{name}.ipynb")
    return [name for name in CHAPTERS if name not in here]


def _run(kept: Path) -> None:
    """Run a chapter and keep it in the place of what was kept of it."""
    name = kept.stem.rpartition("-")[0]
    source, new = NOTEBOOKS_PATH / f"{name}.ipynb", kept.with_suffix(".new")
    values = execute.with_defaults(source, {})
    execute.execute(source, new, parameters=values, on_cell=lambda *_: None)
    execute.scrub(new)
    for old in KEPT.glob(f"{name}-*.ipynb"):
        old.unlink()
    new.replace(kept)


def _digest(name: str) -> str:
    return inputs.digest(NOTEBOOKS_PATH / f"{name}.ipynb", Path("src"), _files(CHAPTERS[name]))


def _files(patterns: Iterable[str]) -> Iterator[Path]:
    """Yield the files that patterns mean, and the versions of the libraries."""
    yield Path("environment.lock")
    for pattern in patterns:
        measured = pattern == "measured"
        found = reference.folder().rglob("*") if measured else Path().glob(pattern)
        yield from filter(Path.is_file, found)


# --- a book without some of them -------------------------------------------------------------


def leave_out(book: Path, names: Iterable[str]) -> None:
    """Write the book's table of contents without some chapters, and what these are called.

    Links to them become their titles: the extension `left_out` of the book reads the list.
    """
    contents = (book / "_toc.yml").read_text("utf-8")
    titles = {name: _title(NOTEBOOKS_PATH / f"{name}.ipynb") for name in names}
    without = re.sub(
        rf"^ *- file: _executed/({'|'.join(titles) or '(?!)'})\n", "", contents, flags=re.MULTILINE
    )
    generated = book / "_generated"
    (generated / "_toc.yml").write_text(without, encoding="utf-8")
    (generated / "left_out.json").write_text(json.dumps(titles, indent=1), encoding="utf-8")


def _title(notebook: Path) -> str:
    first = json.loads(notebook.read_text("utf-8"))["cells"][0]["source"]
    return "".join(first).splitlines()[0].removeprefix("# ")
