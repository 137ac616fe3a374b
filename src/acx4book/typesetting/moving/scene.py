"""A scene in space that the reader turns, and the drawing of it that does not turn.

The page holds, as JSON for ``book/_moving/block.js``::

    {
      "from": unit vector from the middle of the scene to the eye,
      "layers": [{"name", "kind", "colour", "size", "at", "axes", "labels"}, ...]
    }

Coordinates are metres from the middle: east, north, up. Kinds of layers are

lines
    Pairs of points in `at` are the ends of lines.
points
    Marks at `at`, `size` px large.
ellipsoids
    Around `at`; `axes` has for each the three vectors to its ends.

Labels belong to the first points of a layer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from acx4book.typesetting import maps
from acx4book.typesetting.moving import plane, shown
from acx4lib.expected import Array

FROM_DEG, ABOVE_DEG = 24.0, 28.0
"""From where the scene is seen at the start: from the south, towards east; above the horizon."""

SIZE = (720.0, 470.0)
"""Of the drawing, px."""

AROUND = 24
"""Points of the outline of an ellipsoid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Things of one kind, which are shown and hidden together.

    Attributes
    ----------
    name : str
        As the reader switches it, plain text.
    kind : str
        ``lines``, ``points`` or ``ellipsoids``.
    colour : str
        Name of a colour of `plane.COLOURS`.
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Layers, and what is said of them.

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
    def middle(self) -> Array:
        """The middle of all points, shape (3,)."""
        at = np.concatenate([layer.at for layer in self.layers])
        middle: Array = (at.min(axis=0) + at.max(axis=0)) / 2
        return middle

    def data(self) -> dict[str, Any]:
        """Return what the page holds for the script."""
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


def view(scene: Scene) -> shown.Shown:
    """Return a scene for a page."""
    return shown.Shown(html(scene), scene.caption)


def html(scene: Scene) -> str:
    """Return the HTML of a scene: the drawing, and the data with which the script replaces it."""
    names = "".join(
        f'<li><i style="background: {plane.COLOURS[layer.colour]}"></i> {escape(layer.name)}</li>'
        for layer in scene.layers
    )
    return (
        f'<figure class="acx4-block" id="{scene.name}"><div class="view">{drawing(scene)}</div>'
        f'<ul class="layers">{names}</ul><figcaption>{escape(scene.caption)}</figcaption>'
        f"{shown.data(scene.data())}</figure>"
    )


def drawing(scene: Scene) -> str:
    """Return the scene as SVG, seen along parallel rays."""
    turn = maps.view(FROM_DEG, ABOVE_DEG)
    flat = [turn.apply(layer.at - scene.middle)[:, :2] for layer in scene.layers]
    half = np.abs(np.concatenate(flat)).max(axis=0)
    factor = float(np.min((np.array(SIZE) / 2 - 18) / half))
    half = np.array(SIZE) / 2 / factor
    paper = plane.Plane(
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


def _layer(paper: plane.Plane, layer: Layer, at: Array, axes: Array) -> str:
    if layer.kind == "lines":
        d = "".join(_line(*pair) for pair in paper.at(at).reshape(-1, 2, 2))
    elif layer.kind == "points":
        d = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in paper.at(at))
    else:
        outlines = outline(axes) + at[:, None]
        d = "".join(plane.through(paper.at(points)) for points in outlines)
    width = layer.size if layer.kind == "points" else 0.9
    labels = "".join(
        paper.text(place, text, colour="ink", shift=(0, -6))
        for place, text in zip(at, layer.labels, strict=False)
    )
    return plane.stroke(d, layer.colour, width) + labels


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


def _line(start: Array, end: Array) -> str:
    return f"M{start[0]:.1f} {start[1]:.1f}L{end[0]:.1f} {end[1]:.1f}"
