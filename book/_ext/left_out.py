"""Make plain text of links to the pages that this book does not have."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import docname_join

LIST = Path("_generated", "left_out.json")
"""The titles of the chapters that are left out, by their pages; in the folder of the book."""

API = "_generated/api"
"""What is in the list if the pages of the programming interface are left out."""


def text(app: Sphinx, _env: Any, node: Any, content: nodes.Node) -> nodes.Node | None:
    """Return what a link says that leads to a page that is left out; None for any other link."""
    path = Path(app.srcdir) / LIST
    titles = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    if node.get("refdomain") == "py":
        return content if API in titles else None
    page = docname_join(node.get("refdoc", ""), node["reftarget"])
    is_page = node.get("reftype") == "doc" and page in titles
    return nodes.emphasis(text=titles[page]) if is_page else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect it to what Sphinx calls for a link without a target."""
    app.connect("missing-reference", text)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
