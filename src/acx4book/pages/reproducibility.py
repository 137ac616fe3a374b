"""Sources of a book: software, flights, licences, and the project's citation."""

from __future__ import annotations

import hashlib
import platform
import re
import subprocess
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path

import yaml

from acx4book.reference import data
from acx4book.typesetting.plain_text import code
from acx4files.results.provenance import KEPT

# --- What a book was made from: sources, machine, packages and files, as a page of the book


def commit() -> str:
    """Return the commit of the working copy in the current folder, and count changed files.

    New files do not count: a flight or results beside the sources do not change the sources.
    """

    def git(*arguments: str) -> str:
        command = ["git", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        changed = len(git("status", "--porcelain", "--untracked-files=no").splitlines())
        return git("rev-parse", "HEAD") + (f", {changed} files differ" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "not a clone of the repository"


def short(commit: str) -> str:
    """Shorten the text of `commit` to ten characters of the hash."""
    name, _, changed = commit.partition(",")
    return f"{name[:10]}{' with changes' if changed else ''}" if " " not in name else name


def of_stored(commit: str) -> str:
    """Return the commit of stored numbers, and by how many commits the library has changed since.

    Parameters
    ----------
    commit : str
        As `commit` returned it when the numbers were computed.
    """
    name, code = commit.partition(",")[0], ("src/acx4lib", "src/acx4sim")
    command = ["git", "rev-list", "--count", f"{name}..HEAD", "--", *code]
    counted = subprocess.run(command, capture_output=True, text=True, check=False)
    n = int(counted.stdout or 0)
    later = f"; the library has changed in {n} later commit{'s' if n > 1 else ''}" if n else ""
    unknown = "; not in this history" if counted.returncode else ""
    return f"stored numbers of commit {short(commit)}{later or unknown}"


def _table(name: str, caption: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Compose a numbered table in MyST."""
    lines = [header, ["---"] * len(header), *rows]
    body = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    return f"```{{table}} {caption}\n:name: {name}\n\n{body}\n```\n"


def _packages() -> list[tuple[str, str]]:
    """List the packages of environment.txt with the installed versions."""
    text = Path("environment.txt").read_text(encoding="utf-8")
    names = re.findall(r"^([\w.-]+)==", text, flags=re.MULTILINE)
    return [(name, version(name)) for name in names]


def _files(name: str, folder: Path) -> list[tuple[str, str, str]]:
    """List the data files under a folder with size and SHA-256."""
    names = (path.relative_to(folder) for path in folder.rglob("*"))
    kept = (name for name in names if name.parts[0] != KEPT)  # results keep the flight's tables
    paths = [folder / name for name in sorted(kept) if name.suffix in {".csv", ".toml", ".json"}]
    return [
        (
            code(f"{name}/{path.relative_to(folder).as_posix()}"),
            f"{path.stat().st_size:,}",
            f"`{hashlib.sha256(path.read_bytes()).hexdigest()}`",
        )
        for path in paths
    ]


def page(flight: Path, results: Path) -> str:
    """Return the statement as MyST text; the current folder is the working copy."""
    sources = [
        ("acx4lib", version("acx4lib")),
        ("commit", f"`{commit()}`"),
        ("Python", platform.python_version()),
        ("system", f"{platform.system()}, {platform.machine()}"),
    ]
    environment, of_files = "The packages that environment.txt names.", ("file", "bytes", "SHA-256")
    parts = [
        _table("tab-sources", "The sources and the machine.", ("what", "value"), sources),
        _table("tab-packages", environment, ("package", "version"), _packages()),
        _table("tab-flight-files", "The flight that was read.", of_files, _files("flight", flight)),
        _table(
            "tab-result-files", "The results that it gave.", of_files, _files("results", results)
        ),
    ]
    return "\n".join(parts)


# --- Whose work the built book carries, under what licence, as a page of the book


@dataclass(frozen=True, kw_only=True)
class Work:
    """A work of others in the folder of the built book.

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
    return next(
        (work for work in WORKS if any(fnmatch(file, pattern) for pattern in work.files)), None
    )


def licences_page() -> str:
    """Tabulate works of others in the book and in its comparisons, as MyST text."""
    carried = ((w.what, w.licence, f"{w.brought_by} {version(w.brought_by)}") for w in WORKS)
    return "\n".join(
        [
            _table(
                "tab-of-others",
                "Works of others in the folder of this book.",
                ("what", "licence", "brought by"),
                carried,
            ),
            _table(
                "tab-compared",
                "Measurements and results of others that the book was compared with.",
                ("repository", "files", "licence"),
                _compared(),
            ),
        ]
    )


def _compared() -> Iterator[tuple[str, str, str]]:
    """Yield repository, number of files and licence of the reference data."""
    counted = Counter((entry.repository, entry.licence) for entry in data.index())
    for (repository, licence), files in sorted(counted.items()):
        yield f"`{repository}`", f"{files}", licence


# --- Who made which version of the project, as every page of the book says it


PARTS = ("code", "text")
"""Parts of the project, in the order of the two licences of its CITATION.cff."""


def footer(file: Path) -> dict[str, str]:
    """Return the fields of CITATION.cff for the foot of a page.

    Parameters
    ----------
    file : Path
        CITATION.cff, or another of its format.

    Returns
    -------
    dict
        name, version, authors, licence; doi and repository where the file has them.
    """
    citation = yaml.safe_load(file.read_text(encoding="utf-8"))
    fields = {
        "name": citation["title"].partition(":")[0],
        "version": str(citation["version"]),
        "authors": ", ".join(_name(author) for author in citation["authors"]),
        "licence": _licences(citation["license"]),
        "doi": citation.get("doi", ""),
        "repository": citation.get("repository-code", ""),
    }
    return {key: value for key, value in fields.items() if value}


def sentence(file: Path) -> str:
    """Return the citation of the project as Markdown: authors, title, version, address."""
    citation, fields = yaml.safe_load(file.read_text(encoding="utf-8")), footer(file)
    ends = (fields.get("doi") and f"doi:{fields['doi']}", fields.get("repository"))
    parts = (fields["authors"], f"*{citation['title']}*", f"version {fields['version']}", *ends)
    return f"{', '.join(filter(None, parts))}.\n"


def _licences(licences: str | list[str]) -> str:
    """Return the single licence, or the licences of code and text."""
    if isinstance(licences, str):
        return licences
    return ", ".join(
        f"{part} {name.replace('-', ' ')}" for part, name in zip(PARTS, licences, strict=True)
    )


def _name(author: dict[str, str]) -> str:
    """Return the name of a person or of a group."""
    parts = (author.get("given-names"), author.get("name-particle"), author.get("family-names"))
    return author.get("name") or " ".join(filter(None, parts))
