"""Figures as vector drawings: the same bytes every time, small, with no text of a flight in them.

Letters are outlines, so that they look alike on every machine. Colours are those of `style`;
`inline` gives each of these a name, by which a page changes them in the dark.
"""

from __future__ import annotations

import base64
import html
import io
import re

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from PIL import Image

from acx4book.typesetting import style

MARGIN = 0.04
"""Free space above and below a drawing, inches."""

LOSSY = 60_000
"""Bytes from which a picture inside a drawing is stored with the loss of WebP at `QUALITY`."""

QUALITY = 82

SPACE = re.compile(r"\s+")
UNSEEN = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>", re.DOTALL)
NUMBER = re.compile(r"(?<![\w#.-])-?\d+\.\d{3,}(?:e-?\d+)?\b")
PICTURE = re.compile(r'(?<="data:image/)png;base64,([^"]*)')

COLOUR = re.compile("|".join(style.NAMES))
NAMED = re.compile(r'(\bid="|href="#|url\(#)')
SIZE = re.compile(r'<svg [^>]*?viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*>')
GROUND = re.compile(r'<g id="patch_1"><path [^>]*/></g>')
"""The sheet that matplotlib puts under a figure."""

POINTS = 72 * style.WIDTH
"""Width of a figure that takes the whole column."""


def vector(figure: Figure) -> str:
    """Return a figure as SVG, beginning with its element.

    It is as wide as the figure, wider where something reaches out of it, and as high as what it
    shows.

    Parameters
    ----------
    figure : Figure
        Its axes are placed for good.
    """
    buffer = io.StringIO()
    with mpl.rc_context({**style.RC, "figure.constrained_layout.use": False}):
        box = _lay_out(figure)
        figure.savefig(buffer, format="svg", metadata={"Date": None}, dpi=150, bbox_inches=box)
    drawn = buffer.getvalue()
    return smaller(drawn[drawn.index("<svg") :])


def _lay_out(figure: Figure) -> Bbox:
    """Place the axes, else the figure would be drawn twice, and return what is shown, inches."""
    canvas = FigureCanvasSVG(figure)  # that measures text as it is drawn
    figure.dpi = canvas.fixed_dpi
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    box = figure.get_tightbbox()
    left, right = min(0.0, box.x0), max(figure.get_figwidth(), box.x1)
    return Bbox([[left, box.y0 - MARGIN], [right, box.y1 + MARGIN]])


def smaller(svg: str) -> str:
    """Return SVG of matplotlib without what nobody sees: comments, spaces, digits after the 2nd."""
    seen = SPACE.sub(" ", UNSEEN.sub("", svg)).replace("> <", "><").replace("xlink:href", "href")
    parts = PICTURE.split(seen)
    for i, part in enumerate(parts):
        parts[i] = _stored(part) if i % 2 else NUMBER.sub(_rounded, part)
    return "".join(parts)


def _rounded(number: re.Match[str]) -> str:
    """Return a number to a hundredth, and one below 1, which may be a factor, to four digits."""
    value = float(number[0])
    return f"{value:.4g}" if abs(value) < 1 else f"{value:.2f}".rstrip("0").rstrip(".")


def _stored(png: str) -> str:
    """Return a picture, PNG in text, as WebP in text."""
    picture, buffer = Image.open(io.BytesIO(base64.b64decode(png))), io.BytesIO()
    plain = len(png) < LOSSY
    picture.save(buffer, "WEBP", lossless=plain, quality=100 if plain else QUALITY, method=6)
    return f"webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"


def inline(svg: str, *, alt: str, name: str) -> str:
    """Return a drawing as part of a page, in the page's colours by day and by night.

    Parameters
    ----------
    svg : str
        As `vector` makes it.
    alt : str
        What is seen.
    name : str
        Beginning of all names in it, so that they are unique on the page.
    """
    width, height = SIZE.findall(svg)[0]
    share = min(1.0, float(width) / POINTS)
    begin = (
        f'<svg role="img" aria-label="{html.escape(alt)}" viewBox="0 0 {width} {height}" '
        f'style="width: {100 * share:.4g}%; min-width: {35 * share:.4g}rem">'
    )
    inside = GROUND.sub("", SIZE.sub("", svg, count=1), count=1)
    coloured = COLOUR.sub(lambda found: f"var(--figure-{style.NAMES[found[0]]})", inside)
    named = NAMED.sub(lambda found: found[0] + name, coloured)
    return f'<div class="drawing" tabindex="0">{begin}{named}</div>'
