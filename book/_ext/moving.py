"""Give a page the scripts of the figures that move, if it has such a figure.

What lies in ``_static`` would be on every page; so these files have a folder of their own.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

FILES = {
    'class="acx4-explorer"': Path("_moving", "explorer.js"),
    'class="acx4-block"': Path("_moving", "block.js"),
}
"""The script that a figure with this class needs, from the folder of the book."""

STYLE = Path("_moving", "moving.css")


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
    """Connect both steps."""
    app.connect("builder-inited", copy)
    app.connect("html-page-context", add)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
