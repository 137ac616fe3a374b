"""A drawing inside a page: its lines take the colours of the page, by day and by night."""

from __future__ import annotations

import html
import io
import re

import matplotlib as mpl
from matplotlib.figure import Figure

from acx4book.typesetting import style

VARIABLES = {
    style.INK: "ink",
    style.SOFT: "soft",
    style.BLUE: "blue",
    style.ORANGE: "orange",
    style.TEAL: "teal",
    style.PLUM: "plum",
    style.SKY: "sky",
    style.BRICK: "brick",
}
"""The colours that a page may change, by the names that its style sheet has for them."""


def inline(figure: Figure, *, alt: str, caption: str) -> str:
    """Return a drawing as MyST text with the SVG itself, whose colours are variables of CSS.

    Parameters
    ----------
    figure : Figure
    alt : str
        What is seen.
    caption : str
        Stands below.
    """
    file = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": "acx4lib"}):
        figure.savefig(
            file, format="svg", transparent=True, bbox_inches="tight", metadata={"Date": None}
        )
    svg = re.sub(r"<metadata>.*?</metadata>\s*", "", file.getvalue(), flags=re.DOTALL)
    svg = svg[svg.index("<svg") :].rstrip()
    for colour, name in VARIABLES.items():
        svg = svg.replace(colour, f"var(--drawing-{name}, {colour})")
    svg = svg.replace("<svg", f'<svg role="img" aria-label="{_escaped(alt)}"', 1)
    return (
        f'```{{raw}} html\n<figure class="drawing">\n{svg}\n'
        f"<figcaption>{_escaped(caption)}</figcaption>\n</figure>\n```\n"
    )


def _escaped(text: str) -> str:
    """Return text for HTML that stands in a block of MyST, which a backtick might end."""
    return html.escape(text).replace("`", "&#96;")
