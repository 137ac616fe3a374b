"""A book of one flight: its chapters, its certificate, and reference pages for them.

It is meant for clients or students. It has nothing of the study: no errata, no scorecard, no labs.
Chapters on blocks that the flight lacks are left out.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Set
from html import escape
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Any, TextIO

import nbformat
import pandas as pd
import yaml

from acx4book.notebooks.runner import NOTEBOOKS_PATH, Tell
from acx4book.pages import build, frames
from acx4book.report import material, page
from acx4book.typesetting.myst import myst_table
from acx4book.typesetting.plain_text import code, shown
from acx4book.typesetting.tables import markdown
from acx4files.results import whole_files
from acx4files.results.folder import NOTEBOOKS
from acx4files.results.provenance import KEPT
from acx4lib.errors import Acx4Error, visible

SIGNS = ("searchindex.js",)
"""Files by which an earlier book is known."""

SOURCES = Path(str(resources.files("acx4book.pages") / "sources"))
"""Folder of the pages of the study's book, some of which a flight's book takes."""

CHAPTERS = {
    "00-flight": "flight",
    "01-head-calibration": "heads",
    "02-synthetic-image": "synthetic",
    "08-rig": "rig",
    "03-mounting-calibration": "mounting",
    "04-validation": "validation",
    "16-error-budget": "validation",
    "09-weights": "mounting",
}
"""Notebooks for any flight, in the order of its book, and the stage that each needs: its own, if
the run executes the notebook, or the stage of the results shown."""

READING = ("frames-and-notation", "notation", "glossary", "bibliography")
"""Reference pages for readers of the chapters."""

TAKEN = ("_ext", "_static", "_moving", "images", "references.bib", *(f"{p}.md" for p in READING))
"""Sources of the study's book used unchanged, beside its settings."""

OF_CODE = {
    *("sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"),
    *("sphinx_exercise", "short_signatures", "docstrings", "forwards"),
}
"""Extensions of Sphinx for pages that the book of a flight does not have."""

OF_COURSE = re.compile(r":::\{admonition\} Before you start\n.*?\n:::\n\n", re.DOTALL)
"""The box in the first cell of a chapter with goals, prerequisites and exercises."""

NOTE = ":::{note}\nThe flight of this page is simulated.\n:::"

BUILD = (
    "import sys; sys.modules['rfc3987_syntax'] = None; "  # whose grammar takes a second to load
    "from jupyter_book.cli.main import main; main()"
)

COLOURS, SAYS = re.compile(r"\x1b\[[0-9;]*m"), re.compile(r"WARNING|ERROR|Error")
"""Escape sequences for colours in the output of Sphinx, and words of lines on errors."""

LINES_SHOWN = 12
"""Number of last lines of Sphinx in the message of a failed build."""


class BookError(Acx4Error):
    """A book could not be built."""


def write(
    results_path: Path, site: Path, *, strict: bool = False, tell: Tell = lambda *_: None
) -> None:
    """Build the book of a run as a folder of HTML, whole or not at all.

    Parameters
    ----------
    results_path : Path
        A run of the flight with its notebooks.
    site : Path
        New, empty, or an earlier book of this command.
    strict : bool
        Whether a warning of Sphinx is an error.
    tell : callable
        It is told the progress.

    Raises
    ------
    FlightError
        Where the results are not complete, or were changed.
    OutputError
        Where the folder must not be used.
    BookError
        Where Sphinx fails.
    """
    with (
        tempfile.TemporaryDirectory(prefix="acx4-book-") as temporary,
        whole_files.claim(site, signs=SIGNS),
    ):
        source = Path(temporary) / "book"
        name = _gather(results_path, source, tell)
        html = _built(source, Path(temporary), strict=strict)
        _escape(html, visible(name))
        page.write(results_path, html / "report.html")
        shutil.copyfile(source / "_toc.yml", html / "_toc.yml")  # by which it can be printed
        tell("pages", 1, 1)
        _place(html, site)


