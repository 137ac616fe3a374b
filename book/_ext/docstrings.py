"""Docstrings of many modules on one page: each has its own references, and its own names."""

from __future__ import annotations

import re
import sys
from typing import Any

from docutils.nodes import document
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx

CITED = re.compile(r"(\[\d+\])_\b")
LISTED = re.compile(r"^\.\. (\[\d+\])")


def plain_references(
    _app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]
) -> None:
    """Make numpydoc's references text: as footnotes, those of one page would share their labels."""
    lines[:] = [LISTED.sub(r"| \1", CITED.sub(r"\1", line)) for line in lines]


def whole_names(_app: Sphinx, doctree: document) -> None:
    """Let the name of a class mean what it means in its module: three packages have a `Camera`."""
    for reference in doctree.findall(pending_xref):
        module = sys.modules.get(reference.get("py:module") or "", sys)
        meant = vars(module).get(reference["reftarget"])
        if isinstance(meant, type):
            reference["reftarget"] = f"{meant.__module__}.{meant.__qualname__}"


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on the docstrings after napoleon, and on a page when it was read."""
    app.connect("autodoc-process-docstring", plain_references, priority=900)
    app.connect("doctree-read", whole_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
