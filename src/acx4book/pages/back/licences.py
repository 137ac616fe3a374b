"""Whose work the built book carries, under what licence, as a page of the book."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version

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


WORKS = tuple(
    Work(what=what, licence=licence, brought_by=package, files=tuple(files.split()))
    for what, licence, package, files in (
        ("MathJax with its fonts", "Apache-2.0", "sphinx-mathjax-offline", "_static/mathjax/*"),
        ("Bootstrap, in the theme", "MIT", "pydata-sphinx-theme", "_static/scripts/bootstrap*"),
        (
            "Font Awesome Free, in the theme",
            "icons CC BY 4.0, fonts SIL OFL 1.1, code MIT",
            "pydata-sphinx-theme",
            "_static/vendor/fontawesome/* _static/scripts/fontawesome*",
        ),
        (
            "scripts and styles of the theme",
            "BSD-3-Clause",
            "pydata-sphinx-theme",
            "_static/*/pydata-sphinx-theme* _static/styles/theme.css _static/webpack-*",
        ),
        (
            "scripts, styles, translations and logos of the book's theme",
            "BSD-3-Clause; the logos belong to the services",
            "sphinx-book-theme",
            "_static/*/sphinx-book-theme* _static/locales/* _static/images/logo_* "
            "_static/sbt-webpack-*",
        ),
        (
            "the search, its word stems (Snowball), basic styles",
            "BSD-2-Clause; stems BSD-3-Clause",
            "Sphinx",
            "_static/basic.css _static/doctools.js _static/documentation_options.js "
            "_static/language_data.js _static/searchtools.js _static/sphinx_highlight.js "
            "_static/file.png _static/minus.png _static/plus.png",
        ),
        ("colours of code", "BSD-2-Clause", "Pygments", "_static/pygments.css"),
        ("styles of notebooks", "BSD-3-Clause", "myst-nb", "_static/mystnb*.css"),
        (
            "cards, grids and tabs",
            "MIT",
            "sphinx-design",
            "_static/sphinx-design* _static/design-tabs.js",
        ),
        ("folded parts of a page", "MIT", "sphinx-togglebutton", "_static/togglebutton*"),
        (
            "buttons that copy code, with clipboard.js",
            "MIT",
            "sphinx-copybutton",
            "_static/copy* _static/clipboard.min.js _static/check-solid.svg _static/play-solid.svg",
        ),
        (
            "styles of live code, which the book does not have",
            "MIT",
            "sphinx-thebe",
            "_static/sphinx-thebe*",
        ),
        ("styles of exercises", "MIT", "sphinx-exercise", "_static/exercise*"),
        ("styles of proofs", "BSD-3-Clause", "sphinx-proof", "_static/proof*"),
    )
)


def of(file: str) -> Work | None:
    """Return the work that a file of the built book belongs to; None for our own."""
    return next((work for work in WORKS if any(fnmatch(file, one) for one in work.files)), None)


def page() -> str:
    """Return what the book carries, and what it was compared with, as MyST text."""
    carried = ((w.what, w.licence, f"{w.brought_by} {version(w.brought_by)}") for w in WORKS)
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
