"""Figures that move: drawings with sliders, and the block in space.

Their HTML is complete without a script: the drawing and the numbers at the start. The scripts of
``book/_moving`` add the sliders, and turn the block; they read the data that stand beside the
drawing, as JSON, and only multiply.

A *response* is a vector that depends on the sliders: `Linear` or `Stops`. A `Mark` of a drawing
follows it, and a cell of the table shows it: one number, or the length of a vector.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acx4book.typesetting import maps, style
from acx4lib.expected import Array

COLOURS = {name: f"var(--figure-{name}, {colour})" for colour, name in style.NAMES.items()}
"""Colours by name: from the page's style sheet, which has others in the dark, else from `style`."""

HEAD = 6.0
"""Longest stroke of an arrow's head, px; at most half of the arrow."""


@dataclass(frozen=True, kw_only=True)
class Slider:
    """A number set by the reader, with stops low, low + step, ..., high."""

    name: str
    unit: str
    low: float
    high: float
    step: float

    @property
    def stops(self) -> Array:
        """All values of the slider, shape (n,)."""
        return self.low + self.step * np.arange(round((self.high - self.low) / self.step) + 1)

    @property
    def digits(self) -> int:
        """Digits after the point needed to tell the stops apart."""
        return _digits(self.step)

    @property
    def after(self) -> str:
        """Text after the number: a space and the unit; degrees without space."""
        return self.unit if self.unit in {"", "°"} else f"\N{NO-BREAK SPACE}{self.unit}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """A response that is a matrix, shape (n, n_sliders), times the sliders' values."""

    matrix: Array

    def at(self, values: Sequence[float]) -> Array:
        """Return the response to values of the sliders, shape (n,)."""
        return self.matrix @ np.asarray(values)

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {"matrix": _rounded(self.matrix)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Stops:
    """A response computed at every stop of the sliders.

    The table has an axis for each slider, of its stops or of length one where it does not matter,
    and a last one of n.
    """

    sliders: Sequence[Slider]
    table: Array

    def at(self, values: Sequence[float]) -> Array:
        """Return the response to values of the sliders, shape (n,)."""
        stops = [round((v - s.low) / s.step) for v, s in zip(values, self.sliders, strict=True)]
        row: Array = self.table[tuple(np.minimum(stops, np.array(self.table.shape[:-1]) - 1))]
        return row

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {"stops": _rounded(self.table)}


Response = Linear | Stops


@dataclass(frozen=True, kw_only=True)
class Plane:
    """A rectangle of the plane in a drawing, with its limits; y counts upwards.

    The size is the width and the height of the whole drawing, px; the margin is what of it lies
    left, right, above and below the rectangle.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    size: tuple[float, float]
    margin: tuple[float, float, float, float] = (2.0, 2.0, 2.0, 2.0)

    @property
    def scale(self) -> Array:
        """Px in a unit of the plane along x and y; negative along y."""
        left, right, above, below = self.margin
        room = np.array([self.size[0] - left - right, above + below - self.size[1]])
        return room / [self.x[1] - self.x[0], self.y[1] - self.y[0]]

    def at(self, points: ArrayLike) -> Array:
        """Return points of the plane in the drawing, shape (..., 2), px."""
        corner = np.array([self.margin[0], self.margin[2]])
        return corner + self.scale * (np.asarray(points) - [self.x[0], self.y[1]])

    def line(self, points: ArrayLike, colour: str = "soft", dash: str = "") -> str:
        """Return a line through points of the plane."""
        return _stroke(_through(self.at(points)), colour, 1.0, dash)

    def arrow(self, start: ArrayLike, end: ArrayLike) -> str:
        """Return an arrow between two points of the plane."""
        return _stroke(_arrows(self.at(start)[None], self.at(end)[None]), "ink", 1.6)

    def text(
        self, at: ArrayLike, text: str, anchor: str = "middle", shift: ArrayLike = (0, 0)
    ) -> str:
        """Return plain text beside a point of the plane; the shift is in px, right and down."""
        x, y = self.at(at) + np.asarray(shift)
        look = f'text-anchor="{anchor}" font-size="12" font-family="sans-serif"'
        return (
            f'<text x="{x:.1f}" y="{y:.1f}" {look} fill="{COLOURS["soft"]}">{escape(text)}</text>'
        )

    def axes(self, x: Sequence[float], y: Sequence[float], *, labels: tuple[str, str]) -> str:
        """Return both axes at the lower left border, with numbers and names."""
        left, low, top = self.x[0], self.y[0], self.y[1]
        parts = [self.line([(left, top), (left, low), (self.x[1], low)])]
        parts += [self.text((n, low), _number(n, 0), shift=(0, 14)) for n in x]
        parts += [self.text((left, n), _number(n, 0), "end", shift=(-4, 4)) for n in y]
        parts.append(self.text((sum(self.x) / 2, low), labels[0], shift=(0, 30)))
        parts.append(self.text((left, top), labels[1], "start", shift=(-30, -12)))
        return "".join(parts)


@dataclass(frozen=True, eq=False)
class Mark:
    """A moving mark of a drawing: points at ``at + times * response``, in units of the plane.

    The kind is ``arrows``, from `at`, or ``curve``, through all points; the colour is a name of
    `COLOURS`. The response has x and y of each of n points, one after the other; `at` has the shape
    (n, 2), or (2,) for all.
    """

    kind: str
    colour: str
    plane: Plane
    response: Response
    at: ArrayLike = (0.0, 0.0)
    times: float = 1.0

    def path(self, values: Sequence[float]) -> str:
        """Return the SVG path for values of the sliders, as the script does."""
        moved = self.response.at(values).reshape(-1, 2)
        starts = np.broadcast_to(self.plane.at(self.at), moved.shape)
        places = starts + self.times * self.plane.scale * moved
        return _arrows(starts, places) if self.kind == "arrows" else _through(places)

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {
            "kind": self.kind,
            "at": _rounded(np.atleast_2d(self.plane.at(self.at))),
            "scale": _rounded(self.times * self.plane.scale),
            "response": self.response.data(),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A drawing: its heading and description at the start, SVG of what is fixed, and marks."""

    title: str
    alt: str
    size: tuple[float, float]
    fixed: str
    marks: Sequence[Mark]


class _Shown:
    """Base of figures shown as HTML in a notebook; other outputs show the caption."""

    caption: str
    html: str

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.caption


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Explorer(_Shown):
    """A figure that follows sliders; all names are plain text.

    The name is its identifier in the page, of letters and hyphens. Presets are values of all
    sliders by what a button says; the first are those at the start. Columns have digits after the
    point by their heading, and rows responses, one for each column or only for the first ones.
    """

    name: str
    caption: str
    sliders: Sequence[Slider]
    presets: Mapping[str, Sequence[float]]
    panels: Sequence[Panel]
    columns: Mapping[str, int]
    rows: Mapping[str, Sequence[Response]]

    @property
    def start(self) -> list[float]:
        """The values at the start."""
        return [*next(iter(self.presets.values()))]

    def readings(self, values: Sequence[float]) -> list[list[str]]:
        """Return the numbers of the table for values of the sliders, as they are shown."""
        digits = self.columns.values()
        return [
            [_number(_reading(one.at(values)), d) for one, d in zip(row, digits, strict=False)]
            for row in self.rows.values()
        ]

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {
            "sliders": [asdict(s) | {"after": s.after, "digits": s.digits} for s in self.sliders],
            "presets": [{"name": n, "values": [*values]} for n, values in self.presets.items()],
            "panels": [[mark.data() for mark in panel.marks] for panel in self.panels],
            "rows": [[response.data() for response in row] for row in self.rows.values()],
            "digits": [*self.columns.values()],
        }

    @property
    def html(self) -> str:  # type: ignore[override]
        """The figure as part of an HTML page."""
        values = "".join(
            f"<li>{escape(slider.name)} = {_number(value, slider.digits)}{slider.after}</li>"
            for slider, value in zip(self.sliders, self.start, strict=True)
        )
        head = "".join(f'<th scope="col">{escape(title)}</th>' for title in self.columns)
        rows = "".join(
            f'<tr><th scope="row">{escape(name)}</th>{"".join(f"<td>{x}</td>" for x in row)}</tr>'
            for name, row in zip(self.rows, self.readings(self.start), strict=True)
        )
        narrow = min(panel.size[0] for panel in self.panels) * 0.86
        return (
            f'<figure class="acx4-explorer" id="{self.name}">'
            f'<div class="panels" style="--narrow: {narrow:.0f}px">'
            f"{''.join(map(self._drawing, self.panels))}</div>"
            f'<div class="sliders"><ul>{values}</ul></div><div class="readings" role="group"'
            ' aria-label="readings" tabindex="0" aria-live="polite"><table class="table">'
            f"<thead><tr><td></td>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
            f"<figcaption>{escape(self.caption)}</figcaption>{_data(self.data())}</figure>"
        )

    def _drawing(self, panel: Panel) -> str:
        marks = "".join(_stroke(m.path(self.start), m.colour, 1.6) for m in panel.marks)
        inside = f'{panel.fixed}<g class="marks">{marks}</g>'
        title = f'<div class="title">{escape(panel.title)}</div>'
        return f'<div class="panel">{title}{_svg(panel.size, panel.alt, inside)}</div>'


# --- the block in space: seen from the south towards east, and above the horizon, at the start


FROM_DEG, ABOVE_DEG = 24.0, 28.0
SIZE = (720.0, 470.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Lines from each even point to the next, or points; they are shown and hidden together.

    The kind is ``lines`` or ``points``, the colour a name of `COLOURS`, and the size that of
    points, px. `at` has east, north and up, m, shape (n, 3). The labels are those of the first
    points; they and the name are plain text.
    """

    name: str
    kind: str
    colour: str
    at: Array
    labels: Sequence[str] = ()
    size: float = 3.0

    def drawn(self, plane: Plane, middle: Array) -> str:
        """Return the layer as SVG, seen along parallel rays; points are round strokes."""
        at = maps.view(FROM_DEG, ABOVE_DEG).apply(self.at - middle)[:, :2]
        if self.kind == "lines":
            d, width = "".join(map(_through, plane.at(at).reshape(-1, 2, 2))), 0.9
        else:
            d, width = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in plane.at(at)), self.size
        labels = (plane.text(*one, shift=(0, -6)) for one in zip(at, self.labels, strict=False))
        return _stroke(d, self.colour, width) + "".join(labels)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene(_Shown):
    """A block in space: layers with caption and description, under an identifier of letters."""

    name: str
    alt: str
    caption: str
    layers: Sequence[Layer]

    @property
    def middle(self) -> Array:
        """The middle of all points, shape (3,)."""
        points = np.concatenate([layer.at for layer in self.layers])
        middle: Array = (points.min(axis=0) + points.max(axis=0)) / 2
        return middle

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        layers = [
            {name: getattr(layer, name) for name in ("name", "kind", "colour", "size")}
            | {"at": (layer.at - self.middle).round(1).tolist(), "labels": [*layer.labels]}
            for layer in self.layers
        ]
        eye = maps.view(FROM_DEG, ABOVE_DEG).inv().apply([0.0, 0.0, 1.0])
        return {"from": eye.round(4).tolist(), "layers": layers}

    @property
    def html(self) -> str:  # type: ignore[override]
        """The figure as part of an HTML page: a drawing, and the data for turning it."""
        points = np.concatenate([layer.at for layer in self.layers]) - self.middle
        flat = maps.view(FROM_DEG, ABOVE_DEG).apply(points)[:, :2]
        x, y = np.array(SIZE) / 2 / np.min((np.array(SIZE) / 2 - 18) / np.abs(flat).max(axis=0))
        plane = Plane(x=(-x, x), y=(-y, y), size=SIZE, margin=(0.0, 0.0, 0.0, 0.0))
        drawn = "".join(layer.drawn(plane, self.middle) for layer in self.layers)
        names = "".join(
            f'<li><i style="background: {COLOURS[layer.colour]}"></i> {escape(layer.name)}</li>'
            for layer in self.layers
        )
        return (
            f'<figure class="acx4-block" id="{self.name}">'
            f'<div class="view">{_svg(SIZE, self.alt, drawn)}</div><ul class="layers">{names}</ul>'
            f"<figcaption>{escape(self.caption)}</figcaption>{_data(self.data())}</figure>"
        )


# --- paths, numbers and data in a page


def _through(points: Array) -> str:
    return "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in points)


def _arrows(starts: Array, ends: Array) -> str:
    """Return arrows, whose heads open by 50 degrees; nothing where an arrow has no length."""
    along = ends - starts
    length = np.hypot(*along.T)
    back = np.minimum(HEAD, length / 2) / np.where(length > 0, length, 1)
    a = back[:, None] * along * 0.9
    b = back[:, None] * np.column_stack([-along[:, 1], along[:, 0]]) * 0.42
    heads = np.stack([ends - a + b, ends, ends - a - b], axis=1)
    shafts = np.stack([starts, ends], axis=1)
    return "".join(
        _through(shaft) + _through(head)
        for shaft, head in zip(shafts[length > 0], heads[length > 0], strict=True)
    )


def _stroke(d: str, colour: str, width: float, dash: str = "") -> str:
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<path d="{d}" stroke="{COLOURS[colour]}" fill="none" stroke-width="{width:g}"'
        f' stroke-linejoin="round" stroke-linecap="round"{dashed}/>'
    )


def _svg(size: tuple[float, float], alt: str, inside: str) -> str:
    box = f'viewBox="0 0 {size[0]:g} {size[1]:g}" width="{size[0]:g}"'
    return f'<svg {box} role="img" aria-label="{escape(alt)}">{inside}</svg>'


def _data(content: dict[str, Any]) -> str:
    """Return data as JSON in a script element, escaped so that no text ends the element."""
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json">{text}</script>'


def _digits(step: float) -> int:
    return next(n for n in range(16) if abs(round(step, n) - step) < 1e-9 * step)


def _reading(response: Array) -> float:
    return float(response[0]) if len(response) == 1 else float(np.linalg.norm(response))


def _number(number: float, digits: int) -> str:
    """Return a number with given digits after the point; zero has no sign."""
    text = f"{number:.{digits}f}"
    return (text if float(text) else text.lstrip("-")).replace("-", "\N{MINUS SIGN}")


def _rounded(numbers: ArrayLike) -> Any:
    """Return lists of numbers with six significant figures."""
    flat = [float(f"{x:.6g}") + 0.0 for x in np.ravel(numbers)]
    return np.reshape(flat, np.shape(numbers)).tolist()
