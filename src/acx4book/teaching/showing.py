"""Material for teachers: figures of the book, slides, and lab sheets with solutions."""

from __future__ import annotations

import base64
import io
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

import nbformat
import pandas as pd

from acx4book.teaching import flights
from acx4book.teaching.flights import Mistake, Rights, Sheet
from acx4book.teaching.grading import apart
from acx4book.teaching.sheets.every import SHEETS
from acx4book.typesetting import svg
from acx4book.typesetting.myst import MISSING, myst_table
from acx4book.typesetting.plain_text import Markup
from acx4book.typesetting.svg import inline

# --- the figures of the book, taken from its executed notebooks, and all of them in one archive


KINDS = {"image/svg+xml": "svg", "image/png": "png"}
"""Kinds of pictures in notebooks, the preferred one first, and their file endings."""

EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Date of all files in the archive, so that the same figures are the same bytes."""

LIST = "figures.txt"


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A figure of a chapter.

    Attributes
    ----------
    chapter : str
        Name of its notebook, such as ``foundations/1-image``.
    name : str
        Its label, such as ``fig-image-ray``.
    caption, alt : str
    kind : str
        ``svg`` or ``png``.
    content : bytes
    """

    chapter: str
    name: str
    caption: str
    alt: str
    kind: str
    content: bytes

    @property
    def file(self) -> str:
        """Name in the archive."""
        return f"{self.chapter}/{self.name}.{self.kind}"


def figures(executed: Path) -> Iterator[Figure]:
    """Yield the figures of all executed notebooks below a folder, by chapter and place."""
    for path in sorted(executed.rglob("*.ipynb")):
        chapter = path.relative_to(executed).with_suffix("").as_posix()
        notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call] # untyped
        for cell in notebook.cells:
            yield from _of_cell(chapter, cell)


def _of_cell(chapter: str, cell: Mapping[str, Any]) -> Iterator[Figure]:
    metadata = cell["metadata"].get("mystnb", {})
    name = metadata.get("figure", {}).get("name", "")
    for output in cell.get("outputs", []):
        kind = next((kind for kind in KINDS if kind in output.get("data", {})), None)
        if name and kind is not None:
            yield Figure(
                chapter=chapter,
                name=name,
                caption=" ".join(metadata["figure"]["caption"].split()),
                alt=metadata.get("image", {}).get("alt", ""),
                kind=KINDS[kind],
                content=_content(kind, output["data"][kind]),
            )


def _content(kind: str, data: str | Sequence[str]) -> bytes:
    text = data if isinstance(data, str) else "".join(data)
    return text.encode() if kind == "image/svg+xml" else base64.b64decode(text)


def archive(found: Sequence[Figure]) -> bytes:
    """Return a zip archive of figures with a list of their captions; the same bytes every time."""
    listed = "".join(f"{figure.file}\n    {figure.caption}\n" for figure in found)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as pack:
        for name, content in [
            (LIST, listed.encode()),
            *((figure.file, figure.content) for figure in found),
        ]:
            entry = zipfile.ZipInfo(name, date_time=EARLIEST)
            packed = zipfile.ZIP_STORED if name.endswith(".png") else zipfile.ZIP_DEFLATED
            pack.writestr(entry, content, compress_type=packed, compresslevel=9)
    return out.getvalue()


# --- the slides as a page of its own: a slide is a title, some sentences, a figure of the book


COLOURS = {name: colour for colour, name in svg.NAMES.items()}
NAMED = re.compile(r"var\(--figure-([\w-]+)\)")
"""Colours set by a page of the book; slides have fixed light colours."""

SLIDES = Path(__file__).with_name("slides.html")
"""Template of the slides; their Markdown lies beside it."""

ADDRESS = "../downloads/slides.html"
"""Address of the slides relative to the pages of the teaching kit."""


@dataclass(frozen=True, kw_only=True)
class Slide:
    """A slide.

    Attributes
    ----------
    title : str
    says : tuple of str
        Sentences, one a line.
    chapter, figure : str
        Of the figure; both empty where there is none.
    """

    title: str
    says: tuple[str, ...]
    chapter: str = ""
    figure: str = ""


NAMES_FIGURE = re.compile(r"\{(\S+) (\S+)\}")
"""A line of the slides that names a figure: its chapter and its name."""


def _blocks(text: str) -> list[list[Slide]]:
    """Return the slides of each block from their Markdown."""
    return [[*map(_slide, block.split("\n## ")[1:])] for block in f"\n{text}".split("\n---\n")]


def _slide(text: str) -> Slide:
    title, *lines = filter(None, text.splitlines())
    shown = NAMES_FIGURE.fullmatch(lines[-1])
    chapter, figure = shown.groups() if shown else ("", "")
    says = tuple(lines[:-1] if shown else lines)
    return Slide(title=title, says=says, chapter=chapter, figure=figure)


BLOCKS = _blocks(SLIDES.with_suffix(".md").read_text(encoding="utf-8"))
"""The slides of each of the five blocks of a course; all of them are one lecture."""

LECTURE = tuple(slide for block in BLOCKS for slide in block)


def links() -> Iterator[tuple[str, str]]:
    """Yield names and texts: links to the slides of every block, HTML without glossary links."""
    first = 1
    for number, block in enumerate(BLOCKS, 1):
        links = [
            f'<a href="{ADDRESS}#slide-{first + k}">{escape(slide.title)}</a>'
            for k, slide in enumerate(block)
        ]
        yield f"block-{number}-slides.md", f"<p><b>Slides.</b> {'; '.join(links)}.</p>\n"
        first += len(block)


