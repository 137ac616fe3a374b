"""Fisheyes of MicMac's version 1: ModUnif with 10 radial, 5 decentring terms, polynomials to x⁵.

As its source has them: an ideal pixel, seen from the centre of distortion c in units of the state
s, is moved along its direction to the fisheye's distance; with r² of that point p the measured one
is c + s (p (1 + sum of K_i r^2i) + decentring + polynomials).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acx4lib.expected import Array
from acx4lib.flight.problems import Range, quoted
from acx4tools.exchange.lens import Model
from acx4tools.exchange.programs.mmvii import PROJECTIONS
from acx4tools.exchange.safe.xml_tree import Element

MODELS = {
    "eModele_FishEye_10_5_5": "FE_EquiDist",
    "eModele_EquiSolid_FishEye_10_5_5": "FE_EquiSolid",
    "eModele_Stereographik_FishEye_10_5_5": "StereroGraphik",
}
"""Names of version 1, and of the projections of version 2 that they begin with."""

RADIAL, DECENTRING, DEGREE = 10, 5, 5

N = 50
"""Number of parameters: centre, radial and decentring terms, polynomials."""

STATE = Range(1e-3, 1e9, "must be positive")


def measured(model: Element) -> Model:
    """Return the map from ideal pixels to measured ones, shape (n, 2), of an element ModUnif.

    Raises
    ------
    FlightError
        For parameters that are not those of a fisheye.
    """
    kind = model.one("TypeModele").text
    values = np.array([one.number() for one in model.each("Params")])
    if len(values) > N:
        raise model.wrong(f"has {len(values)} Params", f"must have at most {N}")
    values = np.pad(values, (0, N - len(values)))
    state, distance = model.one("Etats").number(allowed=STATE), PROJECTIONS[MODELS[kind]]
    if distance is None:
        raise model.wrong(quoted(kind), "must be a fisheye")
    first = 2 + RADIAL
    radial, decentring = values[2:first], values[first : first + 2 * DECENTRING].reshape(-1, 2)

    def moved(colrow: Array) -> Array:
        at = (colrow - values[:2]) / state
        r = np.hypot(*at.T)
        scale = np.divide(distance(np.arctan(r)), r, out=np.ones_like(r), where=r > 0)
        p = at * scale[:, None]
        r2 = np.sum(p * p, axis=1)
        out = p * (1 + sum(k * r2**n for n, k in enumerate(radial, start=1)))[:, None]
        for n, pair in enumerate(decentring, start=1):  # derivatives of p r^2n by the centre
            if pair.any():
                across = 2 * n * p * (p @ pair)[:, None] * (r2 ** (n - 1))[:, None]
                out += across + np.outer(r2**n, pair)
        out += _polynomials(p, values[first + 2 * DECENTRING :])
        moved: Array = values[:2] + state * out
        return moved

    return moved


def _polynomials(p: Array, values: Array) -> Array:
    """Return the polynomials of degree 1 and 3 to 5."""
    x, y = p.T
    a, b = values[:2]
    out = np.stack([a * x + b * y, b * x], axis=1)
    for value, (axis, n, k) in zip(values[2:], _terms(), strict=True):
        if value:
            out[:, axis] += value * x ** (n - k) * y**k
    return out


def _terms() -> Iterator[tuple[int, int, int]]:
    """Yield the axis, the degree and the power of y of each term, in the order of the file."""
    for n in range(3, DEGREE + 1):
        for k in range(n + 1):
            if k:
                yield 0, n, k
            if n % 2 or k != n:
                yield 1, n, k
