"""An explorer as HTML: complete as it stands, and the data with which the script moves it."""

from __future__ import annotations

import json
from html import escape
from typing import Any

from acx4book.typesetting.moving import plane
from acx4book.typesetting.moving.explorer import Explorer, Panel
from acx4book.typesetting.moving.explorer import shown as number


class Shown:
    """What a notebook's cell returns to show HTML; other outputs have the text.

    Parameters
    ----------
    html : str
    text : str
        For readers of the notebook in a terminal.
    """

    def __init__(self, html: str, text: str) -> None:
        self.html, self.text = html, text

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.text


def explorer(shown: Explorer) -> Shown:
    """Return an explorer for a page."""
    return Shown(html(shown), shown.caption)


def html(shown: Explorer) -> str:
    """Return the HTML of an explorer."""
    panels = "".join(_panel(panel, shown) for panel in shown.panels)
    narrow = min(panel.size[0] for panel in shown.panels) * 0.86
    return (
        f'<figure class="acx4-explorer" id="{shown.name}">'
        f'<div class="panels" style="--narrow: {narrow:.0f}px">{panels}</div>'
        f'<div class="sliders">{_values(shown)}</div>'
        f'<div class="readings" role="group" aria-label="readings" tabindex="0" aria-live="polite">'
        f"{_table(shown)}</div>"
        f"<figcaption>{escape(shown.caption)}</figcaption>{data(shown.data())}</figure>"
    )


def data(content: dict[str, Any]) -> str:
    """Return data inside a page, in which nothing ends the element or begins another."""
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json">{text}</script>'


def _panel(panel: Panel, shown: Explorer) -> str:
    marks = "".join(plane.mark(mark, shown.start) for mark in panel.marks)
    width, height = panel.size
    return (
        f'<div class="panel"><div class="title">{escape(panel.title)}</div>'
        f'<svg viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img"'
        f' aria-label="{escape(panel.alt)}">{panel.fixed}<g class="marks">{marks}</g></svg></div>'
    )


def _values(shown: Explorer) -> str:
    items = (
        f"<li>{escape(slider.name)} = {number(value, slider.digits)}{slider.after}</li>"
        for slider, value in zip(shown.sliders, shown.start, strict=True)
    )
    return f"<ul>{''.join(items)}</ul>"


def _table(shown: Explorer) -> str:
    head = "".join(f'<th scope="col">{escape(column.title)}</th>' for column in shown.columns)
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th>{"".join(f"<td>{x}</td>" for x in numbers)}</tr>'
        for name, numbers in zip(shown.rows, shown.readings(shown.start), strict=True)
    )
    return (
        f'<table class="table"><thead><tr><td></td>{head}</tr></thead><tbody>{rows}</tbody></table>'
    )
