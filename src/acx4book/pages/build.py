"""The files that a book is built from: ``_executed`` and ``_generated``.

Executed notebooks of the stages are copied, with the code of cells with output folded; a stage
without data gets a page that says so. Notebooks on the results of a run are run here; chapters
that depend on no flight come from the cache of `study`, or are left out. Texts and figures for the
other pages are written.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import pkgutil
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd

from acx4book.chapters import flight
from acx4book.notebook import ENDS
from acx4book.notebooks import execute, runner
from acx4book.pages import frames, release, reproducibility, study
from acx4book.pages.benchmarks import sigma, speed, verdicts
from acx4book.paper import printed, questions, scorecard
from acx4book.report import findings, material, page, verdict
from acx4book.report.material import Material
from acx4book.teaching import solutions
from acx4book.typesetting.myst import myst_table, numbered
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.svg import vector
from acx4files.flight.reader import Flight
from acx4files.results import folder as results
from acx4files.results import provenance, whole_files
from acx4files.results.folder import NOTEBOOKS
from acx4files.results.provenance import KEPT
from acx4sim.files import truth_path

BENCHMARKS = Path("data", "benchmarks")
"""Results of long runs, below the current folder: that of the working copy."""

STORED: Mapping[str, str] = {
    "tab-cost": "closed_chain",
    "fig-cost": "closed_chain",
    "tab-quality-models": "closed_chain",
    **dict.fromkeys(("tab-coverage", "fig-coverage"), "coverage"),
    "tab-verdicts-": "verdicts",
    "tab-coverage-slow": "slow_errors",
    "tab-speed-commands": "commands",
}
"""What begins the labels of tables and figures made of stored numbers, and the file with their
commit below `BENCHMARKS`; of several beginnings the longest counts."""

FRONT = "```{{figure}} _generated/front.svg\n:alt: {alt}\n:width: 100%\n\n{caption}\n```\n"

RUN_PAGES = ("first-flight", "library", "your-files")
"""Pages with code to be run; its output is shown."""

WRAPPED = ("your-files",)
"""Pages among them with sentences as output, not tables: long lines are wrapped."""

HEADING = re.compile(r"#+(?= )")
"""Beginning of a cell with a heading."""

INTRODUCES = "introduces"
"""Tag of a cell that introduces the figure of the next cell."""

REPORT = Path("downloads", "report.html")
"""The report, copied into the built book unchanged."""

DOWNLOADED = Path("downloads", "notebooks")
"""Folder of the notebooks without outputs in the built book."""

OF_RESULTS = ("06-errata",)
"""Notebooks on the results of a run that ``acx4 run`` does not execute."""

OWN = "template/study"
"""The template of a reader's own chapter: it adjusts the flight of the run."""

OF_IDEAL = ("mounting", "validation")
"""Stages shown from the run of the ideal synthetic camera, if there is one."""

FOLDED = {"parameters", "injected-parameters"}
"""Tags of cells whose code is folded."""

IDEAL = (
    ":::{note}\nThis page is computed from the simulated flight `acx4-ideal`: that of the other "
    "pages, but with synthetic images that one ideal camera took. What the images that are made of "
    "four heads give instead stands beside the printed numbers in {doc}`12-synthetic-cost`.\n:::"
)
"""Note under the introduction of these pages."""

SIMULATED = (
    ":::{note}\nThe flight of this page is simulated. {doc}`/reproducibility` has what it was "
    "given.\n:::"
)
"""Note on other pages of a simulated flight."""


def fill(flight_path: Path, results_path: Path, book: Path, ideal_path: Path | None = None) -> None:
    """Write the files that the pages of the book are made of.

    Parameters
    ----------
    flight_path, results_path : Path
        A flight and its run.
    book : Path
        Folder of the book; the current folder is the working copy that it belongs to.
    ideal_path : Path, optional
        Run of the design acx4-ideal, of which stages mounting and validation are done; only where
        the flight is the one that ships. Then the chapters that depend on no flight are run, too,
        and the book has the pages of the programming interface.

    Raises
    ------
    Acx4Error
        If results were changed since their run, or a notebook fails.
    """
    for path in (results_path, *([] if ideal_path is None else [ideal_path])):
        provenance.read_run(path)
    executed, generated = book / "_executed", book / "_generated"
    for folder in (executed, generated):
        folder.mkdir(exist_ok=True)
    with ProcessPoolExecutor(1) as meanwhile:
        running = meanwhile.submit(_write_beside, results_path, book)
        _write_notebooks(results_path, executed, ideal_path, pictures_path=flight_path)
        _write_of_run(flight_path, results_path, book, ideal_path)
        running.result()
    whole_files.write(generated / "program.md", release.program(generated / "acx4lib.zip"))


