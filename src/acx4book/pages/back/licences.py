"""Whose work the built book carries, under what licence, as a page of the book."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path

from acx4book.pages.provenance import table
from acx4book.reference import data


@dataclass(frozen=True, kw_only=True)
class Work:
    """A work of others that lies in the folder of the built book.

    Attributes
    ----------
    what, licence : str
    brought_by : str
        The package that brings it.
    files : tuple of str
        Patterns of its files below the folder of the book; ``*`` is any text, with slashes.
    """

    what: str
    licence: str
    brought_by: str
    files: tuple[str, ...]


WORKS = (
    Work(
        what="MathJax with its fonts",
        licence="Apache-2.0",
        brought_by="sphinx-mathjax-offline",
        files=("_static/mathjax/*",),
    ),
    Work(
        what="Bootstrap, in the theme",
        licence="MIT",
        brought_by="pydata-sphinx-theme",
        files=("_static/scripts/bootstrap*",),
    ),
    Work(
        what="Font Awesome Free, in the theme",
        licence="icons CC BY 4.0, fonts SIL OFL 1.1, code MIT",
        brought_by="pydata-sphinx-theme",
        files=("_static/vendor/fontawesome/*", "_static/scripts/fontawesome*"),
    ),
    Work(
        what="scripts and styles of the theme",
        licence="BSD-3-Clause",
        brought_by="pydata-sphinx-theme",
        files=("_static/*/pydata-sphinx-theme*", "_static/styles/theme.css", "_static/webpack-*"),
    ),
    Work(
        what="scripts, styles, translations and logos of the book's theme",
        licence="BSD-3-Clause; the logos belong to the services",
        brought_by="sphinx-book-theme",
        files=(
            *("_static/*/sphinx-book-theme*", "_static/locales/*", "_static/images/logo_*"),
            "_static/sbt-webpack-*",
        ),
    ),
    Work(
        what="the search, its word stems (Snowball), basic styles",
        licence="BSD-2-Clause; stems BSD-3-Clause",
        brought_by="Sphinx",
        files=(
            *("_static/basic.css", "_static/doctools.js", "_static/documentation_options.js"),
            *("_static/language_data.js", "_static/searchtools.js", "_static/sphinx_highlight.js"),
            *("_static/file.png", "_static/minus.png", "_static/plus.png"),
        ),
    ),
    Work(
        what="colours of code",
        licence="BSD-2-Clause",
        brought_by="Pygments",
        files=("_static/pygments.css",),
    ),
    Work(
        what="styles of notebooks",
        licence="BSD-3-Clause",
        brought_by="myst-nb",
        files=("_static/mystnb*.css",),
    ),
    Work(
        what="cards, grids and tabs",
        licence="MIT",
        brought_by="sphinx-design",
        files=("_static/sphinx-design*", "_static/design-tabs.js"),
    ),
    Work(
        what="folded parts of a page",
        licence="MIT",
        brought_by="sphinx-togglebutton",
        files=("_static/togglebutton*",),
    ),
    Work(
        what="buttons that copy code, with clipboard.js",
        licence="MIT",
        brought_by="sphinx-copybutton",
        files=(
            *("_static/copy*", "_static/clipboard.min.js", "_static/check-solid.svg"),
            "_static/play-solid.svg",
        ),
    ),
    Work(
        what="styles of live code, which the book does not have",
        licence="MIT",
        brought_by="sphinx-thebe",
        files=("_static/sphinx-thebe*",),
    ),
    Work(
        what="styles of exercises",
        licence="MIT",
        brought_by="sphinx-exercise",
        files=("_static/exercise*",),
    ),
    Work(
        what="styles of proofs",
        licence="BSD-3-Clause",
        brought_by="sphinx-proof",
        files=("_static/proof*",),
    ),
    Work(
        what="three.js, in the 3-D view",
        licence="MIT",
        brought_by="three",
        files=("_static/moving/block.js",),
    ),
)


def of(file: str) -> Work | None:
    """Return the work that a file of the built book belongs to; None for our own."""
    return next((work for work in WORKS if any(fnmatch(file, one) for one in work.files)), None)


def page(lock: Path) -> str:
    """Return what the book carries, and what it was compared with, as MyST text.

    Parameters
    ----------
    lock : Path
        The lock of npm, by which the 3-D view comes.
    """
    locked = json.loads(lock.read_text(encoding="utf-8"))["packages"]
    by_npm = {
        name.removeprefix("node_modules/"): one.get("version") for name, one in locked.items()
    }
    carried = (
        (w.what, w.licence, f"{w.brought_by} {by_npm.get(w.brought_by) or version(w.brought_by)}")
        for w in WORKS
    )
    return "\n".join(
        [
            table(
                "tab-of-others",
                "Works of others in the folder of this book.",
                ("what", "licence", "brought by"),
                carried,
            ),
            table(
                "tab-compared",
                "Measurements and results of others that the book was compared with.",
                ("repository", "files", "licence"),
                _compared(),
            ),
        ]
    )


def _compared() -> Iterator[tuple[str, str, str]]:
    """Yield the repositories of the reference data, how many files are theirs, and licences."""
    counted = Counter((entry.repository, entry.licence) for entry in data.index())
    for (repository, licence), files in sorted(counted.items()):
        yield f"`{repository}`", f"{files}", licence
