"""Figures as vector drawings: conversion to SVG, and embedding in pages."""

from __future__ import annotations

import base64
import html
import io
import re
from functools import cached_property

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG, RendererSVG
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from PIL import Image
from PIL import WebPImagePlugin as _  # noqa: F401 else Pillow loads every format that it knows

from acx4book.typesetting import style

# --- Figures as vector drawings: the same bytes every time, with no text of a flight in them
#
# Letters are outlines, so that they look alike on every machine. Colours are those of `style`;
# `inline` names each of these, so that a page can change them in the dark.


LOSSY = 20_000
"""Size from which a picture in a drawing is stored as lossy WebP, bytes of base64."""

QUALITY, EDGES = 40, 50
"""Quality of its colours and of its transparency, of 100."""

EFFORT, THOROUGH = 4, 6
"""Effort of WebP, of 6. Without loss, more effort takes 100 times as long and saves little."""

UNSEEN = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>|<defs>\s*<style.*?</defs>|\n", re.DOTALL)
NUMBER = re.compile(r"(?<![\w#.-])-?\d+\.\d{3,}(?:e-?\d+)?\b")
PICTURE = re.compile(r'(?<="data:image/)png;base64,([^"]*)')


def vector(figure: Figure) -> str:
    """Return a figure as SVG, beginning with the element ``svg``.

    It is as wide as the figure, or wider if a part extends beyond it, and as high as its content.

    Parameters
    ----------
    figure : Figure
        Its layout is fixed by the call.
    """
    buffer = io.StringIO()
    with mpl.rc_context({**style.RC, "figure.constrained_layout.use": False}):
        box = _lay_out(figure)
        figure.savefig(buffer, format="svg", metadata={"Date": None}, dpi=150, bbox_inches=box)
    drawn = buffer.getvalue()
    return _smaller(drawn[drawn.index("<svg") :])


def _lay_out(figure: Figure) -> Bbox:
    """Fix the layout, which avoids a second drawing, and return the visible part, inches."""
    canvas = _Canvas(figure)
    figure.dpi = canvas.fixed_dpi
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)  # matplotlib's empty engine would draw twice, too
    return style.shown_part(figure, figure.get_tightbbox())


class _Canvas(FigureCanvasSVG):
    """A canvas with a single renderer, which caches the sizes of texts."""

    @cached_property
    def _renderer(self) -> RendererSVG:
        return RendererSVG(*self.figure.bbox.size, io.StringIO())  # type: ignore[no-untyped-call]

    def get_renderer(self) -> RendererSVG:
        """Return the renderer of the canvas."""
        return self._renderer


def _smaller(svg: str) -> str:
    """Drop invisible parts and digits of an SVG of matplotlib, and store pictures as WebP."""
    parts = PICTURE.split(UNSEEN.sub("", svg).replace("xlink:href", "href"))
    for i, part in enumerate(parts):
        parts[i] = _stored(part) if i % 2 else NUMBER.sub(_rounded, part)
    return "".join(parts)


def _rounded(number: re.Match[str]) -> str:
    """Round a number to 0.01; below 1, where it may be a factor, to four digits."""
    value = float(number[0])
    return f"{value:.4g}" if abs(value) < 1 else f"{value:.2f}".rstrip("0").rstrip(".")


def _stored(png: str) -> str:
    """Convert a picture from PNG to WebP, both in base64."""
    picture, buffer = Image.open(io.BytesIO(base64.b64decode(png))), io.BytesIO()
    plain = len(png) < LOSSY
    if plain:
        picture.save(buffer, "WEBP", lossless=True, quality=100, method=EFFORT)
    else:
        picture.save(buffer, "WEBP", quality=QUALITY, alpha_quality=EDGES, method=THOROUGH)
    return f"webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"


# --- Drawings as part of a page, in the page's colours by day and by night


NAMES = style.NAMES | style.SCALES
COLOUR = re.compile("|".join(NAMES))
NAMED = re.compile(r'(\bid="|href="#|url\(#)(?!DejaVu[\w-]+")([\w.-]+)')
"""Names in a drawing, except those of glyphs, which are the same in all drawings."""

LETTER = re.compile(r'<path id="(DejaVu[\w-]+)" [^>]*/>')
SIZE = re.compile(r'<svg [^>]*?viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*>')
GROUND = re.compile(r'<g id="patch_1"><path [^>]*/></g>')
"""Background patch of a matplotlib figure."""

POINTS = 72 * style.WIDTH
"""Width of a figure that takes the whole column."""


def inline(svg: str, *, alt: str, name: str, known: set[str]) -> str:
    """Return a drawing as HTML for a page; the page's style sheet sets its colours.

    Parameters
    ----------
    svg : str
        As `svg.vector` makes it.
    alt : str
        Description of the drawing.
    name : str
        Prefix of all names in it, so that they are unique on the page.
    known : set of str
        Glyphs defined by drawings above it; its own are added.
    """
    width, height = SIZE.findall(svg)[0]
    share = min(1.0, float(width) / POINTS)
    begin = (
        f'<svg role="img" aria-label="{html.escape(alt)}" viewBox="0 0 {width} {height}" '
        f'style="width: {100 * share:.4g}%; min-width: {35 * share:.4g}rem; '
        'stroke-linejoin: round">'
    )
    inside = GROUND.sub("", SIZE.sub("", svg, count=1), count=1)
    coloured = COLOUR.sub(lambda match: f"var(--figure-{NAMES[match[0]]})", inside)
    lettered = LETTER.sub(lambda match: _once(match, known), coloured)
    names: dict[str, str] = {}
    named = NAMED.sub(
        lambda match: match[1] + names.setdefault(match[2], f"{name}{len(names)}"), lettered
    )
    return f'<div class="drawing" tabindex="0">{begin}{named}</div>'


def _once(letter: re.Match[str], known: set[str]) -> str:
    """Return the definition of a glyph, or nothing if the page already has it."""
    if letter[1] in known:
        return ""
    known.add(letter[1])
    return letter[0]