def _write_beside(results_path: Path, book: Path) -> None:
    """Write what needs no notebook that is run here: report, comparisons, examples."""
    generated = book / "_generated"
    errors = sigma.read(BENCHMARKS)
    whole_files.write(generated / "coverage.svg", vector(sigma.normalised_errors(errors)))
    frames.draw(generated)
    _bring_notebooks(generated / DOWNLOADED)
    page.write(results_path, generated / REPORT)
    for name, text in (
        *_texts_of_benchmarks(errors),
        *solutions.texts(),
        *_texts_of_back_matter(),
        *_texts_of_examples(book),
    ):
        whole_files.write(generated / name, text)


def _bring_notebooks(folder: Path) -> None:
    """Copy the notebooks that are pages."""
    for pattern in ("*.ipynb", "foundations/*.ipynb", f"{OWN}.ipynb"):
        for source in runner.NOTEBOOKS_PATH.glob(pattern):
            path = folder / source.relative_to(runner.NOTEBOOKS_PATH)
            path.parent.mkdir(parents=True, exist_ok=True)
            whole_files.copy(source, path)


def _write_of_run(
    flight_path: Path, results_path: Path, book: Path, ideal_path: Path | None
) -> None:
    """Write what shows the run and the chapters, which are brought here."""
    executed, generated = book / "_executed", book / "_generated"
    left_out = study.bring(executed, ideal_path)
    whole = ideal_path is not None
    # The code of part I is part of what it teaches.
    for name in study.CHAPTERS.keys() - {*left_out, *study.FOUNDATIONS}:
        note = IDEAL if name in study.OF_IDEAL else ""
        fold(executed / f"{name}.ipynb", executed / f"{name}.ipynb", note)
    pages = [f"_executed/{name}" for name in left_out]
    study.leave_out(book, pages if whole else [*pages, API])
    for name, text in (
        *_texts_of_run(flight_path, results_path, ideal_path),
        *_texts_of_front(flight_path, results_path, executed, ideal_path),
    ):
        whole_files.write(generated / name, text)
    made_from = _made_from(flight_path, ideal=whole, simulated=_run(results_path)[1].simulated)
    whole_files.write(generated / "made_from.json", json.dumps(made_from, indent=1))
    write_api(book)


# --- notebooks -------------------------------------------------------------------------------


def _write_notebooks(
    results_path: Path,
    executed: Path,
    ideal_path: Path | None = None,
    *,
    pictures_path: Path | None = None,
) -> None:
    """Write a page for every notebook: those of the run, and `OF_RESULTS`, executed here.

    If there is a run of an ideal camera, the pages of `OF_IDEAL` show it, with a note.
    """
    simulated = SIMULATED if _run(results_path)[1].simulated else ""
    for stage, name in NOTEBOOKS.items():
        of_ideal = ideal_path is not None and stage in OF_IDEAL
        run = ideal_path if ideal_path is not None and of_ideal else results_path
        done = run / "notebooks" / f"{name}.ipynb"
        if done.is_file():
            fold(done, executed / done.name, note=IDEAL if of_ideal else simulated)
        else:
            heading = title(runner.NOTEBOOKS_PATH / done.name)
            text = f"{heading}\n\nThis flight has no data for this stage.\n"
            whole_files.write(executed / f"{name}.md", text)
    for name in OF_RESULTS:
        run_here(name, executed, {"results_path": str(results_path)})
    run_path = ideal_path or results_path
    places = {"flight_path": str(run_path / KEPT), "results_path": str(run_path)}
    if ideal_path is None and pictures_path is not None:
        places["pictures_path"] = str(pictures_path)
    run_here(OWN, executed, places)


