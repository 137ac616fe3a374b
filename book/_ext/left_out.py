"""Make plain text of links to the chapters that this book does not have."""

from __future__ import annotations

import json
from pathlib import Path, PurePosixPath
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

LIST = Path("_generated", "left_out.json")
"""The titles of the chapters, by their names; in the folder of the book."""


def title(app: Sphinx, _env: Any, node: Any, _content: Any) -> nodes.Node | None:
    """Return what a link to a chapter that is left out says; None for any other link."""
    path = Path(app.srcdir) / LIST
    if node.get("reftype") != "doc" or not path.is_file():
        return None
    titles = json.loads(path.read_text("utf-8"))
    name = PurePosixPath(node["reftarget"]).name
    return nodes.emphasis(text=titles[name]) if name in titles else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect it to what Sphinx calls for a link without a target."""
    app.connect("missing-reference", title)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
