"""Markdown of the notebooks as HTML, with the part of MyST used in their cells.

Tables and figures are numbered in their order; text of a user's flight is escaped.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from markdown_it import MarkdownIt
from markdown_it.common.utils import escapeHtml
from markdown_it.rules_inline import StateInline

from acx4book.typesetting.myst import numbers

ROLE = re.compile(r"\{(numref|eq|doc)\}`([^`\n]+)`")
MATH = re.compile(r"\$([^$\n]+)\$")
NAME = re.compile(r"^:name: (\S+)\n+", re.MULTILINE)
SCRIPTS = re.compile(r"([_^])(?:\{([^{}]*)\}|(.))|([^_^]+)")
GREEK = {
    "alpha": "α",
    "chi": "χ",
    "kappa": "κ",
    "omega": "ω",
    "sigma": "σ",
    "varphi": "φ",
}
STATE = re.compile(r"<td([^>]*)>(✓|✗|•) (\w+)</td>")
VERDICT = "tab-report-verdict"
"""The table with marked answers."""

STATES = {"✓": "holds", "✗": "fails", "•": "note"}


@dataclass(kw_only=True)
class Document:
    """The labels and counters of a document while it is written.

    Attributes
    ----------
    numbers : dict of str to str
        ``Table 3`` and ``Figure 2`` by label.
    n_tables, n_figures : int
        Numbers of tables and figures so far.
    """

    numbers: dict[str, str] = field(default_factory=dict)
    n_tables: int = 0
    n_figures: int = 0


def number_labels(labels: Sequence[str]) -> dict[str, str]:
    """Return the text of a reference to each label; labels are in the order of the document."""
    tables = [label for label in labels if label.startswith("tab-")]
    figures = [label for label in labels if label.startswith("fig-")]
    return {
        **{label: f"Table {i}" for i, label in enumerate(tables, 1)},
        **{label: f"Figure {i}" for i, label in enumerate(figures, 1)},
    }


def table_labels(text: str) -> list[str]:
    """Return the labels of the tables in a Markdown text."""
    return NAME.findall(text)


def to_html(text: str, document: Document) -> str:
    """Return Markdown as HTML.

    Parameters
    ----------
    text : str
        CommonMark with tables, the directive ``table``, the roles ``numref`` and ``eq``, and
        simple mathematics between dollars. Raw HTML is shown as text.
    document : Document
        Its counters are increased.
    """
    rendered: str = _parser().render(text, {"document": document})
    return rendered


def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.inline.ruler.before("escape", "acx4", _inline)
    parser.add_render_rule("acx4", _as_it_is)
    parser.add_render_rule("fence", _fence)
    parser.add_render_rule("text", _text)
    return parser


def _inline(state: StateInline, silent: bool) -> bool:
    """Parse mathematics and roles in the text."""
    for pattern in (ROLE, MATH):
        match = pattern.match(state.src, state.pos)
        if match is None:
            continue
        if not silent:
            token = state.push("acx4", "", 0)
            token.content = (
                _mathematics(match[1])
                if pattern is MATH
                else _reference(match[1], match[2], state.env["document"])
            )
        state.pos = match.end()
        return True
    return False


def _reference(role: str, target: str, document: Document) -> str:
    if role == "eq":
        return f"({html.escape(target.removeprefix('eq-'))})"
    return html.escape(document.numbers.get(target, target))


def _mathematics(source: str) -> str:
    """Return simple TeX as HTML: letters in italics, Greek letters, subscripts and superscripts."""
    text = re.sub(r"\\([A-Za-z]+) ?", lambda m: GREEK.get(m[1], m[1]), source)
    text = text.replace("-", "\N{MINUS SIGN}")
    out = []
    for sign, braced, single, plain in SCRIPTS.findall(text):
        tag = {"_": "sub", "^": "sup"}.get(sign)
        inner = _italic(braced or single or plain)
        out.append(f"<{tag}>{inner}</{tag}>" if tag else inner)
    return "".join(out)


def _italic(text: str) -> str:
    return "".join(f"<i>{c}</i>" if c.isalpha() else html.escape(c) for c in text)


def _as_it_is(_self: Any, tokens: Sequence[Any], idx: int, _options: Any, _env: Any) -> str:
    content: str = tokens[idx].content
    return content


def _text(_self: Any, tokens: Sequence[Any], idx: int, _options: Any, _env: Any) -> str:
    return escapeHtml(numbers(tokens[idx].content))


def _fence(_self: Any, tokens: Sequence[Any], idx: int, _options: Any, env: Any) -> str:
    """Render the directive ``table``; any other fence as code."""
    token = tokens[idx]
    if not token.info.startswith("{table}"):
        return f"<pre><code>{html.escape(token.content)}</code></pre>\n"
    document: Document = env["document"]
    document.n_tables += 1
    name = "".join(NAME.findall(token.content)[:1])
    inner = _parser().render(NAME.sub("", token.content), env)
    caption = _parser().renderInline(token.info.removeprefix("{table}").strip(), env)
    if name == VERDICT:  # in other tables a name may look like an answer
        inner = STATE.sub(
            lambda m: f'<td{m[1]} class="state {STATES[m[2]]}">{m[2]}&nbsp;{m[3]}</td>', inner
        )
    head = f"<caption><b>Table {document.n_tables}.</b> {caption}</caption>"
    return inner.replace("<table>", f'<table id="{html.escape(name)}">{head}', 1)