def run_here(name: str, executed: Path, given: Mapping[str, str], note: str = "") -> None:
    """Run a notebook, and write it as a page."""
    source, page = runner.NOTEBOOKS_PATH / f"{name}.ipynb", executed / f"{name}.ipynb"
    execute.execute(source, page, parameters=given)
    fold(page, page, note)


def _made_from(flight_path: Path, *, ideal: bool, simulated: bool = False) -> dict[str, Any]:
    """Return the content for the book's extension `provenance`: commit, and flights by page."""
    name = f"{flight_path.name}{', simulated' if simulated else ''}"
    named = dict.fromkeys((*NOTEBOOKS.values(), *OF_RESULTS, OWN, "scorecard", "certificate"), name)
    shows_ideal = [*(NOTEBOOKS[stage] for stage in OF_IDEAL), *study.OF_IDEAL, OWN]
    of_ideal = dict.fromkeys(shows_ideal if ideal else (), "acx4-ideal, simulated")
    return {
        "commit": reproducibility.short(reproducibility.commit()),
        "flights": {**named, **of_ideal},
        "stored": {label: _commit_of(name) for label, name in STORED.items()},
    }


def _commit_of(name: str) -> str:
    """Return the commit of the stored numbers of a long run, as the lines under tables tell it."""
    about = json.loads((BENCHMARKS / f"{name}.json").read_text("utf-8"))
    return reproducibility.of_stored(about["commit"])


def fold(executed: Path, page: Path, note: str = "") -> None:
    """Write an executed notebook as a page.

    Tables get the captions and names that the metadata of their cells have. Imports and parameters
    are folded, and of sentences with numbers there is no code. Where the method does not stand in
    the cells, the code of those that show something is folded. A note stands under the first cell.
    A section of which the flight has nothing is left out, and so are a figure of which nothing came
    and what introduces it. Where the notebook ended early, the page ends, below an answer without
    a word.
    """
    notebook = _read(executed)
    notebook.cells = _with_content(notebook.cells[: _end(notebook)])
    if note:
        notebook.cells[0].source += f"\n\n{note}"
    opened = any("acx4" in cell.metadata for cell in notebook.cells)
    for cell in notebook.cells:
        tags = cell.metadata.get("tags", [])
        if cell.cell_type != "code":
            continue
        _number_tables(cell)
        if "mystnb" in cell.metadata and not cell.outputs:
            cell.metadata["tags"] = [*tags, "remove-cell"]
        elif not opened:
            if cell.outputs and not {"hide-input", "remove-input"} & {*tags}:
                cell.metadata["tags"] = [*tags, "hide-input"]
        elif "hide-input" in tags and not FOLDED & {*tags} and "notebook.begin(" not in cell.source:
            hidden = "remove-input" if cell.outputs else "remove-cell"
            cell.metadata["tags"] = [*(tag for tag in tags if tag != "hide-input"), hidden]
    text: str = nbformat.writes(notebook)  # type: ignore[no-untyped-call] # untyped
    whole_files.write(page, text)


def _end(notebook: nbformat.NotebookNode) -> int:
    """Return the number of cells on the page: all, or up to an early end of the notebook."""
    shown = [
        "".join(o.get("data", {}).get("text/markdown", "") for o in cell.get("outputs", []))
        for cell in notebook.cells
    ]
    end = next((i for i, text in enumerate(shown) if text.startswith(ENDS)), len(shown))
    answered = any("answer" in cell.metadata.get("tags", []) for cell in notebook.cells[:end])
    return end if answered else end + 1


def _with_content(cells: list[nbformat.NotebookNode]) -> list[nbformat.NotebookNode]:
    """Return the cells of a page without empty sections."""
    levels = [_level(cell) for cell in cells]
    removed = set[int]()
    for first, level in enumerate(levels):
        later = range(first + 1, len(cells))
        last = next((i for i in later if 0 < levels[i] <= level), len(cells))
        section = [cell for cell in cells[first:last] if cell.cell_type == "code"]
        outputs_expected = [cell for cell in section if _is_meant_to_show(cell)]
        if level > 1 and outputs_expected and not any(_shows(cell) for cell in section):
            removed |= {*range(first, last)}
        elif INTRODUCES in cells[first].metadata.get("tags", []) and not _shows(cells[first + 1]):
            removed.add(first)
    return [cell for i, cell in enumerate(cells) if i not in removed]