def write_chapter(name: str, results_path: Path, site: Path) -> None:
    """Build one chapter of the study's book for its author, with warnings on stderr.

    Parameters
    ----------
    name : str
        A notebook, such as ``11-ten-heads`` or ``foundations/3-collinearity``.
    results_path : Path
        A run, if there is one; without, the notebook is run with its own parameters.
    site : Path
        New, empty, or what this function wrote.

    Raises
    ------
    BookError
        Where there is no such notebook, or Sphinx fails.
    """
    notebook = NOTEBOOKS_PATH / f"{name}.ipynb"
    if notebook not in {*NOTEBOOKS_PATH.rglob("*.ipynb")}:
        raise BookError(f"{name}: no such notebook; one is {next(iter(CHAPTERS))}")
    with (
        tempfile.TemporaryDirectory(prefix="acx4-book-") as temporary,
        whole_files.claim(site, signs=SIGNS),
    ):
        source = Path(temporary) / "book"
        executed = _begun(source)
        done = results_path / "notebooks" / notebook.name
        places = {"flight_path": str(results_path / KEPT), "results_path": str(results_path)}
        if done.is_file():
            build.fold(done, executed / done.name)
        else:
            (executed / name).parent.mkdir(exist_ok=True)
            build.run_here(name, executed, places if results_path.is_dir() else {})
        _write_settings(source, "acx4lib", [name], {"index.md": f"# {name}\n"}, set())
        _place(_built(source, Path(temporary), strict=False, log=sys.stderr), site)


def _escape(html: Path, name: str) -> None:
    """Escape the name of the flight where the theme's templates do not."""
    if (safe := escape(name)) != name:
        for path in html.rglob("*.html"):
            whole_files.write(path, path.read_text("utf-8").replace(name, safe))


def _place(html: Path, folder: Path) -> None:
    """Copy the pages into their folder, where they replace those of an earlier book."""
    with whole_files.together() as new:
        for path in sorted(html.rglob("*")):
            place = folder / path.relative_to(html)
            if path.is_dir():
                place.mkdir(parents=True, exist_ok=True)
            else:
                new(place).write_bytes(path.read_bytes())


def _gather(results_path: Path, source: Path, tell: Tell) -> str:
    """Write all sources of the pages, and return the name of the flight."""
    executed = _begun(source)
    run = material.read(results_path)
    chapters = list(_chapters(results_path, executed, simulated=run.flight.simulated, tell=tell))
    texts = {
        "index.md": _front(run),
        "certificate.md": f"# Certificate\n\n{build.certificate_page(run, 'report.html')}",
    }
    _write_settings(source, run.flight.name, chapters, texts, OF_CODE)
    return run.flight.name


def _begun(source: Path) -> Path:
    """Copy the common files of all books, and return the folder for the notebooks."""
    source.mkdir()
    for name in TAKEN:
        copied = shutil.copytree if (SOURCES / name).is_dir() else shutil.copyfile
        copied(SOURCES / name, source / name)
    executed, generated = source / "_executed", source / "_generated"
    executed.mkdir()
    generated.mkdir()
    frames.draw(generated)
    return executed


def _write_settings(
    source: Path, name: str, chapters: list[str], texts: Mapping[str, str], without: Set[str]
) -> None:
    """Write pages, contents and settings of a book with given chapters and extensions."""
    generated = source / "_generated"
    settings = {"_toc.yml": _contents(chapters, [*texts]), "_config.yml": _settings(name, without)}
    written = {file: yaml.safe_dump(values) for file, values in settings.items()}
    for file, text in {**texts, **written}.items():
        whole_files.write(source / file, text)
    made_by = f"acx4lib {version('acx4lib')}"
    made_from = {"made_by": made_by, "flights": dict.fromkeys(chapters, name)}
    whole_files.write(generated / "made_from.json", json.dumps(made_from))
    left_out = {page: title for page, title in _titles() if page not in {*READING, *chapters}}
    whole_files.write(generated / "left_out.json", json.dumps({**left_out, "_generated/api": ""}))
    foot = {"name": "acx4lib", "version": version("acx4lib"), "authors": "", "licence": ""}
    whole_files.write(generated / "citation.json", json.dumps(foot))


# --- chapters --------------------------------------------------------------------------------


def _chapters(results_path: Path, executed: Path, *, simulated: bool, tell: Tell) -> Iterator[str]:
    """Write the pages of the flight's chapters, and yield their names.

    The stages' notebooks come executed from the run; the others are executed here.
    """
    note = NOTE if simulated else ""
    places = {"flight_path": str(results_path / KEPT), "results_path": str(results_path)}
    for number, (name, stage) in enumerate(CHAPTERS.items()):
        tell("chapters", number + 1, len(CHAPTERS))
        done = results_path / "notebooks" / f"{NOTEBOOKS[stage]}.ipynb"
        if not done.is_file():
            continue
        if done.stem == name:
            build.fold(done, executed / done.name, note=note)
        else:
            build.run_here(name, executed, places, note=note)
        _without_course(executed / f"{name}.ipynb")
        yield name


def _without_course(page: Path) -> None:
    """Remove the box for course participants from a chapter."""
    notebook = nbformat.read(page, as_version=4)  # type: ignore[no-untyped-call] # untyped
    notebook.cells[0].source = OF_COURSE.sub("", notebook.cells[0].source)
    whole_files.write(page, nbformat.writes(notebook))  # type: ignore[no-untyped-call] # untyped


