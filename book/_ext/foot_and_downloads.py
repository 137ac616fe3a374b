"""What every page offers besides its text: who made it, and its notebook to take along."""

from __future__ import annotations

import json
import shutil
import zipfile
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from sphinx.application import Sphinx

CITATION = Path("_generated", "citation.json")
"""What `acx4book.pages.reproducibility` says; below the folder of the book."""

DOWNLOADS = Path("_generated", "downloads")
"""What is copied into the built book as it is."""

PAGES = "_executed/"
"""Folder of the pages that are notebooks."""

EXECUTED = Path("downloads", "executed")
"""Where the executed notebooks lie in the built book, packed: most of them is figures."""

EARLIEST = (1980, 1, 1, 0, 0, 0)
"""Date of what is packed, so that the same notebook is the same bytes."""

HOST = "https://mybinder.org/v2/git/{repository}/HEAD?labpath=notebooks/{name}.ipynb"
"""Where a notebook of a repository can be run without installing anything."""


def foot(said: dict[str, str], year: str, licences: str) -> str:
    """Return the foot of a page as HTML, with a link to the page of licences."""
    doi, repository = said.get("doi"), said.get("repository")
    parts = [
        escape(f"{said['name']} {said['version']}"),
        said["authors"] and escape(f"© {year} {said['authors']}"),
        said["licence"] and f'<a href="{escape(licences)}">Licence: {escape(said["licence"])}</a>',
        doi and f'<a href="https://doi.org/{escape(doi)}">doi:{escape(doi)}</a>',
        repository and f'<a href="{escape(repository)}">{escape(repository)}</a>',
    ]
    return f"<p>{' · '.join(part for part in parts if part)}</p>"


def buttons(said: dict[str, str], name: str, copy: str) -> list[dict[str, str]]:
    """Return the entries of a notebook in the menu of downloads: without outputs, and at a host."""
    found = [
        {
            "type": "link",
            "url": copy,
            "text": "notebook, to run",
            "icon": "fas fa-play",
            "tooltip": "Download the notebook without outputs, to run it in the project",
            "label": "download-clean-button",
        }
    ]
    if "repository" in said:
        address = HOST.format(repository=quote(said["repository"], safe=""), name=name)
        found.append(
            {
                "type": "link",
                "url": address,
                "text": "run on Binder",
                "icon": "fas fa-rocket",
                "tooltip": "Run the notebook on mybinder.org",
                "label": "launch-binder-button",
            }
        )
    return found


def add(app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: Any) -> None:
    """Add both to a page."""
    file = Path(app.srcdir) / CITATION
    if not file.is_file():  # a part of the book
        return
    said, pathto = json.loads(file.read_text("utf-8")), context["pathto"]
    licences = pathto("licences") if "licences" in app.env.found_docs else "#"
    context["theme_extra_footer"] = foot(said, app.config.copyright, licences)
    name = page.removeprefix(PAGES)
    copy = Path("downloads", "notebooks", f"{name}.ipynb")
    if page.startswith(PAGES) and (Path(app.srcdir) / DOWNLOADS.parent / copy).is_file():
        for group in context.get("header_buttons", ()):
            if group.get("label") == "download-buttons":
                _describe(group["buttons"], pathto((EXECUTED / f"{name}.zip").as_posix(), 1))
                group["buttons"][:0] = buttons(said, name, pathto(copy.as_posix(), 1))


def _describe(entries: list[dict[str, str]], packed: str) -> None:
    """Offer in place of the page's own source the notebook as it was executed, packed."""
    for entry in entries:
        if entry.get("label") == "download-source-button":
            entry |= {
                "url": packed,
                "text": "notebook, executed (zip)",
                "tooltip": "Download the notebook as shown, with its figures",
            }


def bring_downloads(app: Sphinx, exception: Exception | None) -> None:
    """Copy what readers download."""
    source = Path(app.srcdir) / DOWNLOADS
    if exception is None and source.is_dir():
        shutil.copytree(source, Path(app.outdir) / DOWNLOADS.name, dirs_exist_ok=True)
        pack(Path(app.outdir, "_sources", PAGES), Path(app.outdir) / EXECUTED)


def pack(sources: Path, folder: Path) -> None:
    """Move the notebooks below one folder into archives below another, each into its own."""
    for notebook in sorted(sources.rglob("*.ipynb")):
        archive = folder / notebook.relative_to(sources).with_suffix(".zip")
        archive.parent.mkdir(parents=True, exist_ok=True)
        entry = zipfile.ZipInfo(notebook.name, EARLIEST)
        with zipfile.ZipFile(archive, "w") as packed:
            packed.writestr(entry, notebook.read_bytes(), zipfile.ZIP_DEFLATED, 9)
        notebook.unlink()


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect both, after the theme has made its buttons."""
    app.connect("html-page-context", add, priority=900)
    app.connect("build-finished", bring_downloads)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
