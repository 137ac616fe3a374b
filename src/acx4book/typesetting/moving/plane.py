"""A drawing in SVG: a plane with a scale, and what stands still in it.

Colours are those of the page, by day and by night.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from acx4book.typesetting import style
from acx4book.typesetting.moving.explorer import Mark, digits, shown
from acx4lib.expected import Array

COLOURS = {name: f"var(--figure-{name}, {colour})" for colour, name in style.NAMES.items()}
"""Colours by their names: those of the page's style sheet, or else those of all figures."""

HEAD = 6.0
"""Longest stroke of an arrow's head; that of a short arrow is half as long as the arrow."""

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
        return stroke(through(self.at(np.asarray(points, dtype=np.float64))), colour, width, dash)

    def arrow(
        self, start: ArrayLike, end: ArrayLike, colour: str = "ink", width: float = 1.6
    ) -> str:
        """Return an arrow between two points of the plane."""
        a, b = self.at(np.array([start, end], dtype=np.float64))
        return stroke(_arrows(a[None], b[None]), colour, width)

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
        of_x, of_y = digits(x[1] - x[0]), digits(y[1] - y[0])
        parts += [self.text((n, low[1]), shown(n, of_x), shift=(0, 14)) for n in x]
        parts += [self.text((low[0], n), shown(n, of_y), anchor="end", shift=(-4, 4)) for n in y]
        middle = (self.x[0] + self.x[1]) / 2
        parts.append(self.text((middle, low[1]), labels[0], shift=(0, 30)))
        parts.append(self.text((low[0], self.y[1]), labels[1], anchor="start", shift=(-30, -12)))
        return "".join(parts)


# --- marks -----------------------------------------------------------------------------------


def mark(drawn: Mark, values: Sequence[float]) -> str:
    """Return a mark as it is for values of the sliders."""
    return stroke(path(drawn, values), drawn.colour, 1.6, filled=drawn.kind in {"bars", "dots"})


def path(drawn: Mark, values: Sequence[float]) -> str:
    """Return a mark's path as SVG writes it; the script does the same."""
    places = drawn.places(values)
    if drawn.kind == "arrows":
        return _arrows(drawn.at, places)
    if drawn.kind == "curve":
        return through(places)
    if drawn.kind == "dots":
        r = BAR / 2
        half = f"a{r:.2f} {r:.2f} 0 1 0"
        dot = f"{half} {BAR:.2f} 0{half} {-BAR:.2f} 0z"
        return "".join(f"M{x - r:.2f} {y:.2f}{dot}" for x, y in places)
    return "".join(
        f"M{x:.2f} {y - BAR / 2:.2f}H{to:.2f}v{BAR:.2f}H{x:.2f}z"
        for (x, y), to in zip(drawn.at, places[:, 0], strict=True)
    )


def through(points: Array) -> str:
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


def stroke(d: str, colour: str, width: float, dash: str = "", *, filled: bool = False) -> str:
    """Return a path with its colour; points are round strokes of no length."""
    kind, other = ("fill", "stroke") if filled else ("stroke", "fill")
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    return (
        f'<path d="{d}" {kind}="{COLOURS[colour]}" {other}="none"'
        f' stroke-width="{width:g}" stroke-linejoin="round" stroke-linecap="round"{dashed}/>'
    )
