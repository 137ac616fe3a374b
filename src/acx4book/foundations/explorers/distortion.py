"""What each coefficient of a lens does to the points of an image."""

from __future__ import annotations

import numpy as np

from acx4book.foundations.drawings.distortion import UM, balance, border, grid
from acx4book.paper import printed
from acx4book.typesetting.moving.explorer import Column, Explorer, Linear, Mark, Panel, Slider
from acx4book.typesetting.moving.plane import Plane
from acx4lib.expected import Array
from acx4lib.geometry.camera import Interior, distortion

HEAD = "CAM1"
"""The head of Table 1 whose format and focal length are used."""

FLOWN_M = 1600.0
"""Height over ground for the effect there: the lower one of the paper."""

KEYS = {"k1": 1e-6, "k2": 1e-9, "k3": 1e-12, "p1": 1e-6, "p2": 1e-6}
"""Coefficients, and one unit of their sliders, mm^-2, mm^-4, mm^-6, mm^-1 and mm^-1."""

SLIDERS = (
    Slider(name="k₁", unit="· 10⁻⁶ mm⁻²", low=-4.0, high=4.0, step=0.01),
    Slider(name="k₂", unit="· 10⁻⁹ mm⁻⁴", low=-4.0, high=4.0, step=0.01),
    Slider(name="k₃", unit="· 10⁻¹² mm⁻⁶", low=-4.0, high=4.0, step=0.01),
    Slider(name="p₁", unit="· 10⁻⁶ mm⁻¹", low=-8.0, high=8.0, step=0.01),
    Slider(name="p₂", unit="· 10⁻⁶ mm⁻¹", low=-8.0, high=8.0, step=0.01),
    Slider(name="change of f", unit="µm", low=-300.0, high=300.0, step=5.0),
)

EXAGGERATED = 60.0
"""How many times too long arrows are drawn."""


def lens(values: Array) -> Interior:
    """Return the lens that the sliders describe; the change of f is none of it."""
    named = {key: unit * v for (key, unit), v in zip(KEYS.items(), values, strict=False)}
    return Interior(f=printed.interior(1, HEAD).f, **named)


def moved(values: Array, xy_mm: Array) -> Array:
    """Return measured minus ideal points, mm, if the focal length is changed as well.

    With another f the ideal point of the same ray lies nearer to the middle, or farther from it.

    Parameters
    ----------
    values : ndarray, shape (6,)
        In the units of `SLIDERS`, in their order.
    xy_mm : ndarray, shape (n, 2)
        Measured points from the principal point.

    Returns
    -------
    ndarray, shape (n, 2)
    """
    described = lens(values)
    larger = values[-1] / UM / described.f
    change: Array = distortion(described, xy_mm) - larger * xy_mm
    return change


def response(xy_mm: Array) -> Array:
    """Return `moved` for one unit of each slider, shape (2 n, 6), mm: it is linear in them."""
    one_by_one = [moved(unit, xy_mm).ravel() for unit in np.eye(len(SLIDERS))]
    return np.stack(one_by_one, axis=1)


def explorer() -> Explorer:
    """Return the explorer."""
    corner = printed.corners(HEAD)[0]
    table1 = printed.interior(1, HEAD)
    as_printed = [getattr(table1, key) / unit for key, unit in KEYS.items()]
    return Explorer(
        name="explorer-distortion",
        caption=(
            f"The distortion of a lens with the format of {HEAD}. Left, arrows from the ideal to "
            f"the measured points, {EXAGGERATED:.0f} times too long. Right, the distortion along "
            "the radius, towards the upper right and the lower left corner; p₁ and p₂ separate the "
            "two curves. The table has the length of the distortion, and what it is on the ground "
            f"from {FLOWN_M:.0f} m."
        ),
        sliders=SLIDERS,
        presets={
            f"{HEAD} of Table 1": [*as_printed, 0.0],
            "only k₁": [2.0, 0, 0, 0, 0, 0],
            "k₁, k₂ and k₃ against each other": [2.0, -3.0, 1.5, 0, 0, 0],
            "only decentring": [0, 0, 0, 6.0, -3.0, 0],
            "k₁ and a balanced f": [2.0, 0, 0, 0, 0, _balanced(2e-6)],
        },
        panels=[_vectors(), _curve(corner)],
        columns=[
            Column(title="distortion, µm", digits=1),
            Column(title="px", digits=1),
            Column(title="on the ground, m", digits=2),
        ],
        rows={
            name: [
                Linear(matrix=factor * response(np.array([point])))
                for factor in (UM, 1 / printed.pixel_mm(HEAD), FLOWN_M / table1.f)
            ]
            for name, point in (
                ("upper right corner", corner),
                ("lower left corner", -corner),
                ("half way to the upper right", corner / 2),
            )
        },
    )


def _balanced(k1: float) -> float:
    """Return the stop of the last slider that is nearest to the balanced focal length, µm."""
    change = UM * printed.interior(1, HEAD).f * balance(k1, border(HEAD))
    step = SLIDERS[-1].step
    return float(step * round(change / step))


def _vectors() -> Panel:
    half = printed.corners(HEAD)[0]
    limits = 1.12 * half
    size = (360.0, 290.0)
    plane = Plane(x=(-limits[0], limits[0]), y=(-limits[1], limits[1]), size=size)
    xy = grid(HEAD, 9, 7)
    outline = half * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    scale = EXAGGERATED * plane.scale[0], EXAGGERATED * plane.scale[1]
    return Panel(
        title="over the image",
        alt="A rectangle, the image, with arrows outwards that are longest in the corners.",
        size=size,
        fixed=plane.line(outline) + plane.line([(-1, 0), (1, 0)]) + plane.line([(0, -1), (0, 1)]),
        marks=[
            Mark(
                kind="arrows",
                colour="blue",
                at=plane.at(xy),
                scale=scale,
                response=Linear(matrix=response(xy)),
            )
        ],
    )


def _curve(corner: Array) -> Panel:
    far = border(HEAD)
    size = (360.0, 290.0)
    plane = Plane(x=(0.0, 35.0), y=(-100.0, 150.0), size=size, margin=(44.0, 8.0, 26.0, 40.0))
    r = np.linspace(0, far, 29)
    along = corner / np.linalg.norm(corner)
    marks = []
    for way, colour in ((1, "blue"), (-1, "orange")):
        radial = np.einsum(
            "nks,k->ns", response(way * np.outer(r, along)).reshape(len(r), 2, -1), way * along
        )
        both = np.stack([np.zeros_like(radial), UM * radial], axis=1).reshape(2 * len(r), -1)
        at = plane.at(np.column_stack([r, np.zeros_like(r)]))
        marks.append(
            Mark(
                kind="curve", colour=colour, at=at, scale=plane.scale, response=Linear(matrix=both)
            )
        )
    return Panel(
        title="along the diagonal",
        alt="Two curves over the radius, which rise with its third power, one above the other.",
        size=size,
        fixed=plane.axes(
            [0, 10, 20, 30],
            [-100, -50, 0, 50, 100, 150],
            labels=("radius, mm", "distortion outwards, µm"),
        )
        + plane.line([(0, 0), (35, 0)])
        + "".join(
            plane.line([(20, at), (22, at)], colour, 1.6)
            + plane.text((22.8, at), f"to the {where}", anchor="start", shift=(0, 4))
            for at, colour, where in ((142, "blue", "upper right"), (125, "orange", "lower left"))
        ),
        marks=marks,
    )