def slides(found: Sequence[Figure], told: Sequence[Slide] = LECTURE) -> str:
    """Return slides as one self-contained HTML page.

    Parameters
    ----------
    found : sequence of Figure
        Figures of the book; a slide without its figure here shows its text alone.
    told : sequence of Slide
    """
    by_name = {(figure.chapter, figure.name): figure for figure in found}
    known: set[str] = set()
    sections = [
        _section(slide, by_name.get((slide.chapter, slide.figure)), f"s{k}-", known)
        for k, slide in enumerate(told)
    ]
    template = SLIDES.read_text(encoding="utf-8")
    return template.replace("<!-- slides -->", "\n".join(sections))


def _section(slide: Slide, figure: Figure | None, name: str, known: set[str]) -> str:
    lines = "".join(f"<p>{escape(line)}</p>" for line in slide.says)
    picture = "" if figure is None else _picture(figure, name, known)
    return f"<section><h1>{escape(slide.title)}</h1>{lines}{picture}</section>"


def _picture(figure: Figure, name: str, known: set[str]) -> str:
    """Return a drawing as HTML, with the glyphs not yet defined by drawings above it."""
    if figure.kind == "svg":
        drawn = inline(figure.content.decode(), alt=figure.alt, name=name, known=known)
        return NAMED.sub(lambda match: COLOURS[match[1]], drawn)
    data = base64.b64encode(figure.content).decode("ascii")
    return f'<img alt="{escape(figure.alt)}" src="data:image/{figure.kind};base64,{data}">'


# --- questions of the lab sheets, and their solutions for one demonstration student


STUDENT = "Demonstration"
KEY = b"the public key of the book's demonstration flights"
"""Anybody can compute the truth from this public key, so a class needs another."""


def texts() -> Iterator[tuple[str, str]]:
    """Yield names and texts: the questions of every sheet, and the solutions of all."""
    for sheet in SHEETS.values():
        yield f"{sheet.name}-questions.md", _questions(sheet)
        yield f"{sheet.name}-solution.md", _solution(sheet)


def _questions(sheet: Sheet) -> str:
    """Return the questions of a sheet as MyST text."""
    rows = [
        (
            Markup(f"`{q.name}`"),
            q.asks,
            q.unit or MISSING,
            q.digits,
            "yes" if q.with_sigma else MISSING,
        )
        for q in sheet.questions
    ]
    table = pd.DataFrame(rows, columns=["Name", "Question", "Unit", "Digits", "With σ"])
    caption = "What to hand in; digits are those after the decimal point"
    return myst_table(table, caption, name=f"tab-{sheet.name}")


def _solution(sheet: Sheet) -> str:
    """Return the solution of a sheet for the demonstration flight, with common mistakes."""
    case = flights.case_of(flights.flight_of(sheet, STUDENT, KEY))
    right = sheet.solve(case)
    facts = " ".join(sheet.given(case))
    answers = myst_table(
        _answers(sheet, right),
        f"Solution of {sheet.name} for the demonstration flight",
        name=f"tab-{sheet.name}-solution",
    )
    wrong = myst_table(
        _mistakes(sheet, right, [*sheet.mistakes(case, right)]),
        f"Mistakes on {sheet.name}, and a wrong answer by which each is known",
        name=f"tab-{sheet.name}-mistakes",
    )
    return f"{facts}\n\n{answers}\n\n{wrong}"


def _answers(sheet: Sheet, right: Rights) -> pd.DataFrame:
    """Tabulate the right answers."""
    rows = []
    for q in sheet.questions:
        answer = right[q.name]
        sigma = MISSING if answer.sigma is None else f"{answer.sigma:.{q.digits}f}"
        estimated = answer.sigma is not None
        true = f"{answer.truth:.{q.digits}f}" if estimated else MISSING
        value = f"{answer.value:.{q.digits}f}"
        rows.append((Markup(f"`{q.name}`"), value, sigma, true, q.unit or MISSING))
    return pd.DataFrame(rows, columns=["Name", "Right answer", "σ", "Truth", "Unit"])


def _mistakes(sheet: Sheet, right: Rights, mistakes: Sequence[Mistake]) -> pd.DataFrame:
    """Tabulate each mistake with its most changed answer, relative to the accepted bound."""
    rows = []
    for mistake in mistakes:
        deviations = [
            (apart(name, value, right[name].truth) / right[name].bound, name, value)
            for name, value in mistake.gives.items()
        ]
        deviation, name, value = max(deviations, default=(0.0, "", 0.0))
        if deviation > 1.0:
            q = next(q for q in sheet.questions if q.name == name)
            wrong = f"{value:.{q.digits}f}" if round(value, q.digits) else f"{value:.2g}"
            pair = (f"{right[name].value:.{q.digits}f}", wrong)
            rows.append((mistake.says, Markup(f"`{name}`"), *pair))
        elif mistake.gives_sigma:
            name, sigma = next(iter(mistake.gives_sigma.items()))
            pair = (f"{right[name].sigma:.2g}", f"{sigma:.2g}")
            rows.append((mistake.says, Markup(f"σ of `{name}`"), *pair))
    return pd.DataFrame(rows, columns=["Mistake", "For example", "Right", "Wrong"])
