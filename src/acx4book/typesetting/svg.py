"""Figures as vector drawings: conversion to SVG, compaction, and embedding in pages."""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Iterator
from functools import cache, cached_property
from itertools import groupby, pairwise
from xml.etree import ElementTree as ET
from xml.etree.ElementTree import Element

import matplotlib as mpl
from matplotlib.backends.backend_svg import FigureCanvasSVG, RendererSVG
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox
from PIL import Image
from PIL import WebPImagePlugin as _  # noqa: F401 else Pillow loads every format that it knows

from acx4book.typesetting import style

# --- Figures as vector drawings: the same bytes every time, small, with no text of a flight
# in them
#
# Letters are outlines, so that they look alike on every machine. Colours are those of `style`;
# `inline` names each of these, so that a page can change them in the dark.


LOSSY = 20_000
"""Size from which a picture in a drawing is stored as lossy WebP, bytes of base64."""

QUALITY, EDGES = 40, 50
"""Quality of its colours and of its transparency, of 100."""

EFFORT, THOROUGH = 4, 6
"""Effort of WebP, of 6. Without loss, more effort takes 100 times as long and saves little."""

UNSEEN = re.compile(r"<!--.*?-->|<metadata>.*?</metadata>", re.DOTALL)
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
    return smaller(drawn[drawn.index("<svg") :])


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


def smaller(svg: str) -> str:
    """Compact an SVG of matplotlib: drop invisible parts, store pictures as WebP."""
    visible = UNSEEN.sub("", svg).replace("xlink:href", "href")
    parts = PICTURE.split(visible)
    for i, part in enumerate(parts):
        parts[i] = _stored(part) if i % 2 else NUMBER.sub(_rounded, part)
    root = ET.fromstring("".join(parts))
    _compact(root)
    return ET.tostring(root, encoding="unicode").replace(" />", "/>")


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
NAMED = re.compile(r'(\bid="|href="#|url\(#)(?!D[\w-]+")([\w.-]+)')
"""Names in a drawing, except those of glyphs, which are the same in all drawings."""

LETTER = re.compile(r'<path id="(D[\w-]+)" [^>]*/>')
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
        f'style="width: {100 * share:.4g}%; min-width: {35 * share:.4g}rem">'
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


# --- A drawing written shorter: the same marks in the same order, to a hundredth of a point
#
# Unused names and groups without attributes are left out. Common attributes of neighbours move to
# a group around them. Paths are written relative to the last point.


SVG = "http://www.w3.org/2000/svg"
ET.register_namespace("", SVG)

_GROUND = "patch_1"
"""Name of the background patch of a figure, which a page removes."""

REFERENCE = re.compile(r"#([\w.-]+)")
FONT, SHORT = "DejaVuSans-", "D"
"""Prefix of the names of glyphs, and its short form."""

COMMON = ("style", "clip-path")
"""Attributes that a group may have for its children."""

OF_GROUPS = re.compile(r"(?<!-)\bopacity")
"""Style properties with another effect on a group than on each of its children."""

JOINED = "stroke-linejoin: round"
"""Rule of matplotlib's style sheet, which would affect the page around the drawing, too."""

PLACE = re.compile(r"translate\((-?[\d.]+)[ ,]+(-?[\d.]+)\)")
STEP = re.compile(r"[A-Za-z]|-?\d*\.?\d+(?:e-?\d+)?")
_POINTS = {"M": 1, "L": 1, "Q": 2, "C": 3}
"""Number of points after a path command; matplotlib writes only these and z."""


def _compact(root: Element) -> None:
    """Compact a drawing of matplotlib without texts, in place."""
    _drop_styles(root)
    _drop_repeated(root)
    used = {name for element in root.iter() for name in _references(element)}
    for element in root.iter():
        element.text = element.tail = None
        if element.get("id") not in {*used, _GROUND}:
            element.attrib.pop("id", None)
        for key, value in element.items():
            element.set(key, value.replace(FONT, SHORT) if key != "d" else _path(value))
        _place(element)
    _group(root)


def _references(element: Element) -> Iterator[str]:
    for key, value in element.items():
        if key == "href" or "url(" in value:
            yield from REFERENCE.findall(value)


def _drop_styles(root: Element) -> None:
    """Replace style sheets by a style of the outermost group."""
    for parent in root.iter():
        for child in [c for c in parent if c.tag == f"{{{SVG}}}style"]:
            parent.remove(child)
    for group in root.findall(f"{{{SVG}}}g"):
        group.set("style", JOINED)


def _drop_repeated(root: Element) -> None:
    """Remove line and fill styles from a use if its mark sets them, too: the mark's count."""
    marks = {
        f"#{element.get('id')}": dict(_properties(element))
        for element in root.iter()
        if element.get("id")
    }
    for use in root.iter(f"{{{SVG}}}use"):
        inherited = marks.get(use.get("href", ""), {})
        kept = [
            f"{name}:{value}"
            for name, value in _properties(use)
            if name not in inherited or not name.startswith(("fill", "stroke"))
        ]
        use.attrib.pop("style", None)
        use.attrib.update({"style": "; ".join(kept)} if kept else {})


