"""One line under every figure and table: the notebook, the flight, the commit, and the code.

Under one that is made of stored numbers stands the commit at which these were computed.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

MADE_FROM = Path("_generated", "made_from.json")
"""The commit, and the names of the flights by page; in the folder of the book."""

OTHER_PAGES = {
    "certificate": "acx4book.pages.build.certificate_page",
    "scorecard": "acx4book.paper.scorecard.texts",
    "speed": "acx4book.pages.benchmarks.speed.text",
    "coverage": "acx4book.pages.benchmarks.sigma.page",
    "reproducibility": "acx4book.pages.reproducibility.page",
    "frames-and-notation": "acx4book.pages.frames.draw",
}
"""What made the figures and tables of the pages that are no notebooks."""


def tell(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Put the lines into a page."""
    facts = Path(app.srcdir) / MADE_FROM
    if not facts.is_file():
        return
    known = json.loads(facts.read_text("utf-8"))
    flight = known["flights"].get(page.removeprefix("_executed/"), "")
    told = [f"flight {flight}"] if flight else []
    told.append(known.get("made_by") or f"commit {known['commit']}")
    stored = known.get("stored", {})
    if page in OTHER_PAGES:
        for shown in _numbered(doctree):
            _write(app, page, shown, ["", *_of(shown, told, stored)], OTHER_PAGES[page])
    elif app.env.doc2path(page).endswith(".ipynb"):
        cells = json.loads(Path(app.env.doc2path(page)).read_text("utf-8"))["cells"]
        for cell in doctree.findall(lambda node: "cell_index" in getattr(node, "attributes", ())):
            number = cell["cell_index"]
            told[:0] = [f"{Path(page).name}.ipynb, cell {number + 1}"]
            for shown in _numbered(cell):
                made_by = _code(cells, number, table=_is_table(shown))
                _write(app, page, shown, _of(shown, told, stored), made_by)
            del told[0]


def _numbered(node: nodes.Element) -> list[nodes.Element]:
    """Return the figures and tables with a caption."""
    both = node.findall(lambda n: isinstance(n, nodes.figure | nodes.table))
    return [n for n in both if any(isinstance(c, nodes.caption | nodes.title) for c in n.children)]


def _of(shown: nodes.Element, told: list[str], stored: Mapping[str, str]) -> list[str]:
    """Put the commit of stored numbers in the place of flight and commit of the page."""
    labels = [label for label in stored for name in shown["ids"] if name.startswith(label)]
    if not labels:
        return told
    notebook = [text for text in told if ".ipynb" in text]
    return [*notebook, stored[max(labels, key=len)]]


def _is_table(node: nodes.Element) -> bool:
    return isinstance(node, nodes.table)


def _write(app: Sphinx, page: str, shown: nodes.Element, told: list[str], function: str) -> None:
    line = nodes.paragraph("", " · ".join(filter(None, told)), classes=["provenance"])
    target = app.env.domaindata["py"]["objects"].get(function)
    if target is not None:
        address = f"{app.builder.get_relative_uri(page, target.docname)}#{target.node_id}"
        name = function.removeprefix("acx4book.")
        line += [nodes.Text(" · "), nodes.reference("", name, refuri=address, internal=True)]
    if _is_table(shown):
        shown.parent.insert(shown.parent.index(shown) + 1, line)
    else:
        shown += nodes.legend("", line)


# --- the function that made something --------------------------------------------------------


def _code(cells: list[Mapping[str, Any]], number: int, *, table: bool) -> str:
    """Return the name of the function of the book that a cell shows the value of."""
    sources = ["".join(c["source"]) for c in cells[: number + 1] if c["cell_type"] == "code"]
    modules = dict(pair for source in sources for pair in _imported(source))
    called = [*_called(ast.parse(sources[-1]), modules)]
    own = [name for name in called if not name.startswith("acx4book.typesetting.myst")]
    if table:
        own.sort(key=lambda name: "table" not in name)
    return own[0] if own else ""


def _imported(source: str) -> Iterator[tuple[str, str]]:
    for statement in ast.walk(ast.parse(source)):
        if isinstance(statement, ast.ImportFrom) and statement.module:
            for alias in statement.names:
                yield alias.asname or alias.name, f"{statement.module}.{alias.name}"


def _called(cell: ast.Module, modules: Mapping[str, str]) -> Iterator[str]:
    """Yield the functions of the book that a cell calls, from its last statement on."""
    for statement in reversed(cell.body):
        for node in ast.walk(statement):
            if isinstance(node, ast.Call):
                name, _, rest = ast.unparse(node.func).partition(".")
                whole = f"{modules.get(name, name)}{'.' if rest else ''}{rest}"
                if whole.startswith("acx4book."):
                    yield whole


def setup(app: Sphinx) -> dict[str, bool]:
    """Work on a page when its references are resolved."""
    app.connect("doctree-resolved", tell)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
