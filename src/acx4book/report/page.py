"""The report as one document: a page of HTML, the same as JSON, and as PDF/A."""

from __future__ import annotations

import base64
import errno
import html
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path

from matplotlib.figure import Figure
from threadpoolctl import threadpool_limits

from acx4book.report import (
    adjustment,
    ground,
    identity,
    mounting,
    parameters,
    record,
    typeset,
    verdict,
    words,
)
from acx4book.report.findings import Finding
from acx4book.report.markdown import Document, number_labels, table_labels, to_html
from acx4book.report.material import Material, checked_points, read
from acx4book.report.words import Text
from acx4book.typesetting import maps, matrix
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.svg import vector
from acx4lib.errors import OutputError
from acx4lib.opening import text_of
from acx4lib.results import whole_files
from acx4lib.results.own_folder import check_file

# --- The report as files: one page of HTML without external files, JSON, and a PDF/A


MARK = b'<meta name="generator" content="acx4'
"""Mark of a report, which may be replaced by a newer one."""

PDF_MARK = b"/Title(Calibration report)"
"""Mark of a PDF of a report: its heading among the bookmarks, with which the file begins."""

STYLE = resources.files("acx4book.report") / "report.css"

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="acx4 report">
<meta name="dcterms.date" content="{day}">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<p class="kind">In-flight camera calibration</p>
{heading}
<p class="name">{name}</p>
<p class="date">{date}</p>
</header>
<main>
<section class="certificate">
{certificate}
<table class="signatures">
<tr><td>Prepared by</td><td>Checked by</td><td>Place and date, signature</td></tr>
</table>
</section>
{body}
</main>
</body>
</html>
"""


def write(
    folder: str | Path,
    out: str | Path,
    *,
    on_part: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write the calibration report of a run as one HTML file, and beside it as JSON.

    Both are written completely or not at all.

    Parameters
    ----------
    folder : path
        Results of a run.
    out : path
        The page; an existing report is replaced, any other existing file is not. The other file has
        the ending .json.
    on_part : callable
        Called with the number of finished parts, and of all parts.

    Raises
    ------
    FlightError
        Where the results are missing, not complete, or do not belong together.
    OutputError
        Where the file must not be replaced by a report, or there is no space for it.
    OSError
        Where the file cannot be written otherwise.
    """
    out = Path(out)
    _check_places(out)
    run = read(folder)
    found = verdict.findings(run)
    shown = parts(TEXT.read_text(encoding="utf-8"), computed(run, found), on_part)
    texts = page([*shown], run), record.text(run, found)
    _check_places(out)  # again, as some seconds have passed
    whole_files.write_all(dict(zip((out, out.with_suffix(".json")), texts, strict=True)))


def _check_places(out: Path) -> None:
    """Check that the page and what stands beside it may be written."""
    if not out.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(out.parent))
    if out.suffix in (".json", ".pdf"):
        msg = f"{out}: name the page, such as {out.with_suffix('.html').name}"
        raise OutputError(f"{msg}; JSON and PDF stand beside it")
    check_file(out, mark=MARK, what="a report of acx4")
    check_file(out.with_suffix(".json"), mark=record.MARK, what="a report of acx4")


def check_pdf(out: str | Path) -> None:
    """Check that the report `out` may be set into the file beside it.

    Raises
    ------
    OutputError
        Where the file must not be replaced.
    """
    check_file(Path(out).with_suffix(".pdf"), mark=PDF_MARK, what="a report of acx4")


def write_pdf(out: str | Path) -> Path:
    """Typeset the report `out` as a PDF/A beside it, and return the place of this.

    Raises
    ------
    OutputError, TypesetError
        As `check_pdf`, and where the package typst is missing.
    """
    out = Path(out)
    check_pdf(out)
    place = out.with_suffix(".pdf")
    whole_files.write(place, typeset.pdf(text_of(out)))
    return place


def page(parts: Sequence[Part], material: Material) -> str:
    """Return the parts of a report as a page: text, tables and figures, no code.

    Parameters
    ----------
    parts : sequence of Part
        The heading comes first.
    material : Material
        Material from the same results; the heading of the page has their name.
    """
    document = Document(numbers=number_labels([name for part in parts for name in _labels(part)]))
    rendered = [_rendered(part, document) for part in parts]
    heading, _, first = rendered[0].partition("</h1>")
    sections = [i for i, part in enumerate(rendered) if part.startswith("<h2")]
    body = sections[1] if len(sections) > 1 else len(rendered)
    return PAGE.format(
        title=shown(f"Calibration report: {material.flight.name}", "html"),
        style=STYLE.read_text(encoding="utf-8"),
        heading=f"{heading}</h1>",
        name=shown(material.flight.name, "html"),
        date=f"{material.date.day} {material.date:%B %Y}",
        day=f"{material.date:%Y-%m-%d}",
        certificate="\n".join(rendered[1:body]),
        body="\n".join([first, *rendered[body:]]),
    )


