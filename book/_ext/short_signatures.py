"""The interface's pages without what nobody sees: a third of their bytes."""

from __future__ import annotations

import re
from typing import Any

from docutils.nodes import document
from sphinx.addnodes import index
from sphinx.application import Sphinx

INTERFACE = "_generated/api/"
PRE = re.compile(r'<span class="(?:pre|n|o|p|sig-paren)">([^<]*)</span>')
"""Spans of signatures that no style sheet of the book knows."""

LINKS = re.compile(r'<a class="headerlink" [^>]*>#</a>(?=</dt>)|(?<=") title="acx4[\w.]*"')
"""A link beside every object to itself, and names that links already have as their text."""


def shorten(
    _app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: Any
) -> None:
    """Shorten a page of the interface."""
    if page.startswith(INTERFACE):
        body = context.get("body", "")
        while PRE.search(body):  # one lies in another
            body = PRE.sub(r"\1", body)
        context["body"] = LINKS.sub("", body)


def no_entries(app: Sphinx, doctree: document) -> None:
    """Take the entries of an index off the interface: the search has all its objects by name."""
    if app.env.docname.startswith(INTERFACE):
        for node in doctree.findall(index):
            node["entries"] = []


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page when it was read, and before it is written."""
    app.connect("doctree-read", no_entries)
    app.connect("html-page-context", shorten, priority=950)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
