"""Interactive figures: drawings with sliders, and the block in space.

Its HTML is complete without a script: the drawing and the numbers at the start values.
``book/_moving/explorer.js`` adds the sliders. It reads the data that stand beside the drawing, as
JSON, and only multiplies::

    {
      "sliders": [{"name", "after", "min", "max", "step", "digits"}, ...],
      "presets": [{"name", "values"}, ...], one value for each slider, the first at the start
      "panels": [[mark, ...], ...],
      "rows": [[response, ...], ...],
      "digits": one for each column of a row
    }

A *response* is a vector that depends on the sliders. It is ``{"constant", "matrix"}``, where the
matrix has a column for each slider; ``{"stops"}``: lists in lists, one level for each slider with
an entry for each of its stops, or a single one where the slider does not matter; or ``{"roots"}``:
for each stop of the first slider a matrix, whose rows give the root of the sum of squares of their
entries, each times the value of its slider, the first one times one.
A *mark* is ``{"kind", "at", "scale", "response"}``. `at` has points of the drawing, the response
two numbers for each of them, and `scale` the units of the drawing in one unit of the response along
x and y. So each point has a place at + scale * response. Kinds are

arrows
    From each point of `at` to its place.
curve
    A line through all places.
bars
    A bar of the thickness `BAR` from each point of `at` to the x of its place.
dots
    A round dot of the diameter `BAR` at each place.

A cell of a row shows its response where this is one number, and the length of a vector of two.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from acx4book.typesetting import maps, style
from acx4lib.expected import Array

# --- what an explorer consists of: sliders, what depends on them, and what is drawn of it


FIGURES = 6
"""Significant figures of the numbers in a page."""


@dataclass(frozen=True, kw_only=True)
class Slider:
    """A number set by the reader.

    Attributes
    ----------
    name, unit : str
        As they are shown.
    low, high, step : float
        Stops are low, low + step, ..., high.
    """

    name: str
    unit: str
    low: float
    high: float
    step: float

    @property
    def stops(self) -> Array:
        """All values of the slider, shape (n,)."""
        n = round((self.high - self.low) / self.step)
        return self.low + self.step * np.arange(n + 1)

    @property
    def digits(self) -> int:
        """Digits after the point needed to tell the stops apart."""
        return _digits(self.step)

    @property
    def after(self) -> str:
        """Text after the number: a space and the unit; degrees without space."""
        return self.unit if self.unit in {"", "°"} else f"\N{NO-BREAK SPACE}{self.unit}"

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        limits = {"min": self.low, "max": self.high, "step": self.step}
        return {"name": self.name, "after": self.after, "digits": self.digits, **limits}


@dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """A linear response: a constant plus a matrix times the sliders' values.

    Attributes
    ----------
    matrix : ndarray, shape (n, n_sliders)
        Per unit of each slider.
    constant : ndarray, shape (n,), or float
    """

    matrix: Array
    constant: Array | float = 0.0

    def at(self, values: Sequence[float]) -> Array:
        """Return the response to values of the sliders, shape (n,)."""
        return self.constant + self.matrix @ np.asarray(values)

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        constant = np.broadcast_to(self.constant, len(self.matrix))
        return {"constant": _rounded(constant), "matrix": _rounded(self.matrix)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Stops:
    """A response computed at every stop of the sliders.

    Attributes
    ----------
    sliders : sequence of Slider
        All of the explorer.
    table : ndarray, shape (n_stops of the first slider, ..., n)
        An axis for each slider, of length one where it does not matter.
    """

    sliders: Sequence[Slider]
    table: Array

    def __post_init__(self) -> None:
        stops = [len(slider.stops) for slider in self.sliders]
        shape = self.table.shape[:-1]
        if len(shape) != len(stops) or any(
            n not in (1, most) for n, most in zip(shape, stops, strict=True)
        ):
            msg = f"a table of shape {self.table.shape}: expected axes of 1 or of {stops} stops"
            raise ValueError(msg)

    def at(self, values: Sequence[float]) -> Array:
        """Return the response to values of the sliders, shape (n,)."""
        stops = [round((v - s.low) / s.step) for v, s in zip(values, self.sliders, strict=True)]
        most = np.array(self.table.shape[:-1]) - 1
        row: Array = self.table[tuple(np.minimum(stops, most))]
        return row

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {"stops": _rounded(self.table)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Roots:
    """A response of standard deviations: roots of sums of squares of terms per slider.

    Attributes
    ----------
    sliders : sequence of Slider
        All of the explorer.
    table : ndarray, shape (n_stops of the first slider, n, n_sliders)
        Per unit of each slider; in the place of the first one, what depends on no other.
    """

    sliders: Sequence[Slider]
    table: Array

    def __post_init__(self) -> None:
        first, n = self.sliders[0], len(self.sliders)
        if self.table.shape[::2] != (len(first.stops), n):
            msg = f"a table of shape {self.table.shape}: expected ({len(first.stops)}, n, {n})"
            raise ValueError(msg)

    def at(self, values: Sequence[float]) -> Array:
        """Return the response to values of the sliders, shape (n,)."""
        first = self.sliders[0]
        row = self.table[round((values[0] - first.low) / first.step)]
        root: Array = np.linalg.norm(row * np.array([1.0, *values[1:]]), axis=-1)
        return root

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {"roots": _rounded(self.table)}


Response = Linear | Stops | Roots


@dataclass(frozen=True, kw_only=True, eq=False)
class Mark:
    """A moving mark of a drawing.

    Attributes
    ----------
    kind : str
        ``arrows``, ``curve``, ``bars`` or ``dots``.
    colour : str
        Name of a colour of `COLOURS`.
    at : ndarray, shape (n, 2)
        Units of the drawing.
    scale : tuple of float
        Units of the drawing in one unit of the response, along x and y.
    response : Response
        x and y of each point, one after the other: 2 n numbers.
    """

    kind: str
    colour: str
    at: Array
    scale: tuple[float, float]
    response: Response

    def places(self, values: Sequence[float]) -> Array:
        """Return the places of the points for slider values, shape (n, 2), drawing units."""
        moved = self.response.at(values).reshape(-1, 2)
        return self.at + np.array(self.scale) * moved

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        return {
            "kind": self.kind,
            "at": _rounded(self.at),
            "scale": _rounded(np.array(self.scale)),
            "response": self.response.data(),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A drawing with fixed parts and moving marks.

    Attributes
    ----------
    title : str
        Its heading, plain text.
    alt : str
        Description of the drawing at the start.
    size : tuple of float
        Width and height, px on a page that is wide enough.
    fixed : str
        SVG of the fixed parts.
    marks : sequence of Mark
        Drawn over it, and clipped at the drawing's border.
    """

    title: str
    alt: str
    size: tuple[float, float]
    fixed: str
    marks: Sequence[Mark]


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of the table of readings: its heading with unit, and digits after the point."""

    title: str
    digits: int


class _Shown(ABC):
    """Base of figures shown as HTML in a notebook; other outputs show the caption."""

    caption: str

    @property
    @abstractmethod
    def html(self) -> str:
        """The figure as part of an HTML page."""

    def _repr_html_(self) -> str:
        return self.html

    def __repr__(self) -> str:
        return self.caption


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Explorer(_Shown):
    """A figure that follows sliders.

    Attributes
    ----------
    name : str
        Identifier in the page, of letters and hyphens.
    caption : str
        Plain text.
    sliders : sequence of Slider
    presets : mapping of str to sequence of float
        Values of all sliders, by what the button says; the first are those at the start.
    panels : sequence of Panel
    columns : sequence of Column
    rows : mapping of str to sequence of Response
        Readings by the row's heading, for each column or only for the first ones.
    """

    name: str
    caption: str
    sliders: Sequence[Slider]
    panels: Sequence[Panel]
    columns: Sequence[Column]
    rows: Mapping[str, Sequence[Response]]
    presets: Mapping[str, Sequence[float]]

    @property
    def html(self) -> str:
        """The figure as part of an HTML page."""
        return _html(self)

    @property
    def start(self) -> list[float]:
        """The values at the start."""
        return [*next(iter(self.presets.values()))]

    def readings(self, values: Sequence[float]) -> list[list[str]]:
        """Return the numbers of the table for values of the sliders, as they are shown."""
        return [
            [
                _number(_reading(response.at(values)), column.digits)
                for response, column in zip(row, self.columns, strict=False)
            ]
            for row in self.rows.values()
        ]

    def data(self) -> dict[str, Any]:
        """Return the data for the script, see above."""
        return {
            "sliders": [slider.data() for slider in self.sliders],
            "presets": [{"name": n, "values": [*values]} for n, values in self.presets.items()],
            "panels": [[mark.data() for mark in panel.marks] for panel in self.panels],
            "rows": [[response.data() for response in row] for row in self.rows.values()],
            "digits": [column.digits for column in self.columns],
        }


def _digits(step: float) -> int:
    """Return the number of digits after the point in multiples of a step."""
    return next(n for n in range(16) if abs(round(step, n) - step) < 1e-9 * step)


def _reading(response: Array) -> float:
    """Return a number, or the length of a vector."""
    return float(response[0]) if len(response) == 1 else float(np.linalg.norm(response))


def _number(number: float, digits: int) -> str:
    """Return a number with given digits after the point; zero has no sign."""
    text = f"{number:.{digits}f}"
    return (text if float(text) else text.lstrip("-")).replace("-", "\N{MINUS SIGN}")


def _rounded(numbers: Array) -> Any:
    """Return lists of numbers with `FIGURES` significant figures."""
    flat = [float(f"{x:.{FIGURES}g}") for x in np.ravel(numbers)]
    return np.reshape([0.0 if x == 0 else x for x in flat], np.shape(numbers)).tolist()


# --- a drawing in SVG: a plane with a scale, and what stands still in it


COLOURS = {name: f"var(--figure-{name}, {colour})" for colour, name in style.NAMES.items()}
"""Colours by name: from the page's style sheet, else from `style`."""