def _labels(part: Part) -> list[str]:
    if isinstance(part.content, Text):
        return table_labels(part.content.markdown)
    return [part.name]


def _rendered(part: Part, document: Document) -> str:
    if isinstance(part.content, Text):
        return to_html(part.content.markdown, document)
    document.n_figures += 1
    data = base64.b64encode(vector(part.content).encode()).decode()
    caption = to_html(part.caption, document).strip()
    caption = caption.removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(part.name)}">\n'
        f'<img alt="{html.escape(part.alt)}" src="data:image/svg+xml;base64,{data}">\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )


# --- The parts of the report in their order: what ``report.md`` says, and what is computed for it
#
# A computed part stands in that file as a directive with the name that it has here, ``section``
# with tables, or ``figure`` with a caption and the words in the figure's place.


TEXT = resources.files("acx4book.report") / "report.md"

DIRECTIVE = re.compile(
    r"^```\{(?:section|figure)\} (?P<name>\w+)\n(?::alt: (?P<alt>[^\n]*)\n)?"
    r"\s*(?P<caption>.*?)\s*```$",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of the report.

    Attributes
    ----------
    content : Text or Figure
    name, caption, alt : str
        Of a figure: its label, its caption, and words in its place.
    """

    content: Text | Figure
    name: str = ""
    caption: str = ""
    alt: str = ""


def computed(run: Material, found: Sequence[Finding]) -> dict[str, Callable[[], Text | Figure]]:
    """Return what computes each part, by the name that the text has for it.

    Parameters
    ----------
    run : Material
    found : sequence of Finding
        Of this run.
    """
    planes = cache(lambda: {**words.planes(run, "mounting"), **words.planes(run, "heads")})
    mapped = cache(lambda: ground.mapped(run))
    return {
        "certificate": lambda: identity.first_page(run, found),
        "statement": lambda: verdict.section(found),
        "identity": lambda: identity.identity(run),
        "method": lambda: identity.method_and_data(run),
        "blocks": lambda: maps.block_maps(*identity.mapped(run)),
        "adjustment": lambda: adjustment.section(run),
        "parameters": lambda: parameters.section(run),
        "correlations": lambda: matrix.correlation_matrix(words.correlation_picture(run)),
        "image": lambda: parameters.image_figure(run),
        "distortion": lambda: parameters.image_section(run),
        "plane": lambda: adjustment.residual_plane(planes(), run.flight.cameras),
        "strips": lambda: adjustment.residuals_by_strip(planes()),
        "mounting": lambda: mounting.section(run),
        "boresight": lambda: mounting.boresight_over_time(mounting.boresights(run)),
        "check": lambda: ground.check_points(checked_points(run)),
        "ground": lambda: ground.check_points_section(run),
        "budget": lambda: ground.section(mapped()),
        "format": lambda: ground.over_format(mapped()),
    }


def parts(
    text: str,
    by_name: Mapping[str, Callable[[], Text | Figure]],
    on_part: Callable[[int, int], None],
) -> Iterator[Part]:
    """Yield the texts and what is computed between them, in their order.

    Parameters
    ----------
    text : str
        Markdown with directives, see above.
    by_name : mapping
        As of `computed`.
    on_part : callable
        Called with the number of finished parts, and of all that are computed.

    Raises
    ------
    KeyError
        Where the text names a part that nothing computes.
    Exception
        Whatever a part raises.
    """
    directives, done = [*DIRECTIVE.finditer(text)], 0
    with threadpool_limits(1, user_api="blas"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as a page shows none
        for number, directive in enumerate(directives):
            on_part(number, len(directives))
            yield from _text(text[done : directive.start()])
            name, done = directive["name"], directive.end()
            told = {"caption": directive["caption"], "alt": directive["alt"] or ""}
            yield Part(content=by_name[name](), name=f"fig-report-{name}", **told)
        yield from _text(text[done:])
    on_part(len(directives), len(directives))


def _text(text: str) -> Iterator[Part]:
    """Yield a text, divided before its headings."""
    for one in re.split(r"(?m)^(?=## )", text):
        if one.strip():
            yield Part(content=Text(one.strip()))
