"""OpenSfM's camera models, from the ideal point to the normalised one.

https://opensfm.org/docs/geometry.html; names in the files as in ``opensfm/io.py``, order of the
steps as in ``opensfm/src/geometry/camera_instances.h``: a projection, then its distortion.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acx4lib.exchange import lens
from acx4lib.exchange.programs.shared import oriented
from acx4lib.exchange.programs.shared.cameras import Lens
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.problems import RANGES, Range, quoted

FOCAL = Range(1e-3, 1e3, "must be the focal length divided by the longer side of the image")
COEFFICIENT = Range(-1e6, 1e6)

ANISOTROPIC = ("brown", "radial", "simple_radial", "fisheye_opencv", "fisheye62", "fisheye624")
"""Models with two focal lengths and a principal point."""

Numbers = Callable[[str], float]
"""A coefficient by its name; zero where the file has none."""

Distortion = Callable[[Numbers, Array], Array]


def read(node: Node) -> Lens:
    """Return a camera of reconstruction.json, camera_models.json or cameras.json.

    Parameters
    ----------
    node : Node

    Raises
    ------
    FlightError
        For a model that has no perspective image, or that is not known.
    """
    kind, numbers = _kind(node), _numbers(node)
    width, height = (int(node.one(key).number(RANGES[f"{key}_px"])) for key in ("width", "height"))
    longer, two = max(width, height), kind in ANISOTROPIC
    focal = ("focal_x", "focal_y") if two else ("focal", "focal")
    fx, fy = (node.one(key).number(FOCAL) for key in focal)
    cx, cy = (numbers(key) if two else 0.0 for key in ("c_x", "c_y"))
    hole = lens.Pinhole(
        fx=fx * longer,
        fy=fy * longer,
        cx=cx * longer + (width - 1) / 2,
        cy=cy * longer + (height - 1) / 2,
    )

    def forward(ideal: Array) -> Array:
        return MODELS[kind](numbers, ideal)

    start = _from_angle if kind.startswith("fisheye") else _same
    ideal = oriented.backwards(forward, hole, start)
    return Lens(width_px=width, height_px=height, hole=hole, ideal=ideal)


def _kind(node: Node) -> str:
    place = node.maybe("projection_type")
    kind = "perspective" if place is None else place.text()
    if kind in MODELS:
        return kind
    expected = f"must be one of {', '.join(MODELS)}"
    if kind in ("spherical", "equirectangular"):
        expected = "has rays in all directions, and is no camera of a flight"
    raise (place or node).wrong(quoted(kind), expected)


def _numbers(node: Node) -> Numbers:
    def number(name: str) -> float:
        found = node.maybe(name)
        return 0.0 if found is None else found.number(COEFFICIENT)

    return number


def _same(points: Array) -> Array:
    return points


def _from_angle(points: Array) -> Array:
    """Return the points of a plane at distance 1 whose rays have these angles from the axis."""
    theta = np.linalg.norm(points, axis=1, keepdims=True)
    ahead = np.minimum(theta, 1.5)  # beyond there is no ray ahead, and the search will say so
    return points * np.where(theta > 0, np.tan(ahead) / np.where(theta > 0, theta, 1.0), 1.0)


def _decentring(numbers: Numbers, at: Array) -> Array:
    """Return the part of p1, p2, in OpenCV's order."""
    x, y = at.T
    r2 = x * x + y * y
    p1, p2 = numbers("p1"), numbers("p2")
    return np.stack(
        [2 * p1 * x * y + p2 * (r2 + 2 * x * x), 2 * p2 * x * y + p1 * (r2 + 2 * y * y)], axis=1
    )


def _radial(*names: str) -> Distortion:
    def distorted(numbers: Numbers, at: Array) -> Array:
        r2 = np.sum(at**2, axis=1, keepdims=True)
        powers = (numbers(name) * r2**power for power, name in enumerate(names, start=1))
        return at * sum(powers, np.ones_like(r2))

    return distorted


def _brown(numbers: Numbers, ideal: Array) -> Array:
    return _radial("k1", "k2", "k3")(numbers, ideal) + _decentring(numbers, ideal)


def _angular(ideal: Array) -> Array:
    """Return points whose distance from the middle is the angle of the ray from the axis."""
    r = np.linalg.norm(ideal, axis=1, keepdims=True)
    return ideal * np.where(r > 0, np.arctan(r) / np.where(r > 0, r, 1.0), 1.0)


def _fisheye(*names: str) -> Distortion:
    def distorted(numbers: Numbers, ideal: Array) -> Array:
        return _radial(*names)(numbers, _angular(ideal))

    return distorted


def _fisheye62(numbers: Numbers, ideal: Array) -> Array:
    at = _angular(ideal)
    return _radial(*(f"k{k}" for k in range(1, 7)))(numbers, at) + _decentring(numbers, at)


def _dual(numbers: Numbers, ideal: Array) -> Array:
    """Return points between those of a perspective and of a fisheye camera."""
    weight = numbers("transition")
    return _radial("k1", "k2")(numbers, weight * ideal + (1 - weight) * _angular(ideal))


MODELS: dict[str, Distortion] = {
    "perspective": _radial("k1", "k2"),
    "simple_radial": _radial("k1"),
    "radial": _radial("k1", "k2"),
    "brown": _brown,
    "fisheye": _fisheye("k1", "k2"),
    "fisheye_opencv": _fisheye("k1", "k2", "k3", "k4"),
    "fisheye62": _fisheye62,
    "dual": _dual,
}
"""By `projection_type`."""
