"""Figures as vector drawings: the same bytes every time, small, with no text of a flight in them.

Letters are outlines, so that they look alike on every machine. Colours are those of `style`;
`inline` names each of these, so that a page can change them in the dark.
"""

from __future__ import annotations

import base64
import io
import re
from functools import cached_property
from xml.etree import ElementTree as ET

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG, RendererSVG
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from PIL import Image
from PIL import WebPImagePlugin as _  # noqa: F401 else Pillow loads every format that it knows

from acx4book.typesetting import style
from acx4book.typesetting.drawing import compact

LOSSY = 20_000
"""Bytes from which a picture inside a drawing is stored with the loss of WebP."""

QUALITY, EDGES = 50, 50
"""Of its colours, and of where it is transparent, of 100."""

EFFORT, THOROUGH = 4, 6
"""Of WebP, of 6. Without loss, more takes a hundred times as long and saves a few bytes."""

UNSEEN = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>", re.DOTALL)
NUMBER = re.compile(r"(?<![\w#.-])-?\d+\.\d{3,}(?:e-?\d+)?\b")
PICTURE = re.compile(r'(?<="data:image/)png;base64,([^"]*)')


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
    canvas = _Canvas(figure)
    figure.dpi = canvas.fixed_dpi
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)  # one of matplotlib's that does nothing draws twice as well
    return style.shown_part(figure, figure.get_tightbbox())


class _Canvas(FigureCanvasSVG):
    """A canvas that measures text as it is drawn, all with one renderer, which knows it again."""

    @cached_property
    def _renderer(self) -> RendererSVG:
        return RendererSVG(*self.figure.bbox.size, io.StringIO())  # type: ignore[no-untyped-call]

    def get_renderer(self) -> RendererSVG:
        """Return the renderer that a figure asks its canvas for."""
        return self._renderer


def smaller(svg: str) -> str:
    """Return SVG of matplotlib without what nobody sees, and with pictures as WebP."""
    seen = UNSEEN.sub("", svg).replace("xlink:href", "href")
    parts = PICTURE.split(seen)
    for i, part in enumerate(parts):
        parts[i] = _stored(part) if i % 2 else NUMBER.sub(_rounded, part)
    root = ET.fromstring("".join(parts))
    compact.compact(root)
    return ET.tostring(root, encoding="unicode").replace(" />", "/>")


def _rounded(number: re.Match[str]) -> str:
    """Return a number to a hundredth, and one below 1, which may be a factor, to four digits."""
    value = float(number[0])
    return f"{value:.4g}" if abs(value) < 1 else f"{value:.2f}".rstrip("0").rstrip(".")


def _stored(png: str) -> str:
    """Return a picture, PNG in text, as WebP in text."""
    picture, buffer = Image.open(io.BytesIO(base64.b64decode(png))), io.BytesIO()
    plain = len(png) < LOSSY
    if plain:
        picture.save(buffer, "WEBP", lossless=True, quality=100, method=EFFORT)
    else:
        picture.save(buffer, "WEBP", quality=QUALITY, alpha_quality=EDGES, method=THOROUGH)
    return f"webp;base64,{base64.b64encode(buffer.getvalue()).decode()}"
