"""Number the figures that move, and give a page their scripts, if it has such a figure.

What lies in ``_static`` would be on every page; so these files have a folder of their own.
"""

from __future__ import annotations

import re
import shutil
from html import unescape
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

FILES = {
    'class="acx4-explorer"': Path("_moving", "explorer.js"),
    'class="acx4-block"': Path("_moving", "block.js"),
}
"""The script that a figure with this class needs, from the folder of the book."""

STYLE = Path("_moving", "moving.css")


CAPTION = re.compile(r"<figcaption>(.*?)</figcaption>", re.DOTALL)
NAME = re.compile(r'<figure class="acx4-\w+" id="([\w-]+)"')


def number(_app: Sphinx, page: nodes.document) -> None:
    """Put each such figure of a page into a numbered one, which takes its caption."""
    for html in list(page.findall(nodes.raw)):
        text = html.astext()
        caption = CAPTION.search(text) if any(mark in text for mark in FILES) else None
        bundle = _of_cell(html)
        if caption is None or bundle is None:
            continue
        html[:] = [nodes.Text(CAPTION.sub("", text))]
        label = f"fig-{NAME.findall(text)[0]}"
        figure = nodes.figure(ids=[label], names=[label])
        bundle.replace_self(figure)
        figure += [bundle, nodes.caption("", unescape(caption[1]))]


def _of_cell(node: nodes.Node) -> nodes.Element | None:
    """Return the output of a notebook's cell that a node is part of, with all its forms."""
    while node is not None and getattr(node, "attributes", {}).get("nb_element") != "mime_bundle":
        node = node.parent
    return node


def copy(app: Sphinx) -> None:
    """Copy style and scripts into the built book."""
    folder = Path(app.outdir, "_static", "moving")
    folder.mkdir(parents=True, exist_ok=True)
    for path in (STYLE, *FILES.values()):
        shutil.copyfile(Path(app.srcdir, path), folder / path.name)


def add(app: Sphinx, _page: str, _template: str, context: dict[str, Any], _doctree: Any) -> None:
    """Add to a page what its figures need."""
    needed = [path for mark, path in FILES.items() if mark in context.get("body", "")]
    if needed:
        app.add_css_file(f"moving/{STYLE.name}")
    for path in needed:
        app.add_js_file(f"moving/{path.name}", loading_method="defer")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the steps."""
    app.connect("builder-inited", copy)
    app.connect("doctree-read", number)
    app.connect("html-page-context", add)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
