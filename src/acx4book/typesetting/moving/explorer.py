"""What an explorer consists of: sliders, what depends on them, and what is drawn of it.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acx4lib.expected import Array

FIGURES = 6
"""Significant figures of the numbers in a page."""


@dataclass(frozen=True, kw_only=True)
class Slider:
    """A number that the reader sets.

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
        """All values that can be set, shape (n,)."""
        n = round((self.high - self.low) / self.step)
        return self.low + self.step * np.arange(n + 1)

    @property
    def digits(self) -> int:
        """Digits after the point that tell the stops apart."""
        return digits(self.step)

    @property
    def after(self) -> str:
        """What follows the number: the unit, and a space before it unless it is degrees."""
        return self.unit if self.unit in {"", "°"} else f"\N{NO-BREAK SPACE}{self.unit}"

    def data(self) -> dict[str, Any]:
        """Return what the page holds."""
        limits = {"min": self.low, "max": self.high, "step": self.step}
        return {"name": self.name, "after": self.after, "digits": self.digits, **limits}


@dataclass(frozen=True, kw_only=True, eq=False)
class Linear:
    """A response that is a constant and a matrix times the sliders' values.

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
        """Return what the page holds."""
        constant = np.broadcast_to(self.constant, len(self.matrix))
        return {"constant": _rounded(constant), "matrix": _rounded(self.matrix)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Stops:
    """A response that was computed at every stop of the sliders.

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
        given = self.table.shape[:-1]
        if len(given) != len(stops) or any(
            n not in (1, most) for n, most in zip(given, stops, strict=True)
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
        """Return what the page holds."""
        return {"stops": _rounded(self.table)}


@dataclass(frozen=True, kw_only=True, eq=False)
class Roots:
    """A response of standard deviations: roots of sums of squares, each of a slider's value.

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
        """Return what the page holds."""
        return {"roots": _rounded(self.table)}


Response = Linear | Stops | Roots


@dataclass(frozen=True, kw_only=True, eq=False)
class Mark:
    """Something drawn that moves.

    Attributes
    ----------
    kind : str
        ``arrows``, ``curve``, ``bars`` or ``dots``.
    colour : str
        Name of a colour of `plane.COLOURS`.
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
        """Return where the points are for values of the sliders, shape (n, 2), drawing units."""
        moved = self.response.at(values).reshape(-1, 2)
        return self.at + np.array(self.scale) * moved

    def data(self) -> dict[str, Any]:
        """Return what the page holds."""
        return {
            "kind": self.kind,
            "at": _rounded(self.at),
            "scale": _rounded(np.array(self.scale)),
            "response": self.response.data(),
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A drawing: what stands still, and what moves.

    Attributes
    ----------
    title : str
        Its heading, plain text.
    alt : str
        What is seen at the start.
    size : tuple of float
        Width and height, px on a page that is wide enough.
    fixed : str
        SVG of what stands still.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Explorer:
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
    def start(self) -> list[float]:
        """The values at the start."""
        return [*next(iter(self.presets.values()))]

    def readings(self, values: Sequence[float]) -> list[list[str]]:
        """Return the numbers of the table for values of the sliders, as they are shown."""
        return [
            [
                shown(reading(response.at(values)), column.digits)
                for response, column in zip(row, self.columns, strict=False)
            ]
            for row in self.rows.values()
        ]

    def data(self) -> dict[str, Any]:
        """Return what the page holds for the script, see above."""
        return {
            "sliders": [slider.data() for slider in self.sliders],
            "presets": [{"name": n, "values": [*values]} for n, values in self.presets.items()],
            "panels": [[mark.data() for mark in panel.marks] for panel in self.panels],
            "rows": [[response.data() for response in row] for row in self.rows.values()],
            "digits": [column.digits for column in self.columns],
        }


def digits(step: float) -> int:
    """Return how many digits after the point multiples of a step have."""
    return next(n for n in range(16) if abs(round(step, n) - step) < 1e-9 * step)


def reading(response: Array) -> float:
    """Return the number itself, or the length of a vector."""
    return float(response[0]) if len(response) == 1 else float(np.linalg.norm(response))


def shown(number: float, digits: int) -> str:
    """Return a number with so many digits after the point; zero has no sign."""
    text = f"{number:.{digits}f}"
    return (text if float(text) else text.lstrip("-")).replace("-", "\N{MINUS SIGN}")


def _rounded(numbers: Array) -> Any:
    """Return lists of numbers with `FIGURES` significant figures."""
    flat = [float(f"{x:.{FIGURES}g}") for x in np.ravel(numbers)]
    return np.reshape([0.0 if x == 0 else x for x in flat], np.shape(numbers)).tolist()
