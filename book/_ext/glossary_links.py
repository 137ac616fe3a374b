"""Link the first use of every term of the glossary on a page to its definition.

Linked is running text alone: no headings, links, code, formulas, captions or heads of tables. Pages
of the programming interface have names, and no terms.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

PLAIN = (
    *(nodes.title, nodes.reference, nodes.literal, nodes.literal_block, nodes.math),
    *(nodes.math_block, nodes.raw, nodes.caption, nodes.thead, nodes.term, nodes.inline),
)
"""What a term is not linked in; inline text are references that wait, and parts of figures."""

WITHOUT = ("_generated/",)
"""Beginnings of the names of pages whose terms are not linked."""

Targets = dict[str, tuple[str, str]]
"""The page and the anchor of every term."""


def targets(env: BuildEnvironment) -> Targets:
    """Return where every term is defined."""
    objects = env.get_domain("std").get_objects()
    return {name: (page, anchor) for name, _, kind, page, anchor, _ in objects if kind == "term"}


def pattern(terms: Targets) -> re.Pattern[str]:
    """Return what finds terms, the longest first, also in the plural and at a line's end."""
    longest = sorted(terms, key=lambda term: (-len(term), term))
    words = (r"\s+".join(map(re.escape, term.split())) for term in longest)
    return re.compile(rf"(?<![\w./-])({'|'.join(words)})(?:e?s)?(?![\w-]|\.\w)", re.IGNORECASE)


def term_of(found: str, terms: Targets) -> str | None:
    """Return the term that a text is; what is written in capitals is a term only in capitals."""
    said = " ".join(found.split())
    meant = {term.lower(): term for term in terms}[said.lower()]
    return meant if not meant.isupper() or said.isupper() else None


def pieces(text: str, terms: Targets, left: set[str]) -> Iterator[str | tuple[str, str]]:
    """Yield a text in pieces: plain ones, and pairs of a text and the term that it is.

    Terms are taken out of those that are left, so that each is found once.
    """
    begun = 0
    for match in pattern(terms).finditer(text):
        term = term_of(match[1], terms)
        if term in left:
            left.remove(term)
            yield text[begun : match.start()]
            yield match[0], term
            begun = match.end()
    yield text[begun:]


def running(page: nodes.document) -> Iterator[nodes.Text]:
    """Yield the running text of a page."""
    for text in list(page.findall(nodes.Text)):
        above, inside = text.parent, []
        while above is not None:
            inside.append(above)
            above = above.parent
        if not any(isinstance(node, PLAIN) for node in inside) and any(
            isinstance(node, nodes.paragraph) for node in inside
        ):
            yield text


def link(app: Sphinx, page: nodes.document, name: str) -> None:
    """Link the terms of a page."""
    terms = targets(app.env)
    if not terms or name.startswith(WITHOUT) or name in {where for where, _ in terms.values()}:
        return
    left = set(terms)
    for text in running(page):
        parts = list(pieces(text.astext(), terms, left))
        if len(parts) > 1:
            text.parent.replace(text, [_node(app, name, part, terms) for part in parts if part])


def _node(app: Sphinx, name: str, part: str | tuple[str, str], terms: Targets) -> nodes.Node:
    if isinstance(part, str):
        return nodes.Text(part)
    said, term = part
    where, anchor = terms[term]
    address = f"{app.builder.get_relative_uri(name, where)}#{anchor}"
    return nodes.reference("", said, internal=True, refuri=address, classes=["glossary-term"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page when all its references are resolved."""
    app.connect("doctree-resolved", link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
