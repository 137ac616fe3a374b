"""The report as files: one page of HTML without external files, JSON, and a PDF."""

from __future__ import annotations

import base64
import errno
import html
import re
import tempfile
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path

from acx4book.report.material import Material, read
from acx4book.report.page import record
from acx4book.report.page.contents import TEXT, Part, computed, parts
from acx4book.report.page.markdown import Document, number_labels, table_labels, to_html
from acx4book.report.page.printing import chromium, printed
from acx4book.report.shown import Text
from acx4book.report.verdict import verdict
from acx4book.typesetting.drawing.svg import vector
from acx4book.typesetting.plain_text import shown
from acx4lib.errors import OutputError
from acx4lib.flight.text.files import text_of
from acx4lib.results.own_folder import whole_files
from acx4lib.results.own_folder.places import check_file
from acx4lib.results.own_folder.whole_files import SCRATCH

MARK = b'<meta name="generator" content="acx4'
"""Mark of a report, which may be replaced by a newer one."""

PDF_TITLE = "Calibration report by acx4"
PDF_MARK = f"({PDF_TITLE})".encode()
"""Mark of a printed report: its title, which Chromium writes as it is where it is ASCII."""

TITLE = re.compile(r"<title>.*?</title>", re.DOTALL)

STYLE = resources.files("acx4book.report.page") / "report.css"

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="acx4 report">
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
    """Check that the report `out` may be printed into the file beside it.

    Raises
    ------
    OutputError
        Where the file must not be replaced.
    """
    check_file(Path(out).with_suffix(".pdf"), mark=PDF_MARK, what="a report of acx4")


def write_pdf(out: str | Path) -> Path:
    """Print the report `out` into a PDF beside it, and return the place of this.

    Raises
    ------
    OutputError, PrintError
        As `check_pdf`, and where Chromium is missing or does not print it.
    """
    out = Path(out)
    check_pdf(out)
    browser = chromium()
    place = out.with_suffix(".pdf")
    text = TITLE.sub(f"<title>{PDF_TITLE}</title>", text_of(out), count=1)
    with (
        whole_files.appearing(place) as made,
        tempfile.TemporaryDirectory(dir=out.parent, prefix=SCRATCH) as temporary,
    ):
        whole = Path(temporary) / "report.html"
        whole_files.write(whole, text)
        printed(browser, whole, made)
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
