"""Words of prose of the book's pages: `make words` prints a line for each, and two sums.

Counted is what a reader reads from left to right: paragraphs and lists, and the sentences that a
run wrote where `make book` has left the executed notebook. Tables, code, formulas on lines of their
own, exercises and their solutions, the teaching kit, the interface and the bibliography are not.
Run by `python -m project.words`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import nbformat
import yaml
from markdown_it import MarkdownIt
from mdit_py_plugins.colon_fence import colon_fence_plugin
from mdit_py_plugins.dollarmath import dollarmath_plugin

from support.helpers import ROOT

BOOK = ROOT / "book"
MARKDOWN = MarkdownIt("commonmark").enable("table").use(colon_fence_plugin).use(dollarmath_plugin)
READ = {"admonition", "dropdown", "grid", "grid-item-card", "note", "tip", "warning", "glossary"}
"""Directives whose content is prose."""

NOT_COUNTED = ("teaching/", "_generated/", "api", "bibliography")
"""How the names of pages begin that are looked up, not read."""

SOLUTION = re.compile(r"`{3,}\{solution-start\}.*?`{3,}\{solution-end\}\n`{3,}", re.DOTALL)
OPTIONS = re.compile(r"^:[\w-]+:.*\n?", re.MULTILINE)
ROLE = re.compile(r"\{[\w:]+\}`(?:([^`<]+?) *<[^`>]*>|([^`]*))`|\]\([^)]*\)|\$[^$]*\$")


def words(text: str) -> int:
    """Count the words of prose of MyST text."""
    counted, table = 0, 0
    for token in MARKDOWN.parse(text):
        table += {"table_open": 1, "table_close": -1}.get(token.type, 0)
        if token.type in {"fence", "colon_fence"}:
            counted += words(_inside(token.info.strip(), token.content))
        elif token.type == "inline" and not table:
            plain = ROLE.sub(lambda found: f" {found[1] or found[2] or ''} ", token.content)
            counted += len(re.findall(r"[^\W\d_][\w'’-]*", plain))
    return counted


def _inside(directive: str, content: str) -> str:
    """Return the prose of a block: of an include that of its file, where a build has left it."""
    name, _, argument = directive.removeprefix("{").partition("}")
    file = BOOK / argument.strip()
    if name == "include" and file.is_file():
        return file.read_text("utf-8")
    return OPTIONS.sub("", content) if name in READ and directive.startswith("{") else ""


def prose(page: str) -> str:
    """Return the text of a page: of a notebook its Markdown, and what its cells wrote as such."""
    written, executed = BOOK / f"{page}.md", BOOK / f"{page}.ipynb"
    source = ROOT / "notebooks" / f"{page.removeprefix('_executed/')}.ipynb"
    if written.is_file():
        return written.read_text("utf-8")
    notebook = nbformat.read(executed if executed.is_file() else source, as_version=4)
    parts = []
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source)
        for output in cell.get("outputs", ()):
            parts.append(output.get("data", {}).get("text/markdown", ""))
    return SOLUTION.sub("", "\n\n".join(parts))


def pages(contents: Path = BOOK / "_toc.yml") -> Iterator[str]:
    """Yield the pages that are read, in the order of the table of contents."""
    told = yaml.safe_load(contents.read_text("utf-8"))
    yield told["root"]
    for part in told["parts"]:
        for chapter in part["chapters"]:
            if not chapter["file"].startswith(NOT_COUNTED):
                yield chapter["file"]


def main() -> None:
    """Print the words of each page, and of the foundations and the rest."""
    sums = {"foundations": 0, "the rest": 0}
    for page in pages():
        n = words(prose(page))
        sums["foundations" if "foundations/" in page else "the rest"] += n
        sys.stdout.write(f"{n:6d}  {page.removeprefix('_executed/')}\n")
    for name, n in sums.items():
        sys.stdout.write(f"{n:6d}  {name}\n")


if __name__ == "__main__":
    main()
