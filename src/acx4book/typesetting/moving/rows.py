"""A drawing of named rows on one axis: bars from its zero, or dots on an axis of logarithms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from acx4book.typesetting.moving.explorer import Mark, Panel, Response, digits, shown
from acx4book.typesetting.moving.plane import Plane
from acx4lib.expected import Array

LEFT = 104.0
"""Room for the names of the rows, px."""


def along(values: Array, axis: int) -> Array:
    """Return values with a zero, the other coordinate of their place, after each along an axis."""
    places = np.moveaxis(np.repeat(values, 2, axis=axis), axis, 0)
    places[1::2] = 0.0
    return np.moveaxis(places, 0, axis)


def bars(
    names: Sequence[str],
    lengths: Response,
    *,
    title: str,
    alt: str,
    ends: tuple[float, float],
    label: str,
) -> Panel:
    """Return bars from zero.

    Parameters
    ----------
    names : sequence of str
        Of the rows, from above.
    lengths : Response
        As `along` makes them, in the unit of the axis.
    title, alt : str
        As of every panel.
    ends : tuple of float
        Of the axis; from the lower to the upper one are four ticks, with zero among them.
    label : str
        Of the axis.
    """
    at = np.linspace(*ends, 4 if ends[0] == 0 else 5)
    ticks = {float(tick): shown(tick, digits(at[1] - at[0])) for tick in at}
    plane, fixed = _rows(names, ends, ticks, label=label, height=230.0)
    fixed += plane.line([(0.0, plane.y[0]), (0.0, plane.y[1])])
    at = np.column_stack([np.zeros(len(names)), _places(names)])
    marks = [Mark(kind="bars", colour="blue", at=plane.at(at), scale=plane.scale, response=lengths)]
    return Panel(title=title, alt=alt, size=plane.size, fixed=fixed, marks=marks)


def logarithms(values: Array, least: float, most: float) -> Array:
    """Return how far positive values lie along the axis of `dots`, whose ends they do not pass."""
    lengths: Array = np.log10(np.clip(values, least, most)) - np.log10(least)
    return lengths


def dots(
    names: Sequence[str],
    lengths: Response,
    *,
    title: str,
    alt: str,
    ends: tuple[float, float],
    label: str,
) -> Panel:
    """Return dots on an axis of logarithms, which has no zero for a bar to begin at.

    Parameters
    ----------
    names, title, alt, label
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
    marks = [Mark(kind="dots", colour="teal", at=plane.at(at), scale=plane.scale, response=lengths)]
    return Panel(title=title, alt=alt, size=plane.size, fixed=fixed, marks=marks)


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
        plane.line([(at, y[0]), (at, y[1])], dash="2 3")
        + plane.text((at, y[0]), text, shift=(0, 16))
        for at, text in ticks.items()
    ]
    drawn += [
        plane.text((x[0], row), name, anchor="end", shift=(-6, 4))
        for row, name in zip(_places(names), names, strict=True)
    ]
    middle = (x[0] + x[1]) / 2
    return plane, "".join([*drawn, plane.text((middle, y[0]), label, shift=(0, 32))])
