"""Number of words of the book's pages: `make words` prints a line for each, and two sums.

Counted is continuous prose: paragraphs, lists, and the sentences written by a run, if `make book`
has left the executed notebook. Tables, code, formulas on lines of their own, exercises and their
solutions, the teaching kit, the interface and the bibliography are not.
Run by `python -m acx4book.pages.words` in the working copy.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import nbformat
import yaml
from markdown_it import MarkdownIt

BOOK, NOTEBOOKS = Path("book"), Path("notebooks")
"""Folders of the working copy, the current folder."""

A_MINUTE = 200
"""Reading speed for a text with formulas, words per minute."""

MARKDOWN = MarkdownIt("commonmark").enable("table")
READ = {"admonition", "grid", "grid-item-card", "note", "tip", "warning", "glossary"}
"""Directives with prose as content; folded ones do not count."""

NOT_COUNTED = ("teaching/", "_generated/", "api", "bibliography")
"""Beginnings of the names of reference pages, which do not count."""

SOLUTION = re.compile(r"`{3,}\{solution-start\}.*?`{3,}\{solution-end\}\n`{3,}", re.DOTALL)
FENCE, FORMULA = re.compile(r"^:{3,}", re.MULTILINE), re.compile(r"\$\$.*?\$\$", re.DOTALL)
OPTIONS = re.compile(r"^:[\w-]+:.*\n?", re.MULTILINE)
ROLE = re.compile(r"\{[\w:]+\}`(?:([^`<]+?) *<[^`>]*>|([^`]*))`|\]\([^)]*\)|\$[^$]*\$")


def _words(text: str) -> int:
    """Count the words of prose of MyST text."""
    counted, table = 0, 0
    for token in MARKDOWN.parse(
        FENCE.sub(lambda match: "`" * len(match[0]), FORMULA.sub("", text))
    ):
        table += {"table_open": 1, "table_close": -1}.get(token.type, 0)
        if token.type == "fence":
            counted += _words(_inside(token.info.strip(), token.content))
        elif token.type == "inline" and not table:
            plain = ROLE.sub(lambda match: f" {match[1] or match[2] or ''} ", token.content)
            counted += len(re.findall(r"[^\W\d_][\w'’-]*", plain))
    return counted


def _inside(directive: str, content: str) -> str:
    """Return the prose of a block; for an include, of its file if a build has left it."""
    name, _, argument = directive.removeprefix("{").partition("}")
    file = BOOK / argument.strip()
    if name == "include" and file.is_file():
        return file.read_text("utf-8")
    return OPTIONS.sub("", content) if name in READ and directive.startswith("{") else ""


def _prose(page: str) -> str:
    """Return the text of a page; of a notebook, its Markdown cells and Markdown outputs."""
    written, executed = BOOK / f"{page}.md", BOOK / f"{page}.ipynb"
    source = NOTEBOOKS / f"{page.removeprefix('_executed/')}.ipynb"
    if written.is_file():
        return written.read_text("utf-8")
    path = executed if executed.is_file() else source
    notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call] # untyped
    parts = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
        for output in cell.get("outputs", ()):
            parts.append(output.get("data", {}).get("text/markdown", ""))
    return SOLUTION.sub("", "\n\n".join(parts))


def _pages() -> Iterator[str]:
    """Yield the counted pages in the order of the table of contents."""
    contents = yaml.safe_load((BOOK / "_toc.yml").read_text("utf-8"))
    yield contents["root"]
    for part in contents["parts"]:
        for chapter in part["chapters"]:
            if not chapter["file"].startswith(NOT_COUNTED):
                yield chapter["file"]


def minutes(*parts: str) -> int:
    """Return the reading time of pages by the beginning of their names, min, in steps of 5."""
    read = sum(_words(_prose(page)) for page in _pages() if page.startswith(parts))
    return max(5 * round(read / A_MINUTE / 5), 5)


def _main() -> None:
    """Print the words of each page, and of the foundations and the rest."""
    sums = {"foundations": 0, "the rest": 0}
    for page in _pages():
        n = _words(_prose(page))
        sums["foundations" if "foundations/" in page else "the rest"] += n
        sys.stdout.write(f"{n:6d}  {page.removeprefix('_executed/')}\n")
    for name, n in sums.items():
        sys.stdout.write(f"{n:6d}  {name}\n")


if __name__ == "__main__":
    _main()
