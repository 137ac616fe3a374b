"""Signalised points looked for in all pictures of a block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.camera import inside
from acx4lib.tie_points.overlaps import grey
from acx4tools.measuring.pictures.views import View, pixels_of, pixels_of_view
from acx4tools.measuring.surveyed.discs import RADII_PX, discs
from acx4tools.measuring.surveyed.votes import Candidate, elected

SEARCH = 0.006
"""Radius of the search, in flying heights: what the ties leave open of lever arm and boresight."""

LEAST_PX = 12


def find_targets(views: Sequence[View], x_m: Array) -> list[Candidate]:
    """Return the places of signalised points in pictures.

    Parameters
    ----------
    views : sequence of View
        With orientations on which the pictures agree.
    x_m : ndarray, shape (n, 3)
        Surveyed points, mapping frame, m.

    Returns
    -------
    list of Candidate
        For every point that was found, one for each picture.
    """
    return elected([one for i, view in enumerate(views) for one in _candidates(i, view, x_m)])


def _candidates(i: int, view: View, x_m: Array) -> Iterator[Candidate]:
    """Yield the discs near the places of all points in a picture."""
    places = pixels_of(view, x_m)
    away = np.linalg.norm(x_m - view.T_m_c.r[0], axis=1)
    pixel_m = away * view.camera.pixel_mm / view.camera.interior.f
    for k in np.flatnonzero(inside(view.camera, places)).tolist():
        reach = int(max(LEAST_PX, SEARCH * away[k] / pixel_m[k])) + int(2 * max(RADII_PX))
        window, first = _window(view, places[k], reach)
        for disc in discs(window):
            colrow = first + np.array([disc.col, disc.row])
            yield Candidate(
                point=k,
                view=i,
                at_m=(float(x_m[k, 0]), float(x_m[k, 1])),
                offset_m=_offset(view, x_m[k], places[k], colrow),
                pixel_m=float(pixel_m[k]),
                radius_m=float(disc.radius_px * pixel_m[k]),
                bright=disc.contrast > 0,
                correlation=disc.correlation,
                colrow=(float(colrow[0]), float(colrow[1])),
                sigma_px=disc.sigma_px,
            )


def _window(view: View, place: Array, reach: int) -> tuple[Array, Array]:
    """Return the grey values around a place, and the col, row of their first pixel."""
    image = pixels_of_view(view)
    col, row = np.rint(place).astype(int)
    top, left = max(row - reach, 0), max(col - reach, 0)
    part = image[top : row + reach + 1, left : col + reach + 1]
    return grey(np.ascontiguousarray(part)), np.array([left, top])


def _offset(view: View, x_m: Array, place: Array, colrow: Array) -> tuple[float, float]:
    """Return by how much a point would have to move on its level to be seen at a pixel, m."""
    step = 1.0
    moved = x_m + step * np.array([[1.0, 0, 0], [0, 1.0, 0]])
    J = (pixels_of(view, moved) - place).T / step
    east, north = np.linalg.solve(J, colrow - place)
    return float(east), float(north)
