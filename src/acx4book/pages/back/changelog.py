"""The changelog as a page of the book."""

from __future__ import annotations

import re
from pathlib import Path

LINK = re.compile(r"\[([^\]]+)\]\((?!https?://)[^)]+\)")
"""A link to a file of the project, which is no page of the book."""


def page(file: Path) -> str:
    """Return CHANGELOG.md below its title, as MyST text; links to files become their names."""
    text = file.read_text(encoding="utf-8")
    return LINK.sub(r"\1", text.partition("\n")[2].lstrip())
