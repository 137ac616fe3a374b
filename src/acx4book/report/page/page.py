"""One HTML file of the report's notebook: small, printable on A4, without external files."""

from __future__ import annotations

import base64
import errno
import html
import tempfile
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.report.material import Material
from acx4book.report.page.cells import Part, parts
from acx4book.report.page.markdown import Document, number_labels, table_labels, to_html
from acx4book.report.shown import Text
from acx4book.typesetting.drawing import vector
from acx4book.typesetting.plain_text import shown
from acx4lib.results.own_folder.marks import SCRATCH
from acx4lib.results.own_folder.places import check_file

NOTEBOOK = NOTEBOOKS_PATH / "07-report.ipynb"

MARK = b'<meta name="generator" content="acx4'
"""Mark of a report, which may be replaced by a newer one."""

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
    on_cell: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write the calibration report of a run as one HTML file, completely or not at all.

    Parameters
    ----------
    folder : path
        Results of a run.
    out : path
        The file; an existing report is replaced, any other existing file is not.
    on_cell : callable
        Called with the number of finished cells, and of all cells.

    Raises
    ------
    FlightError
        Where the results are missing, not complete, or do not belong together.
    OutputError
        Where the file must not be replaced by a report.
    OSError
        Where the file cannot be written.
    """
    out = Path(out)
    if not out.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(out.parent))
    check_file(out, mark=MARK, what="a report of acx4")
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=SCRATCH) as temporary:
        names: dict[str, Any] = {"results_path": str(folder)}
        shown = list(parts(NOTEBOOK, names, on_cell))
        whole = Path(temporary) / "report.html"
        whole.write_text(page(shown, names["run"]), encoding="utf-8")
        check_file(out, mark=MARK, what="a report of acx4")  # again, as some seconds have passed
        whole.replace(out)


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
    return [part.told.get("figure", {}).get("name", "")]


def _rendered(part: Part, document: Document) -> str:
    if isinstance(part.content, Text):
        return to_html(part.content.markdown, document)
    document.n_figures += 1
    data = base64.b64encode(vector(part.content).encode()).decode()
    alt = html.escape(part.told.get("image", {}).get("alt", ""))
    figure = part.told.get("figure", {})
    caption = to_html(figure.get("caption", ""), document).strip()
    caption = caption.removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(figure.get("name", ""))}">\n'
        f'<img alt="{alt}" src="data:image/svg+xml;base64,{data}">\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )
