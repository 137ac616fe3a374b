"""The page of a comparison: one HTML file, by day and by night, without external files."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources

from matplotlib.figure import Figure

from acx4book.report.page import page as report
from acx4book.report.page.markdown import Document, number_labels, table_labels, to_html
from acx4book.typesetting import style
from acx4book.typesetting.drawing.inline import inline
from acx4book.typesetting.drawing.svg import vector
from acx4book.typesetting.plain_text import shown

ADDED = resources.files("acx4book.report.campaigns") / "campaigns.css"

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="acx4 compare">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<header>
<p class="kind">In-flight camera calibration</p>
<h1>{title}</h1>
<p class="name">{name}</p>
</header>
<main>
{body}
</main>
</body>
</html>
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drawn:
    """A figure of a page.

    Attributes
    ----------
    figure : Figure
    name, caption, alt : str
        The caption is Markdown.
    """

    figure: Figure
    name: str
    caption: str
    alt: str


def page(title: str, name: str, parts: Sequence[str | Drawn]) -> str:
    """Return texts and figures as a page.

    Parameters
    ----------
    title, name : str
        What the page is, and of what; text as it is.
    parts : sequence of str or Drawn
        Markdown, with tables as `myst_table` makes them, and figures.
    """
    labels = [
        name
        for part in parts
        for name in ([part.name] if isinstance(part, Drawn) else table_labels(part))
    ]
    document = Document(numbers=number_labels(labels))
    known: set[str] = set()
    body = [
        _figure(part, document, known) if isinstance(part, Drawn) else to_html(part, document)
        for part in parts
    ]
    return PAGE.format(
        title=shown(title, "html"),
        style=_style(),
        name=shown(name, "html"),
        body="\n".join(body),
    )


def _style() -> str:
    colours = "".join(f"  --figure-{name}: {value};\n" for value, name in style.NAMES.items())
    sheets = (report.STYLE, ADDED)
    own, added = (sheet.read_text(encoding="utf-8") for sheet in sheets)
    return f"{own}\n:root {{\n{colours}}}\n{added}"


def _figure(part: Drawn, document: Document, known: set[str]) -> str:
    document.n_figures += 1
    name = f"f{document.n_figures}-"
    drawn = inline(vector(part.figure), alt=part.alt, name=name, known=known)
    caption = to_html(part.caption, document).strip().removeprefix("<p>").removesuffix("</p>")
    return (
        f'<figure id="{html.escape(part.name)}">\n{drawn}\n'
        f"<figcaption><b>Figure {document.n_figures}.</b> {caption}</figcaption>\n</figure>\n"
    )