def _level(cell: nbformat.NotebookNode) -> int:
    """Return the level of the heading at the beginning of a cell, 0 for none."""
    match = HEADING.match(cell.source) if cell.cell_type == "markdown" else None
    return len(match[0]) if match else 0


def _is_meant_to_show(cell: nbformat.NotebookNode) -> bool:
    """Tell whether a cell has a caption, or is a sentence with numbers."""
    return bool({"mystnb", "acx4"} & cell.metadata.keys()) or "say(" in cell.source


def _shows(cell: nbformat.NotebookNode) -> bool:
    """Tell whether a cell has output; for a cell with a figure, a picture."""
    shown = [output.get("data", {}) for output in cell.get("outputs", [])]
    if "figure" in cell.metadata.get("mystnb", {}):
        return any(kind.startswith("image/") for data in shown for kind in data)
    return any(data.get("text/markdown", " ") != "" for data in shown)


def _number_tables(cell: nbformat.NotebookNode) -> None:
    """Convert the tables of a cell to Markdown, with caption and name from its metadata.

    An empty sentence is left out. A sentence in the place of a figure has no caption.
    """
    labels = cell.metadata.get("acx4", {})
    if not _shows(cell):
        cell.metadata.get("mystnb", {}).pop("figure", None)
    cell.outputs = [o for o in cell.outputs if o.get("data", {}).get("text/markdown") != ""]
    for output in cell.outputs:
        data = output.get("data", {})
        if not {"text/html", "text/markdown"} <= data.keys():
            continue
        del data["text/html"]
        if labels:
            data["text/markdown"] = numbered(
                data["text/markdown"], labels["caption"], labels["name"]
            )


def title(notebook: Path) -> str:
    """Return the title of a notebook, as Markdown."""
    heading: str = _read(notebook).cells[0].source.splitlines()[0]
    return heading


def _read(notebook: Path) -> nbformat.NotebookNode:
    read: nbformat.NotebookNode = nbformat.read(notebook, as_version=4)  # type: ignore[no-untyped-call] # untyped
    return read


# --- texts and figures -----------------------------------------------------------------------


def _texts_of_run(
    flight_path: Path, results_path: Path, ideal_path: Path | None = None
) -> Iterator[tuple[str, str]]:
    """Yield names and texts: scorecard, certificate, simulation, geometry, provenance."""
    run, flown = _run(results_path)
    ideal = None if ideal_path is None else _run(ideal_path)
    truth = _truth(flight_path)
    simulated = truth is not None
    yield from scorecard.texts(run, flown, simulated=simulated, ideal=ideal).items()
    yield "certificate.md", certificate_page(material.read(results_path), REPORT.as_posix())
    yield "simulation.md", study.simulation_page(flown, truth)
    yield "geometry.md", study.geometry_page()
    yield "provenance.md", reproducibility.page(flight_path, results_path)


def _truth(flight_path: Path) -> dict[str, Any] | None:
    """Return what a simulated flight was given; None for another one."""
    path = truth_path(flight_path)
    return json.loads(path.read_text("utf-8")) if path.is_file() else None


def _texts_of_front(
    flight_path: Path, results_path: Path, executed: Path, ideal_path: Path | None = None
) -> Iterator[tuple[str, str]]:
    """Yield names and texts, and a drawing, of the front page and of the four questions."""
    book_run, flown = _run(results_path)
    drawn = flight.exposure(flown)
    yield "front.svg", vector(drawn)
    yield "front.md", FRONT.format(alt=flight.ALT, caption=flight.caption(flown))
    applies = printed.applies(flown)
    notebooks = executed if ideal_path is None else results_path / "notebooks"
    true = (_truth(flight_path) or {}).get("cameras", {})
    answered = questions.answers(notebooks)
    four, ideal = questions.Told(found=book_run, answers=answered, truth=true), None
    if ideal_path is not None:
        answers = questions.answers(ideal_path / "notebooks")
        ideal = questions.Told(found=results.read(ideal_path), answers=answers)
    camera = flown.synthetic.camera if flown.synthetic else ""
    methods = "" if ideal is None else study.methods_page(ideal.found, camera, BENCHMARKS)
    yield "methods.md", f"{methods}\n"
    ideal_answers = None if ideal is None else ideal.answers
    many = "" if ideal is None else study.many(BENCHMARKS)
    asked = questions.text(four.answers, ideal_answers, beside_print=applies, many=many)
    yield "four-questions.md", asked
    runs = {"this book" if ideal is None else "four heads": book_run}
    if ideal is not None:
        runs["ideal camera"] = ideal.found
    needed = {"mounting/single_step", "mounting/two_step_gnss"}
    has_both = all(needed <= run.summary.keys() for run in runs.values())
    table = questions.small_table_3(runs, camera) if applies and has_both else ""
    yield "front-table.md", f"{table}\n"
    whole = applies and has_both and "validation/single_step" in book_run.summary
    spread = "" if ideal is None else study.spread(BENCHMARKS)
    beside = questions.side_by_side(four, ideal, camera, spread) if whole else "\n"
    yield "side-by-side.md", beside
    yield "front-accuracy.md", study.page(BENCHMARKS) if ideal_path is not None else "\n"


def _run(results_path: Path) -> tuple[results.Results, Flight]:
    run = provenance.read_run(results_path)
    return run.found, run.flight


def _texts_of_benchmarks(errors: sigma.Errors) -> Iterator[tuple[str, str]]:
    """Yield names and texts: speed, messages of imports, errors over standard deviations."""

    def stored(name: str, *parts: str) -> pd.DataFrame:
        return sigma.read_stored(BENCHMARKS, name, *parts, make="coverage")[1][0]

    yield "speed.md", speed.text(BENCHMARKS)
    yield from speed.of_imports(BENCHMARKS)
    yield "coverage.md", sigma.page(errors)
    yield "coverage-shares.md", sigma.shares(errors)
    yield "coverage-found.md", sigma.found(errors)
    yield "coverage-bias.md", sigma.bias_page(stored("coverage", "bias"))
    yield "coverage-slow.md", verdicts.slow_errors(stored("slow_errors"))
    yield "coverage-validated.md", verdicts.validated(stored("slow_validations"))
    yield "coverage-held.md", verdicts.held(stored("held_values"))
    reports = verdicts.read(BENCHMARKS)
    yield "coverage-good.md", verdicts.good(reports)
    yield "coverage-spoilt.md", verdicts.spoilt(reports)


def _texts_of_examples(book: Path) -> list[tuple[str, str]]:
    """Run the code on pages, and return names and texts of its outputs."""
    texts = []
    for name in RUN_PAGES:
        page = (book / f"{name}.md").read_text(encoding="utf-8")
        for number, output in enumerate(outputs(page), 1):
            text = speed.wrapped(output) if name in WRAPPED else output
            texts.append((f"{name}-{number}.txt", text))
    return texts


def _texts_of_back_matter() -> Iterator[tuple[str, str]]:
    """Yield names and texts made from the project's own files in the current folder."""
    yield "citation.json", json.dumps(reproducibility.footer(Path("CITATION.cff")))
    yield "cite.md", reproducibility.sentence(Path("CITATION.cff"))
    yield "licences.md", reproducibility.licences_page()


# --- the page on the certificate of a run, which leads to the report itself


def certificate_page(run: Material, report: str) -> str:
    """Return the statement, the report's address and the findings, as MyST text below the title.

    Parameters
    ----------
    run : Material
    report : str
        Address of the report beside the page; the same as JSON has the ending .json.
    """
    answers = findings.findings(run)
    told = verdict.statement(answers)
    columns = {"question": "Question", "result": "Result", "p": "p joint", "answer": "Answer"}
    table = pd.DataFrame([*verdict.rows(answers)])[[*columns]].rename(columns=columns)
    json = f"{report.removesuffix('.html')}.json"
    return "\n\n".join(
        [
            "*Can this calibration be used?*",
            f"**{told['title']}.**",
            *(shown(sentence) for sentence in told["sentences"]),
            f'<a href="{report}">Open the report</a>, one file to print and to keep. Beside it '
            f'lies the same as <a href="{json}">JSON</a>.',
            myst_table(table, "Findings", name="tab-findings"),
            "",
        ]
    )


# --- the code of a page, run from top to bottom, and what it prints


FENCE = re.compile(r"^```(python|shell)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)

ACX4 = (sys.executable, "-c", "from acx4book.command.acx4 import main; main()")
"""The command of this installation, whatever the path of programs has."""

COLUMNS = "78"
"""Width of the terminal for commands, so that their lines fit on the page."""


def outputs(page: str) -> Iterator[str]:
    """Run the code of a page piece by piece, in an empty folder; yield the output of each.

    Parameters
    ----------
    page : str
        Its fences of ``python`` and ``shell`` are run, those of ``bash`` are not.
    """
    names: dict[str, object] = {"__name__": "example"}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for number, (language, code) in enumerate(FENCE.findall(page), 1):
            if language == "shell":
                yield "".join(_printed(line) for line in code.splitlines())
                continue
            stdout = io.StringIO()
            with contextlib.redirect_stdout(stdout):
                exec(compile(code, f"<piece {number} of the page>", "exec"), names)
            yield stdout.getvalue()


def _printed(line: str) -> str:
    """Run a command line that begins with ``acx4``, and return its output."""
    arguments = shlex.split(line)[1:]
    narrow = os.environ | {"COLUMNS": COLUMNS}
    done = subprocess.run(
        [*ACX4, *arguments], capture_output=True, text=True, check=True, env=narrow
    )
    return done.stdout


# --- the pages of the programming interface: one for each house, and one for each of its rooms


API = "_generated/api"
"""Folder of the pages in the book."""

CELLAR = "compiled"
"""Name of the folders without pages."""

EXCHANGE = ("metadata", "outward", "pictures", "programs", "safe", "trajectories")
BY_MODULE = tuple(f"acx4files.exchange.{part}" for part in EXCHANGE)
"""Modules listed by their docstring alone: their functions serve one kind of files, and no user's
program calls them."""


def write_api(book: Path) -> None:
    """Write the pages of the interface that the table of contents lists."""
    folder = book / API
    contents = (book / "_generated" / "_toc.yml").read_text("utf-8")
    listed = re.findall(rf"{API}/([\w/]+)", contents)
    for file in listed:
        path = folder / f"{file}.md"
        path.parent.mkdir(parents=True, exist_ok=True)
        rooms = [other.replace("/", ".") for other in listed if other.startswith(f"{file}/")]
        whole_files.write(path, "\n".join(_api_page(file.replace("/", "."), rooms)))


def _api_page(name: str, rooms: Sequence[str] = ()) -> Iterator[str]:
    """Yield the parts of the page of a house or a room, in MyST; rooms have pages of their own."""
    yield f"# {name.rpartition('.')[2]}\n"
    if not hasattr(import_module(name), "__path__"):  # a room of one file
        yield _directive("automodule", name)
        return
    yield _directive("automodule", name, ":no-members:")
    inside = [other for other in _contents(name) if other not in rooms]
    yield _summary(name, [*rooms, *inside])
    for other in inside:
        yield from _section(other, 2)


def _contents(package: str) -> list[str]:
    """Return the modules and rooms of a package, in the order of its docstring."""
    about = import_module(package)
    named = re.findall(r"`([\w.]+)`", about.__doc__ or "")
    names = [m.name for m in pkgutil.iter_modules(about.__path__)]
    shown = [name for name in names if name != CELLAR and not name.startswith("_")]
    shown.sort(key=lambda name: named.index(name) if name in named else len(named))
    return [f"{package}.{name}" for name in shown]


def _section(name: str, level: int) -> Iterator[str]:
    yield f"{'#' * level} {name.rpartition('.')[2]}\n"
    if not hasattr(import_module(name), "__path__"):
        yield _directive("automodule", name, *[":no-members:"] * name.startswith(BY_MODULE))
        return
    yield _directive("automodule", name, ":no-members:")
    yield _summary(name, _contents(name))
    for other in _contents(name):
        yield from _section(other, level + 1)


def _summary(package: str, names: Sequence[str]) -> str:
    """Return a table of a package's modules, with the first sentences of their docstrings."""
    inside = (name.removeprefix(f"{package}.") for name in names)
    return _directive("autosummary", "", "", *inside)


def _directive(directive: str, argument: str, *lines: str) -> str:
    body = "".join(f"   {line}\n" for line in lines)
    return f"```{{eval-rst}}\n.. {directive}:: {argument}\n{body}```\n"