def _properties(element: Element) -> Iterator[tuple[str, str]]:
    """Yield the style properties of an element and their values."""
    for part in filter(None, element.get("style", "").split("; ")):
        name, value = part.split(":", 1)
        yield name, value


def _place(element: Element) -> None:
    """Write the position of a glyph as whole numbers, hundredths of its size, without transform."""
    place = PLACE.fullmatch(element.get("transform", ""))
    if element.tag == f"{{{SVG}}}use" and place:
        del element.attrib["transform"]
        for key, number in zip("xy", place.groups(), strict=True):
            if round(float(number)):
                element.set(key, f"{float(number):.0f}")


# --- groups ----------------------------------------------------------------------------------


def _group(parent: Element) -> None:
    """Dissolve groups without attributes, and group neighbours with common attributes."""
    for child in parent:
        _group(child)
    children = [inside for child in parent for inside in _opened(child)]
    parent[:] = [part for _same, run in groupby(children, _common) for part in _together([*run])]
    if len(parent) == 1 and parent.tag == parent[0].tag == f"{{{SVG}}}g" and _free(parent):
        (only,) = parent
        parent.attrib.update(only.attrib)
        parent[:] = [*only]


def _free(group: Element) -> bool:
    """Tell whether a group can take over all attributes of its only child."""
    return not ({*group[0].keys()} & {*group.keys()}) and "transform" not in group[0].attrib


def _opened(element: Element) -> list[Element]:
    """Replace a group without attributes by its children."""
    empty = element.tag in {f"{{{SVG}}}g", f"{{{SVG}}}defs"} and not len(element)
    if empty:
        return []
    return [*element] if element.tag == f"{{{SVG}}}g" and not element.attrib else [element]


def _common(element: Element) -> tuple[str, ...]:
    """Return the attributes an element may share with its neighbours; empty if none."""
    shared = tuple(element.get(key, "") for key in COMMON)
    moved = "transform" in element.attrib and "clip-path" in element.attrib
    named = "id" in element.attrib or element.tag == f"{{{SVG}}}clipPath"
    return ("", "") if moved or named or OF_GROUPS.search(shared[0]) else shared


def _together(run: list[Element]) -> list[Element]:
    """Put elements with shared attributes in a group; return them unchanged if there are none."""
    shared = {key: value for key, value in zip(COMMON, _common(run[0]), strict=True) if value}
    if len(run) == 1 or not shared:
        return run
    for element in run:
        for key in shared:
            del element.attrib[key]
    group = Element(f"{{{SVG}}}g", shared)
    group.extend(inside for element in run for inside in _opened(element))
    return [group]


# --- paths -----------------------------------------------------------------------------------


def _path(d: str) -> str:
    """Return path data relative to the last point, in hundredths without accumulated rounding."""
    numbers, letter, last, start = [], "", (0, 0), (0, 0)
    written: list[str] = []
    for step in STEP.findall(d):
        if step in "zZ":
            written.append("z")
            last = start
        elif step.isalpha():
            letter = step
        else:
            numbers.append(round(100 * float(step)))
        if letter in _POINTS and len(numbers) == 2 * _POINTS[letter]:
            written.append(_step(letter, numbers, last))
            last = (numbers[-2], numbers[-1])
            start = last if letter == "M" else start
            letter, numbers = "L" if letter == "M" else letter, []
    return _joined(written)


def _step(letter: str, numbers: list[int], last: tuple[int, int]) -> str:
    """Return one step, relative to the last point."""
    if letter == "L" and numbers[1] == last[1]:
        return f"h{_number(numbers[0] - last[0])}"
    if letter == "L" and numbers[0] == last[0]:
        return f"v{_number(numbers[1] - last[1])}"
    parts = [_number(n - last[i % 2]) for i, n in enumerate(numbers)]
    text = parts[0]
    for before, part in pairwise(parts):
        text += part if part[0] == "-" or (part[0] == "." and "." in before) else f" {part}"
    return letter.lower() + text


@cache
def _number(hundredths: int) -> str:
    return re.sub(r"^(-?)0\.", r"\1.", f"{hundredths / 100:.2f}".rstrip("0").rstrip("."))


def _joined(steps: list[str]) -> str:
    """Join path steps; a repeated command letter is left out."""
    text = before = ""
    for step in steps:
        letter, numbers = step[0], step[1:]
        after = "l" if before == "m" else before
        if letter != after or letter in "mz":
            text += step
        else:
            text += numbers if numbers[0] == "-" else f" {numbers}"
        before = letter
    return text
