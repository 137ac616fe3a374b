"""Source code and the interface's pages without what nobody sees: a third of their bytes."""

from __future__ import annotations

import pkgutil
import re
import shutil
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.environment import BuildEnvironment

import acx4book
import acx4sim

COLOURED = re.compile(r'<span class="(?!sd|c1)[\w ]*">([^<]*)</span>')
"""All words of a program but texts that explain it, and comments."""

INTERFACE = "_generated/api/"
PRE = re.compile(r'<span class="(?:pre|n|o|p|sig-paren)">([^<]*)</span>')
"""Spans of signatures that no style sheet of the book knows."""

LINKS = re.compile(r'<a class="headerlink" [^>]*>#</a>(?=</dt>)|(?<=") title="acx4[\w.]*"')
"""A link beside every object to itself, and names that links already have as their text."""


STYLE = Path(__file__).with_name("listing.css")
"""In ``_static`` of the book it would be on every page."""


def copy_style(app: Sphinx) -> None:
    """Copy the style of listings into the built book."""
    folder = Path(app.outdir, "_static")
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(STYLE, folder / STYLE.name)


def leave_out(_app: Sphinx, env: BuildEnvironment, _changed: list[str]) -> None:
    """Make no listings of the book's code and the simulator's: they lie there as archives."""
    known: dict[str, Any] = {}  # what viewcode has listed, or will not
    for house in (acx4book, acx4sim):
        for module in pkgutil.walk_packages(house.__path__, f"{house.__name__}."):
            known[module.name] = False
    env._viewcode_modules = known


def forget(app: Sphinx) -> list[Any]:
    """Take what was left out from viewcode's list of listings, and add no page."""
    known = app.env._viewcode_modules
    for name in [name for name, listing in known.items() if not listing]:
        del known[name]
    return []


def find_template(_app: Sphinx, config: Config) -> None:
    """Let Sphinx find the template beside this file."""
    config.templates_path = [*config.templates_path, str(Path(__file__).parent)]


def shorten(
    _app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: Any
) -> str | None:
    """Shorten a page, and return the template of a listing; None for any other page."""
    body = context.get("body", "")
    if page.startswith(INTERFACE):
        while PRE.search(body):  # one lies in another
            body = PRE.sub(r"\1", body)
        context["body"] = LINKS.sub("", body)
    if not page.startswith("_modules/"):
        return None
    context["body"] = COLOURED.sub(r"\1", body)
    return "listing.html"


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page before it is written."""
    app.connect("env-before-read-docs", leave_out)
    app.connect("html-collect-pages", forget, priority=100)
    app.connect("config-inited", find_template)
    app.connect("builder-inited", copy_style)
    app.connect("html-page-context", shorten, priority=950)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
