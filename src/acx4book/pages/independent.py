"""Chapters that depend on no flight: run when what they depend on has changed, and kept.

The book of the flight that ships has them all. That of another flight has those that are kept and
still hold; the others are neither run for it nor in its table of contents, and neither are the
pages of the programming interface.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from acx4book.notebooks import execute, inputs
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.reference import data as reference
from acx4lib.results.own_folder import whole_files
from acx4lib.results.provenance import KEPT as FLIGHT

FOUNDATIONS = tuple(
    f"foundations/{path.stem}" for path in sorted((NOTEBOOKS_PATH / "foundations").glob("*.ipynb"))
)
"""The chapters of part I."""

CHAPTERS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(FOUNDATIONS, ("data/paper/*.csv",)),
    "05-reference-data": ("data/reference/**/*.csv", "measured"),
    "09-weights": ("data/paper/*.csv",),
    "10-synthetic-quality": ("data/paper/*.csv", "data/benchmarks/closed_chain_pattern.csv"),
    "11-ten-heads": ("data/reference/**/*.csv", "measured"),
    "12-synthetic-cost": ("data/paper/*.csv", "data/benchmarks/closed_chain*"),
    "19-from-pictures": (
        "data/benchmarks/measured_flights*",
    ),  # takes half a minute, so it is not the last
    "14-failure-clinic": (),
    "15-which-flight": (),
    "18-over-the-years": (),
    "16-error-budget": ("data/paper/*.csv",),
}
"""The notebooks, and what files of the working copy they read; *measured* are the measurements of
others, wherever they are."""

OF_IDEAL = ("09-weights", "16-error-budget")
"""Those of any flight, which show that of the ideal camera."""

KEPT = Path("build", "chapters")
"""Where the executed notebooks are kept, below the current folder: that of the working copy."""

CORES = 2
"""Notebooks that are run side by side."""


def bring(executed: Path, ideal_path: Path | None) -> list[str]:
    """Bring the chapters into the book, and return the names of those that are left out.

    Parameters
    ----------
    executed : Path
        Where the book has its executed notebooks.
    ideal_path : Path or None
        Run of the flight that `OF_IDEAL` shows, where those chapters are run that are not kept, or
        do not hold any more.

    Raises
    ------
    NotebookError
        If a notebook fails.
    """
    names = [name for name in CHAPTERS if ideal_path is not None or name not in OF_IDEAL]
    kept = {name: KEPT / f"{name}-{_digest(name, ideal_path)[:16]}.ipynb" for name in names}
    missing = [path for path in kept.values() if not path.is_file()]
    if ideal_path is not None and missing:
        for path in missing:
            path.parent.mkdir(parents=True, exist_ok=True)
        with ProcessPoolExecutor(min(CORES, len(missing))) as pool:
            list(pool.map(partial(_run, ideal_path), missing))
    here = {name: path for name, path in kept.items() if path.is_file()}
    for name, path in here.items():
        page = executed / f"{name}.ipynb"
        page.parent.mkdir(exist_ok=True)
        whole_files.copy(path, page)
    return [name for name in CHAPTERS if name not in here]


def _run(ideal_path: Path, kept: Path) -> None:
    """Run a chapter and keep it in the place of what was kept of it."""
    name = kept.stem.rpartition("-")[0]
    source = NOTEBOOKS_PATH / kept.parent.relative_to(KEPT) / f"{name}.ipynb"
    new = kept.with_name(f"new-{kept.name}")
    of_ideal = {"flight_path": str(ideal_path / FLIGHT), "results_path": str(ideal_path)}
    values = execute.with_defaults(source, of_ideal if name in OF_IDEAL else {})
    execute.execute(source, new, parameters=values, on_cell=lambda *_: None)
    execute.scrub(new)
    for old in kept.parent.glob(f"{name}-*.ipynb"):
        old.unlink()
    new.replace(kept)


def _digest(name: str, ideal_path: Path | None) -> str:
    files = [*_files(CHAPTERS[name])]
    if ideal_path is not None and name in OF_IDEAL:
        files += [ideal_path / "parameters.csv", *(ideal_path / FLIGHT).rglob("*.*")]
    return inputs.digest(NOTEBOOKS_PATH / f"{name}.ipynb", Path("src"), files)


def _files(patterns: Iterable[str]) -> Iterator[Path]:
    """Yield the files that patterns mean, and the versions of the libraries."""
    yield Path("environment.lock")
    for pattern in patterns:
        measured = pattern == "measured"
        found = reference.folder().rglob("*") if measured else Path().glob(pattern)
        yield from filter(Path.is_file, found)


# --- a book without some of them -------------------------------------------------------------


def leave_out(book: Path, pages: Collection[str]) -> None:
    """Write the book's table of contents without some pages, and what the chapters are called.

    The extension `left_out` of the book reads the list: links become titles or names.

    Parameters
    ----------
    book : Path
    pages : collection of str
        Pages as the table of contents names them, and folders of pages.
    """
    contents = yaml.safe_load((book / "_toc.yml").read_text("utf-8"))
    for part in contents.get("parts", [contents]):
        part["chapters"] = [*_without(pages, part["chapters"])]
    if "parts" in contents:  # an empty one is malformed
        contents["parts"] = [part for part in contents["parts"] if part["chapters"]]
    generated = book / "_generated"
    whole_files.write(generated / "_toc.yml", yaml.safe_dump(contents))
    titles = {page: _title(page) for page in pages}
    whole_files.write(generated / "left_out.json", json.dumps(titles, indent=1))


def _without(pages: Collection[str], entries: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the entries of a table of contents that are none of some pages, and their sections."""
    for entry in entries:
        folders = {parent.as_posix() for parent in PurePosixPath(entry["file"]).parents}
        if not {entry["file"], *folders} & set(pages):
            inside = [*_without(pages, entry.get("sections", ()))]
            alone = {key: value for key, value in entry.items() if key != "sections"}
            yield {**alone, "sections": inside} if inside else alone


def _title(page: str) -> str:
    """Return the title of a chapter; a folder has none."""
    notebook = NOTEBOOKS_PATH / f"{page.removeprefix('_executed/')}.ipynb"
    if not notebook.is_file():
        return ""
    first = json.loads(notebook.read_text("utf-8"))["cells"][0]["source"]
    return "".join(first).splitlines()[0].removeprefix("# ")
