"""Text of the report: names and tables in Markdown, and the HTML that is made of Markdown.

Of MyST the part is known that the cells of notebooks use. Tables and figures are numbered in their
order; text of a user's flight is escaped.
"""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from markdown_it import MarkdownIt
from markdown_it.common.utils import escapeHtml
from markdown_it.rules_inline import StateInline

from acx4book.typesetting.myst import LABELS, TITLES, inside, myst_table, numbers

# --- names and short texts -------------------------------------------------------------------


STAGES = {"heads": "head", "mounting": "", "validation": "validation,", "synthetic": "synthetic"}

_DRIFT = re.compile(r"gnss_drift_(.+)_(east|north|height)_m_per_(?:min|exposure)", re.DOTALL)


def adjustment_title(name: str) -> str:
    """Return the title for readers of ``stage/method`` or ``heads/bundle/CAM1``."""
    stage, method, *camera = name.split("/", 2)
    if stage == "heads":
        return f"head {camera[0]}" if camera else method.replace("_", " ")
    title = TITLES.get(method, method.replace("_", " "))
    return " ".join([STAGES[stage], inside(title)]).strip()


def heading(name: str) -> str:
    """Return the title of an adjustment for the beginning of a line."""
    return begun(adjustment_title(name))


def begun(text: str) -> str:
    """Return a text with a capital at its beginning; the rest does not change."""
    return text[:1].upper() + text[1:]


def parameter_title(name: str) -> str:
    """Return the title for readers of ``camera/parameter``, or of a parameter alone."""
    if drift := _DRIFT.fullmatch(name):
        return f"GNSS drift of strip {drift[1]}, {drift[2]}"
    return LABELS.get(name.rpartition("/")[2], name)


def listed(names: Sequence[str]) -> str:
    """Return names as part of a sentence: a, b and c."""
    return " and ".join([part for part in (", ".join(names[:-1]), *names[-1:]) if part])


def plural(n: int, noun: str) -> str:
    """Return a number with its noun; zero as a word."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}" if n else f"no {noun}s"


# --- What the parts of the report show beside figures: texts with tables


FORMATS = {
    "σ₀²": ".3f",
    "p": ".3g",
    "Redundancy": ",.0f",
    "Observations": ",",
    "Unknowns": ",",
    "Expected by chance": ".1f",
    "Found and rejected": ",",
    "Number": ",",
    "A priori σ": ",.9g",
    "A posteriori σ": ",.9g",
    "Detectable, median": ",.9g",
    "Detectable, largest": ",.9g",
    "Ratio": ".2f",
    "Mean redundancy": ".2f",
    "Below 0.1": ",",
    "t": ".1f",
    "Largest single t": ".1f",
    "F": ".1f",
    "Mean (m)": "+.3f",
    "Std (m)": ".3f",
    "RMS (m)": ".3f",
    "Predicted (m)": ".3f",
    "Mean / σ": ".1f",
    "σ in plan (m)": ".3f",
    "σ in height (m)": ".3f",
    "in plan (%)": "z.1f",
    "in height (%)": "z.1f",
    "p of the drift": ".2g",
    "p of the strips": ".2g",
}
"""Formats of the numbers, by the name of the column."""

OBTAINED = "How obtained"
"""First words of the line on the source of a table's numbers."""


@dataclass(frozen=True, repr=False)
class Text:
    """Markdown of a part of the report."""

    markdown: str


def table(frame: pd.DataFrame, caption: str, *, name: str, obtained: str = "") -> str:
    """Return a table with its caption and how its numbers were obtained.

    A table without rows is a sentence.
    """
    if frame.empty:
        return f"{caption}: this run has none."
    formats = {column: FORMATS[column] for column in frame.columns if column in FORMATS}
    numbers = frame.columns[frame.columns.str.startswith("w (")]
    drawn = myst_table(
        frame, caption, name=name, formats={**formats, **dict.fromkeys(numbers, ".1f")}
    )
    return f"{drawn}\n\n*{OBTAINED}: {obtained}*" if obtained else drawn


def show(*parts: str) -> Text:
    """Return sentences and tables as the output of a cell."""
    return Text("\n\n".join(part for part in parts if part))


# --- Markdown of the notebooks as HTML -------------------------------------------------------


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
STATE = re.compile(r"<td([^>]*)>(✓|≈|✗|–|•) (\w+|not tested|rejected, below [\w ,.%]+)</td>")
VERDICT = "tab-report-verdict"
"""The table with marked answers."""

STATES = {"✓": "holds", "≈": "minor", "✗": "fails", "–": "untested", "•": "note"}


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
