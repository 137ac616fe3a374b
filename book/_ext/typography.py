"""Minus signs before numbers; what belongs together, such as a date, on one line."""

from __future__ import annotations

import re

from docutils import nodes
from sphinx.application import Sphinx

from acx4book.typesetting.myst import numbers

AS_IT_IS = (nodes.literal, nodes.literal_block, nodes.math, nodes.math_block, nodes.raw)
"""What a reader may copy into a program, or another program sets."""

TABLE, CELL = 'class="dataframe', re.compile(r"(?<=<td>)-(?=\d)")
"""A table of pandas, which is HTML, and what begins a negative number in it."""

STOPS = re.compile(r"[,.;:!?)]+")
"""What does not begin a line: a browser would let it, behind a formula."""

WITHOUT = ("_generated/",)
"""Beginnings of the names of pages about code."""

DATE = re.compile(r"\b(?:19|20)\d\d-[01]\d(?:-[0-3]\d)?(?![-\d])")
"""A date, or a year and its month."""


def is_set(text: nodes.Text) -> bool:
    """Tell whether a text is set: it is not, nor is it inside of, what stays as it is."""
    node = text.parent
    while node is not None:
        if isinstance(node, AS_IT_IS):
            return False
        node = node.parent
    return True


def set_numbers(_app: Sphinx, page: nodes.document, name: str) -> None:
    """Set the numbers of a page."""
    if name.startswith(WITHOUT):
        return
    for text in list(page.findall(nodes.Text)):
        said = DATE.sub(_on_one_line, numbers(text.astext()))
        if said != text.astext() and is_set(text):
            _put(text, said)
    for html in [raw for raw in page.findall(nodes.raw) if TABLE in raw.astext()]:
        html[:] = [nodes.Text(CELL.sub("\N{MINUS SIGN}", html.astext()))]


def _put(text: nodes.Text, said: str) -> None:
    """Put another text in the place of one; docutils would take the first that is equal."""
    siblings = text.parent.children
    at = next(i for i, node in enumerate(siblings) if node is text)
    text.parent[at] = nodes.Text(said)


def keep_stops(_app: Sphinx, page: nodes.document, name: str) -> None:
    """Keep what stands right behind a formula on its line."""
    if name.startswith(WITHOUT):
        return
    for formula in list(page.findall(nodes.math)):
        after = formula.next_node(descend=False, siblings=True)
        stop = STOPS.match(after.astext()) if isinstance(after, nodes.Text) else None
        if stop is None:
            continue
        _put(after, after.astext()[stop.end() :])
        kept = nodes.inline(classes=["one-line"])
        formula.replace_self(kept)
        kept += [formula, nodes.Text(stop[0])]


def _on_one_line(date: re.Match[str]) -> str:
    return date[0].replace("-", "\N{NON-BREAKING HYPHEN}")


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page when all its references are resolved."""
    app.connect("doctree-resolved", set_numbers)
    app.connect("doctree-resolved", keep_stops)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
