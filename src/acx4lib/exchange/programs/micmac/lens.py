"""A calibration of MicMac: focal length, principal point, distortion, all in pixels.

With `eConvApero_DistM2C` the distortion takes the ideal pixel to the measured one; the points under
`Verif` in MicMac's own orientations confirm this to 1e-9 px.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acx4lib.exchange import lens
from acx4lib.exchange.programs.shared import oriented
from acx4lib.exchange.programs.shared.cameras import Lens
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.expected import Array
from acx4lib.flight.problems import RANGES, Range, quoted

KNOWN = "eConvApero_DistM2C"
"""The convention of all files that MicMac writes itself."""

FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")

COEFFICIENT = Range(-0.5, 0.5)
"""P1 and P2 per pixel, b1 and b2 without a unit."""

MODELS = ("ModNoDist", "ModRad", "ModPhgrStd")
"""Distortion models that are read; others are refused by name."""

Shift = Callable[[Array], Array]
"""What a distortion adds to ideal pixels, shape (n, 2)."""


def read(root: Element) -> Lens:
    """Return the camera of an AutoCal*.xml.

    Raises
    ------
    FlightError
        For another convention, another distortion model, or a camera that is no central one.
    """
    known = root.maybe("KnownConv")
    if known is not None and known.text != KNOWN:
        raise known.wrong(quoted(known.text), f"must be {KNOWN}")
    for tag in ("OrIntGlob", "OrIntImaM2C"):
        if (extra := root.maybe(tag)) is not None:
            require_plain(extra)
    cx, cy = root.one("PP").numbers(2).tolist()
    width, height = (_size(root, k) for k in (0, 1))
    fx, fy = _focal(root)
    hole = lens.Pinhole(fx=fx, fy=fy, cx=cx, cy=cy)
    shifts = [_shift(one) for one in root.each("CalibDistortion")]

    def forward(ideal: Array) -> Array:
        colrow = hole.colrow(ideal)
        for shift in shifts:
            colrow = colrow + shift(colrow)
        return hole.points(colrow)

    ideal = oriented.backwards(forward, hole, lambda points: points)
    return Lens(width_px=width, height_px=height, hole=_stretched(hole, root), ideal=ideal)


def _stretched(hole: lens.Pinhole, root: Element) -> lens.Pinhole:
    """Return focal lengths and principal point with the b1 of Fraser's model in them."""
    for model in root.everywhere("ModPhgrStd"):
        b1, centre = _optional(model, "b1"), model.one("RadialePart").one("CDist").numbers(2)
        hole = replace(hole, fx=hole.fx * (1 + b1), cx=hole.cx + b1 * (hole.cx - centre[0]))
    return hole


def _size(root: Element, k: int) -> int:
    element = root.one("SzIm")
    value = float(element.numbers(2)[k])
    if value not in RANGES["width_px"]:
        raise element.wrong(quoted(element.text), str(RANGES["width_px"]))
    return int(value)


def _focal(root: Element) -> tuple[float, float]:
    element = root.one("F")
    values = element.numbers().tolist()
    if len(values) not in (1, 2) or any(value not in FOCAL for value in values):
        raise element.wrong(quoted(element.text), str(FOCAL))
    return values[0], values[-1]


def require_plain(element: Element) -> None:
    """Raise for an affine map of pixels that does not leave them where they are."""
    plain = {"I00": [0.0, 0.0], "V10": [1.0, 0.0], "V01": [0.0, 1.0]}
    found = {tag: one for tag in plain for one in element.everywhere(tag)}
    if not all(one.numbers(2).tolist() == plain[tag] for tag, one in found.items()):
        raise element.wrong("turns or scales pixels", "must leave them as they are")


def _shift(element: Element) -> Shift:
    """Return what one distortion of a calibration adds to ideal pixels."""
    if len(element.below) != 1:
        found = f"holds {len(element.below)} models"
        raise element.wrong(found, "must hold one")
    model = element.below[0]
    if model.tag not in MODELS:
        kind = model.maybe("TypeModele")
        name = model.tag if kind is None else f"{model.tag} {kind.text}"
        raise model.wrong(f"distortion {quoted(name)}", f"must be {', '.join(MODELS)}")
    if model.tag == "ModNoDist":
        return np.zeros_like
    radial = model.one("RadialePart") if model.maybe("RadialePart") is not None else model
    centre = radial.one("CDist").numbers(2)
    powers = [one.number() for one in radial.each("CoeffDist")]
    p1, p2, b1, b2 = (_optional(model, tag) for tag in ("P1", "P2", "b1", "b2"))

    def shift(colrow: Array) -> Array:
        at = colrow - centre
        x, y = at.T
        r2 = x * x + y * y
        out = (
            at * sum((k * r2**n for n, k in enumerate(powers, start=1)), np.zeros_like(r2))[:, None]
        )
        out[:, 0] += p1 * (r2 + 2 * x * x) + 2 * p2 * x * y + b1 * x + b2 * y
        out[:, 1] += p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
        return out

    return shift


def _optional(element: Element, tag: str) -> float:
    found = element.maybe(tag)
    return 0.0 if found is None else found.number(allowed=COEFFICIENT)