# --- pages -----------------------------------------------------------------------------------


def _front(run: material.Material) -> str:
    """Return the first page: flight, table of contents, blocks, files and software."""
    flight = run.flight
    blocks = pd.concat([block.table() for block in flight.blocks.values()])
    versions = {name: v for stage in run.provenance.stages.values() for name, v in _versions(stage)}
    software = pd.DataFrame({"Package": list(versions), "Version": list(versions.values())})
    files = pd.DataFrame(
        {
            "File": [code(name) for name in run.provenance.files],
            "SHA-256": [code(digest) for digest in run.provenance.files.values()],
        }
    )
    simulated = "The flight is simulated. " if flight.simulated else ""
    return "\n\n".join(
        [
            f"# {shown(flight.name)}",
            f"{simulated}This book shows what was flown, how the camera was calibrated from it, "
            "and how good the calibration is. Every number was computed from the tables that are "
            "named below.",
            "```{tableofcontents}\n```",
            "## What was read",
            markdown(blocks),
            "## Files and versions",
            myst_table(software, "What computed the numbers", name="tab-software"),
            myst_table(files, "The tables of the flight", name="tab-files"),
            "",
        ]
    )


def _versions(stage: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    versions = stage.get("versions", {})
    if isinstance(versions, Mapping):
        yield from ((str(name), str(v)) for name, v in versions.items())


def _contents(chapters: list[str], pages: list[str]) -> dict[str, Any]:
    """Return the table of contents."""
    of_flight = [f"_executed/{name}" for name in chapters]
    others = [page.removesuffix(".md") for page in pages if page != "index.md"]
    parts = {"The flight": [*of_flight, *others], "To read it": READING}
    return {
        "format": "jb-book",
        "root": "index",
        "parts": [
            {"caption": caption, "chapters": [{"file": page} for page in pages]}
            for caption, pages in parts.items()
        ],
    }


def _settings(name: str, without: Set[str]) -> dict[str, Any]:
    """Return the settings of the study's book, with the name of the flight."""
    settings: dict[str, Any] = yaml.safe_load((SOURCES / "_config.yml").read_text("utf-8"))
    settings["title"] = plain = visible(name)  # which Sphinx escapes, but not in the logo
    sphinx = settings["sphinx"]
    extra, local = sphinx["extra_extensions"], sphinx["local_extensions"]
    sphinx["extra_extensions"] = [name for name in extra if name not in without]
    sphinx["local_extensions"] = {n: place for n, place in local.items() if n not in without}
    of_code = ("autodoc_", "autosummary_", "napoleon_")
    sphinx["config"] = {k: v for k, v in sphinx["config"].items() if not k.startswith(of_code)}
    config = sphinx["config"]
    config["html_title"] = plain
    config["html_theme_options"]["logo"] = {"text": shown(name, "html"), "alt_text": ""}
    return settings


def _titles() -> Iterator[tuple[str, str]]:
    """Yield the pages of the study's book, and their titles."""
    for path in NOTEBOOKS_PATH.rglob("*.ipynb"):
        name = path.relative_to(NOTEBOOKS_PATH).with_suffix("").as_posix()
        yield f"_executed/{name}", build.title(path).removeprefix("# ")
    for path in SOURCES.rglob("*.md"):
        name = path.relative_to(SOURCES).with_suffix("").as_posix()
        first = path.read_text("utf-8").lstrip().splitlines()[:1]
        yield name, "".join(first).removeprefix("# ")


# --- Sphinx ----------------------------------------------------------------------------------


def _built(source: Path, work: Path, *, strict: bool, log: TextIO | None = None) -> Path:
    """Run Sphinx, and return the folder of HTML; its warnings are written to `log`."""
    options = ["--quiet", "-n", "--keep-going", *(["-W"] if strict else [])]
    command = [sys.executable, "-c", BUILD, "build", str(source), *options]
    done = subprocess.run(
        command,
        cwd=work,
        env={**os.environ, "PYTHONSAFEPATH": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    html = source / "_build" / "html"
    if done.returncode or not (html / "index.html").is_file():
        lines = COLOURS.sub("", done.stdout + done.stderr).splitlines()
        why = [line.replace(f"{source}/", "") for line in lines if SAYS.search(line)] or lines
        raise BookError("\n".join(["the book could not be built", *why[-LINES_SHOWN:]]))
    if log:
        log.write(COLOURS.sub("", done.stderr).replace(f"{source}/", ""))
    return html
