"""Who made which version of the project, as every page of the book says it."""

from __future__ import annotations

from pathlib import Path

import yaml

PARTS = ("code", "text")
"""What the licences of a CITATION.cff that has two are of, in their order."""


def footer(file: Path) -> dict[str, str]:
    """Return what CITATION.cff says for the foot of a page.

    Parameters
    ----------
    file : Path
        CITATION.cff, or another of its format.

    Returns
    -------
    dict
        name, version, authors, licence; doi and repository where the file has them.
    """
    said = yaml.safe_load(file.read_text(encoding="utf-8"))
    found = {
        "name": said["title"].partition(":")[0],
        "version": str(said["version"]),
        "authors": ", ".join(_name(author) for author in said["authors"]),
        "licence": _licences(said["license"]),
        "doi": said.get("doi", ""),
        "repository": said.get("repository-code", ""),
    }
    return {key: value for key, value in found.items() if value}


def sentence(file: Path) -> str:
    """Return how the project is cited, as Markdown: authors, title, version, address."""
    said, found = yaml.safe_load(file.read_text(encoding="utf-8")), footer(file)
    ends = (found.get("doi") and f"doi:{found['doi']}", found.get("repository"))
    parts = (found["authors"], f"*{said['title']}*", f"version {found['version']}", *ends)
    return f"{', '.join(filter(None, parts))}.\n"


def _licences(given: str | list[str]) -> str:
    """Return the licence of all, or those of the code and of the text, which are two."""
    if isinstance(given, str):
        return given
    return ", ".join(
        f"{what} {name.replace('-', ' ')}" for what, name in zip(PARTS, given, strict=True)
    )


def _name(author: dict[str, str]) -> str:
    """Return the name of a person, or of a group, which has one name."""
    parts = (author.get("given-names"), author.get("name-particle"), author.get("family-names"))
    return author.get("name") or " ".join(filter(None, parts))
