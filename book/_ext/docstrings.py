"""Let many docstrings of one page each have their own references [1], [2]."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

CITED = re.compile(r"(\[\d+\])_\b")
LISTED = re.compile(r"^\.\. (\[\d+\])")


def plain_references(
    _app: Sphinx, _what: str, _name: str, _obj: Any, _options: Any, lines: list[str]
) -> None:
    """Make numpydoc's references text: as footnotes, those of one page would share their labels."""
    lines[:] = [LISTED.sub(r"| \1", CITED.sub(r"\1", line)) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on the docstrings after napoleon."""
    app.connect("autodoc-process-docstring", plain_references, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
