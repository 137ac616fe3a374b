"""Listings of source code without the frame of a page, and without spans that colour nothing."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.config import Config

PLAIN = re.compile(r'<span class="(?:n|nn|nc|nf|fm|o|p|w|bp|kc|nb|nd|vm|ow)">([^<]*)</span>')
"""Names, signs and spaces; what is left in colour are comments, texts, numbers and keywords."""


def find_template(_app: Sphinx, config: Config) -> None:
    """Let Sphinx find the template beside this file."""
    config.templates_path = [*config.templates_path, str(Path(__file__).parent)]


def shorten(
    _app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: Any
) -> str | None:
    """Return the template of a listing; None for any other page."""
    if not page.startswith("_modules/"):
        return None
    context["body"] = PLAIN.sub(r"\1", context.get("body", ""))
    return "listing.html"


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page before it is written."""
    app.connect("config-inited", find_template)
    app.connect("html-page-context", shorten, priority=950)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
