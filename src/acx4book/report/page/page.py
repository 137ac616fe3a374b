"""One HTML file of an executed notebook: small, printable on A4, without external files."""

from __future__ import annotations

import base64
import errno
import html
import tempfile
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import nbformat

from acx4book.notebooks import execute
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.report.material import Material, read
from acx4book.report.page.markdown import Document, number_labels, table_labels, to_html
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
{body}
</main>
<footer>
<table class="signatures">
<tr><td>Prepared by</td><td>Checked by</td><td>Place and date</td></tr>
</table>
</footer>
</body>
</html>
"""


def write(
    folder: str | Path,
    out: str | Path,
    *,
    notebook: Path = NOTEBOOK,
    on_cell: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write the calibration report of a run as one HTML file, completely or not at all.

    Parameters
    ----------
    folder : path
        Results of a run.
    out : path
        The file; an existing report is replaced, any other existing file is not.
    notebook : Path
    on_cell : callable
        Called with the number of finished cells, and of all cells.

    Raises
    ------
    FlightError
        Where the results are missing, not complete, or do not belong together.
    NotebookError
        Where the notebook fails.
    OutputError
        Where the file must not be replaced by a report.
    OSError
        Where the file cannot be written.
    """
    out = Path(out)
    material = read(folder)
    if not out.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, "no such folder", str(out.parent))
    check_file(out, mark=MARK, what="a report of acx4")
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=SCRATCH) as temporary:
        executed = Path(temporary) / "notebooks" / notebook.name
        values = execute.with_defaults(notebook, {"results_path": str(folder)})
        execute.execute(notebook, executed, parameters=values, on_cell=on_cell)
        whole = Path(temporary) / "report.html"
        whole.write_text(page(nbformat.read(executed, as_version=4), material), encoding="utf-8")  # type: ignore[no-untyped-call] # untyped
        check_file(out, mark=MARK, what="a report of acx4")  # again, as some seconds have passed
        whole.replace(out)


def page(notebook: nbformat.NotebookNode, material: Material) -> str:
    """Return an executed notebook as a page: text, tables and figures, no code.

    Parameters
    ----------
    notebook : NotebookNode
    material : Material
        Material from the same results; the heading of the page has their name.
    """
    parts = [part for cell in notebook.cells for part in _parts(cell)]
    labels = [label for kind, content in parts for label in _labels(kind, content)]
    document = Document(numbers=number_labels(labels))
    rendered = [
        to_html(content, document) if kind == "text" else _figure(content, document)
        for kind, content in parts
    ]
    heading, _, first = rendered[0].partition("</h1>")
    return PAGE.format(
        title=shown(f"Calibration report: {material.flight.name}", "html"),
        style=STYLE.read_text(encoding="utf-8"),
        heading=f"{heading}</h1>",
        name=shown(material.flight.name, "html"),
        date=f"{material.date.day} {material.date:%B %Y}",
        body="\n".join([first, *rendered[1:]]),
    )


def _parts(cell: Any) -> Iterator[tuple[str, Any]]:
    """Yield the texts and figures of a cell."""
    if cell.cell_type == "markdown":
        yield "text", cell.source
        return
    for output in cell.get("outputs", ()):
        data = output.get("data", {})
        if "image/svg+xml" in data:
            yield "figure", (data["image/svg+xml"], cell.metadata.get("mystnb", {}))
        elif "text/markdown" in data:
            yield "text", data["text/markdown"]


def _labels(kind: str, content: Any) -> list[str]:
    if kind == "text":
        return table_labels(content)
    return [content[1].get("figure", {}).get("name", "")]


def _figure(content: tuple[str, dict[str, Any]], document: Document) -> str:
    drawing, told = content
    document.n_figures += 1
    data = base64.b64encode(drawing.encode()).decode()
    alt = html.escape(told.get("image", {}).get("alt", ""))
    figure = told.get("figure", {})
    caption = to_html(figure.get("caption", ""), document).strip()
    caption = caption.removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(figure.get("name", ""))}">\n'
        f'<img alt="{alt}" src="data:image/svg+xml;base64,{data}">\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )
