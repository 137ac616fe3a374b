"""Let the search find a chapter before it finds a module."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx
from sphinx.config import Config


def use_weights(_app: Sphinx, config: Config) -> None:
    """Give the search our weights; a path in the configuration would hang on the current folder."""
    config.html_search_scorer = str(Path(__file__).with_suffix(".js"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Set the weights before they are read."""
    app.connect("config-inited", use_weights)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