HEAD = 6.0
"""Longest stroke of an arrow's head; at most half the length of the arrow."""

BAR = 12.0
"""Thickness of a bar, and diameter of a dot."""


@dataclass(frozen=True, kw_only=True)
class Plane:
    """A rectangle of the plane in a drawing.

    Attributes
    ----------
    x, y : tuple of float
        Limits, in the plane's units; y counts upwards.
    size : tuple of float
        Of the whole drawing, px.
    margin : tuple of float
        Left, right, above and below the rectangle, px.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    size: tuple[float, float]
    margin: tuple[float, float, float, float] = (2.0, 2.0, 2.0, 2.0)

    @property
    def scale(self) -> tuple[float, float]:
        """Units of the drawing in a unit of the plane; negative along y."""
        left, right, above, below = self.margin
        width, height = self.size
        across = (width - left - right) / (self.x[1] - self.x[0])
        return across, -(height - above - below) / (self.y[1] - self.y[0])

    def at(self, points: Array) -> Array:
        """Return points of the plane in the drawing, shape (n, 2)."""
        corner = np.array([self.margin[0], self.margin[2]])
        moved: Array = corner + np.array(self.scale) * (points - np.array([self.x[0], self.y[1]]))
        return moved

    def line(
        self, points: ArrayLike, colour: str = "soft", width: float = 1.0, dash: str = ""
    ) -> str:
        """Return a line through points of the plane."""
        return _stroke(_through(self.at(np.asarray(points, dtype=np.float64))), colour, width, dash)

    def arrow(
        self, start: ArrayLike, end: ArrayLike, colour: str = "ink", width: float = 1.6
    ) -> str:
        """Return an arrow between two points of the plane."""
        a, b = self.at(np.array([start, end], dtype=np.float64))
        return _stroke(_arrows(a[None], b[None]), colour, width)

    def text(
        self,
        at: Sequence[float],
        text: str,
        *,
        anchor: str = "middle",
        colour: str = "soft",
        shift: tuple[float, float] = (0.0, 0.0),
    ) -> str:
        """Return plain text beside a point of the plane; the shift is in px, down and right."""
        x, y = self.at(np.array([at], dtype=np.float64))[0] + np.array(shift)
        return (
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{COLOURS[colour]}"'
            f' font-size="12" font-family="sans-serif">{escape(text)}</text>'
        )

    def axes(self, x: Sequence[float], y: Sequence[float], *, labels: tuple[str, str]) -> str:
        """Return both axes at the lower left border, with numbers and names."""
        low = self.x[0], self.y[0]
        parts = [self.line([(low[0], self.y[1]), low, (self.x[1], low[1])])]
        of_x, of_y = _digits(x[1] - x[0]), _digits(y[1] - y[0])
        parts += [self.text((n, low[1]), _number(n, of_x), shift=(0, 14)) for n in x]
        parts += [self.text((low[0], n), _number(n, of_y), anchor="end", shift=(-4, 4)) for n in y]
        middle = (self.x[0] + self.x[1]) / 2
        parts.append(self.text((middle, low[1]), labels[0], shift=(0, 30)))
        parts.append(self.text((low[0], self.y[1]), labels[1], anchor="start", shift=(-30, -12)))
        return "".join(parts)


# --- marks -----------------------------------------------------------------------------------


def _mark(drawn: Mark, values: Sequence[float]) -> str:
    """Return the SVG of a mark for values of the sliders."""
    return _stroke(path(drawn, values), drawn.colour, 1.6, filled=drawn.kind in {"bars", "dots"})


def path(drawn: Mark, values: Sequence[float]) -> str:
    """Return the SVG path of a mark, as the script does."""
    places = drawn.places(values)
    if drawn.kind == "arrows":
        return _arrows(drawn.at, places)
    if drawn.kind == "curve":
        return _through(places)
    if drawn.kind == "dots":
        r = BAR / 2
        half = f"a{r:.2f} {r:.2f} 0 1 0"
        dot = f"{half} {BAR:.2f} 0{half} {-BAR:.2f} 0z"
        return "".join(f"M{x - r:.2f} {y:.2f}{dot}" for x, y in places)
    return "".join(
        f"M{x:.2f} {y - BAR / 2:.2f}H{to:.2f}v{BAR:.2f}H{x:.2f}z"
        for (x, y), to in zip(drawn.at, places[:, 0], strict=True)
    )


def _through(points: Array) -> str:
    """Return the path through points of the drawing."""
    return "M" + "L".join(f"{x:.2f} {y:.2f}" for x, y in points)


def _arrows(starts: Array, ends: Array) -> str:
    """Return arrows, whose heads open by 50 degrees; nothing where an arrow has no length."""
    along = ends - starts
    length = np.hypot(*along.T)
    back = np.minimum(HEAD, length / 2) / np.where(length > 0, length, 1)
    a = back[:, None] * along * 0.9
    b = back[:, None] * np.column_stack([-along[:, 1], along[:, 0]]) * 0.42
    drawn = np.stack([starts, ends, ends - a + b, ends, ends - a - b], axis=1)[length > 0]
    return "".join(
        "M{:.2f} {:.2f}L{:.2f} {:.2f}M{:.2f} {:.2f}L{:.2f} {:.2f}L{:.2f} {:.2f}".format(*p.ravel())
        for p in drawn
    )


def _stroke(d: str, colour: str, width: float, dash: str = "", *, filled: bool = False) -> str:
    """Return a path with its colour; points are round strokes of no length."""
    kind, other = ("fill", "stroke") if filled else ("stroke", "fill")
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<path d="{d}" {kind}="{COLOURS[colour]}" {other}="none"'
        f' stroke-width="{width:g}" stroke-linejoin="round" stroke-linecap="round"{dashed}/>'
    )


# --- named rows on one axis: bars from its zero, or dots on an axis of logarithms


LEFT = 104.0
"""Room for the names of the rows, px."""


def along(values: Array, axis: int) -> Array:
    """Insert a zero, the other coordinate, after each value along an axis."""
    places = np.moveaxis(np.repeat(values, 2, axis=axis), axis, 0)
    places[1::2] = 0.0
    return np.moveaxis(places, 0, axis)


def bars(
    names: Sequence[str], lengths: Response, *, ends: tuple[float, float], label: str, **said: str
) -> Panel:
    """Return bars from zero.

    Parameters
    ----------
    names : sequence of str
        Of the rows, from above.
    lengths : Response
        As `along` makes them, in the unit of the axis.
    ends : tuple of float
        Of the axis; from the lower to the upper one are four ticks, with zero among them.
    label : str
        Of the axis.
    **said : str
        Title and alt, as of every panel.
    """
    at = np.linspace(*ends, 4 if ends[0] == 0 else 5)
    ticks = {float(tick): _number(tick, _digits(at[1] - at[0])) for tick in at}
    plane, fixed = _rows(names, ends, ticks, label=label, height=230.0)
    fixed += plane.line([(0.0, plane.y[0]), (0.0, plane.y[1])])
    at = np.column_stack([np.zeros(len(names)), _places(names)])
    return _of_rows(plane, fixed, at, lengths, ("bars", "blue"), **said)


def logarithms(values: Array, least: float, most: float) -> Array:
    """Return positions of positive values on the axis of `dots`, clipped at its ends."""
    lengths: Array = np.log10(np.clip(values, least, most)) - np.log10(least)
    return lengths


def dots(
    names: Sequence[str], lengths: Response, *, ends: tuple[float, float], label: str, **said: str
) -> Panel:
    """Return dots on a logarithmic axis, which has no zero as origin of bars.

    Parameters
    ----------
    names, label, said
        As of `bars`.
    lengths : Response
        As `along` makes them of `logarithms`.
    ends : tuple of float
        Of the axis, both positive.
    """
    low, high = np.log10(ends)
    decades = range(int(np.ceil(low)), int(np.floor(high)) + 1)
    ticks = {float(n): f"{10.0**n:g}" for n in decades}
    plane, fixed = _rows(names, (low, high), ticks, label=label, height=300.0)
    at = np.column_stack([np.full(len(names), low), _places(names)])
    fixed += "".join(plane.line([(low, y), (high, y)], dash="1 4") for y in at[:, 1])
    return _of_rows(plane, fixed, at, lengths, ("dots", "teal"), **said)


def _of_rows(
    plane: Plane, fixed: str, at: Array, lengths: Response, look: tuple[str, str], **said: str
) -> Panel:
    """Return a panel of rows with marks of one kind and colour."""
    kind, colour = look
    mark = Mark(kind=kind, colour=colour, at=plane.at(at), scale=plane.scale, response=lengths)
    return Panel(size=plane.size, fixed=fixed, marks=[mark], **said)


def _places(names: Sequence[str]) -> Array:
    return np.arange(len(names), dtype=float)[::-1]


def _rows(
    names: Sequence[str],
    x: tuple[float, float],
    ticks: Mapping[float, str],
    *,
    label: str,
    height: float,
) -> tuple[Plane, str]:
    """Return the plane of the rows, with their names and the ticks."""
    y = (-0.7, len(names) - 0.3)
    plane = Plane(x=x, y=y, size=(360.0, height), margin=(LEFT, 14.0, 8.0, 40.0))
    drawn = [
        plane.line([(tick, y[0]), (tick, y[1])], dash="2 3")
        + plane.text((tick, y[0]), text, shift=(0, 16))
        for tick, text in ticks.items()
    ]
    drawn += [
        plane.text((x[0], row), name, anchor="end", shift=(-6, 4))
        for row, name in zip(_places(names), names, strict=True)
    ]
    middle = (x[0] + x[1]) / 2
    return plane, "".join([*drawn, plane.text((middle, y[0]), label, shift=(0, 32))])


# --- an explorer as HTML


def _html(shown: Explorer) -> str:
    """Return the HTML of an explorer."""
    panels = "".join(_panel_html(panel, shown) for panel in shown.panels)
    narrow = min(panel.size[0] for panel in shown.panels) * 0.86
    return (
        f'<figure class="acx4-explorer" id="{shown.name}">'
        f'<div class="panels" style="--narrow: {narrow:.0f}px">{panels}</div>'
        f'<div class="sliders">{_values_html(shown)}</div>'
        f'<div class="readings" role="group" aria-label="readings" tabindex="0" aria-live="polite">'
        f"{_readings_html(shown)}</div>"
        f"<figcaption>{escape(shown.caption)}</figcaption>{_data(shown.data())}</figure>"
    )


def _data(content: dict[str, Any]) -> str:
    """Return data as JSON in a script element, escaped so that no text ends the element."""
    text = json.dumps(content, separators=(",", ":"), ensure_ascii=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return f'<script type="application/json">{text}</script>'


def _panel_html(panel: Panel, shown: Explorer) -> str:
    marks = "".join(_mark(mark, shown.start) for mark in panel.marks)
    width, height = panel.size
    return (
        f'<div class="panel"><div class="title">{escape(panel.title)}</div>'
        f'<svg viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img"'
        f' aria-label="{escape(panel.alt)}">{panel.fixed}<g class="marks">{marks}</g></svg></div>'
    )


def _values_html(shown: Explorer) -> str:
    items = (
        f"<li>{escape(slider.name)} = {_number(value, slider.digits)}{slider.after}</li>"
        for slider, value in zip(shown.sliders, shown.start, strict=True)
    )
    return f"<ul>{''.join(items)}</ul>"


def _readings_html(shown: Explorer) -> str:
    head = "".join(f'<th scope="col">{escape(column.title)}</th>' for column in shown.columns)
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th>{"".join(f"<td>{x}</td>" for x in numbers)}</tr>'
        for name, numbers in zip(shown.rows, shown.readings(shown.start), strict=True)
    )
    return (
        f'<table class="table"><thead><tr><td></td>{head}</tr></thead><tbody>{rows}</tbody></table>'
    )


# --- the block in space


FROM_DEG, ABOVE_DEG = 24.0, 28.0
"""View of the scene at the start, degrees: from the south towards east; above the horizon."""

SIZE = (720.0, 470.0)
"""Of the drawing, px."""

AROUND = 24
"""Points of the outline of an ellipsoid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Marks of one kind, shown and hidden together.

    Attributes
    ----------
    name : str
        Name of its switch, plain text.
    kind : str
        ``lines``, ``points`` or ``ellipsoids``.
    colour : str
        Name of a colour of `COLOURS`.
    at : ndarray, shape (n, 3)
        m: east, north, up.
    axes : ndarray, shape (n, 3, 3)
        Of ellipsoids: rows are the vectors from the middle to the ends of the axes.
    labels : sequence of str
        Plain text of the first points.
    size : float
        Of points, px.
    """

    name: str
    kind: str
    colour: str
    at: Array
    axes: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    labels: Sequence[str] = ()
    size: float = 3.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene(_Shown):
    """A block in space: layers with caption and description.

    Attributes
    ----------
    name : str
        Identifier in the page, of letters and hyphens.
    alt, caption : str
        Plain text.
    layers : sequence of Layer
    """

    name: str
    alt: str
    caption: str
    layers: Sequence[Layer]

    @property
    def html(self) -> str:
        """The figure as part of an HTML page."""
        return _scene_html(self)

    @property
    def middle(self) -> Array:
        """The middle of all points, shape (3,)."""
        points = np.concatenate([layer.at for layer in self.layers])
        middle: Array = (points.min(axis=0) + points.max(axis=0)) / 2
        return middle

    def data(self) -> dict[str, Any]:
        """Return the data for the script of the page."""
        middle, eye = self.middle, maps.view(FROM_DEG, ABOVE_DEG).inv().apply([0.0, 0.0, 1.0])
        return {
            "from": eye.round(4).tolist(),
            "layers": [
                {
                    "name": layer.name,
                    "kind": layer.kind,
                    "colour": layer.colour,
                    "size": layer.size,
                    "at": (layer.at - middle).round(1).ravel().tolist(),
                    "axes": layer.axes.round(1).ravel().tolist(),
                    "labels": [*layer.labels],
                }
                for layer in self.layers
            ],
        }


def _scene_html(scene: Scene) -> str:
    """Return the HTML of a scene: a drawing, and the data for its interactive version."""
    names = "".join(
        f'<li><i style="background: {COLOURS[layer.colour]}"></i> {escape(layer.name)}</li>'
        for layer in scene.layers
    )
    return (
        f'<figure class="acx4-block" id="{scene.name}"><div class="view">{_drawing(scene)}</div>'
        f'<ul class="layers">{names}</ul><figcaption>{escape(scene.caption)}</figcaption>'
        f"{_data(scene.data())}</figure>"
    )


def _drawing(scene: Scene) -> str:
    """Return the scene as SVG, seen along parallel rays."""
    turn = maps.view(FROM_DEG, ABOVE_DEG)
    flat = [turn.apply(layer.at - scene.middle)[:, :2] for layer in scene.layers]
    half = np.abs(np.concatenate(flat)).max(axis=0)
    factor = float(np.min((np.array(SIZE) / 2 - 18) / half))
    half = np.array(SIZE) / 2 / factor
    paper = Plane(
        x=(-half[0], half[0]), y=(-half[1], half[1]), size=SIZE, margin=(0.0, 0.0, 0.0, 0.0)
    )
    drawn = "".join(
        _layer(paper, layer, at, turn.apply(layer.axes.reshape(-1, 3))[:, :2].reshape(-1, 3, 2))
        for layer, at in zip(scene.layers, flat, strict=True)
    )
    return (
        f'<svg viewBox="0 0 {SIZE[0]:g} {SIZE[1]:g}" width="{SIZE[0]:g}" role="img"'
        f' aria-label="{escape(scene.alt)}">{drawn}</svg>'
    )


def _layer(paper: Plane, layer: Layer, at: Array, axes: Array) -> str:
    if layer.kind == "lines":
        d = "".join(_segment(*pair) for pair in paper.at(at).reshape(-1, 2, 2))
    elif layer.kind == "points":
        d = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in paper.at(at))
    else:
        outlines = outline(axes) + at[:, None]
        d = "".join(_through(paper.at(points)) for points in outlines)
    width = layer.size if layer.kind == "points" else 0.9
    labels = "".join(
        paper.text(place, text, colour="ink", shift=(0, -6))
        for place, text in zip(at, layer.labels, strict=False)
    )
    return _stroke(d, layer.colour, width) + labels


def outline(axes: Array) -> Array:
    """Return the outlines of ellipsoids seen along parallel rays.

    An ellipsoid of the axes a_k is seen as an ellipse of the matrix ``sum a_k a_k^T`` of the axes
    as they are seen, as the covariance of two coordinates is part of that of three.

    Parameters
    ----------
    axes : ndarray, shape (n, 3, 2)
        On the paper.

    Returns
    -------
    ndarray, shape (n, AROUND + 1, 2)
        The last point is the first.
    """
    angle = np.linspace(0, 2 * np.pi, AROUND + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", axes, axes))
    size = np.sqrt(np.maximum(values, 0.0))
    points: Array = np.einsum("nij,nj,pj->npi", vectors, size, circle)
    return points


def _segment(start: Array, end: Array) -> str:
    return f"M{start[0]:.1f} {start[1]:.1f}L{end[0]:.1f} {end[1]:.1f}"
