"""Which pictures show the same ground, by their approximate orientations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.camera import inside
from acx4tools.measuring.pictures.ground import Surface
from acx4tools.measuring.pictures.views import View, ground_of, pixels_of

GRID = 9
"""Points along each side of a picture, by which the shared part is counted."""

LEAST_SHARE = 0.08
"""Share of the one or the other picture that both must show."""

LARGEST_SCALE = 3.0
"""Ratio of ground pixels above which pictures are not compared."""

STEEPEST = 1.1
"""Ratio of base to height above which the same ground looks too different."""


def overlapping(views: Sequence[View], surface: Surface) -> list[tuple[int, int]]:
    """Return the pairs of views that show enough of the same ground, i < j.

    Parameters
    ----------
    views : sequence of View
    surface : Surface
    """
    grounds = [ground_of(view, surface, _grid(view)) for view in views]
    sizes = np.array([_ground_px(view, x_m) for view, x_m in zip(views, grounds, strict=True)])
    share = np.array([_shares(view, grounds) for view in views])
    both = np.maximum(share, share.T) >= LEAST_SHARE
    ratio = sizes[:, None] / sizes
    both &= np.maximum(ratio, ratio.T) <= LARGEST_SCALE
    r = np.array([view.T_m_c.r[0] for view in views])
    base = np.hypot(*(r[:, None, :2] - r[None, :, :2]).transpose(2, 0, 1))
    high = r[:, 2] - float(np.mean(surface.z))
    both &= base <= STEEPEST * np.minimum(high[:, None], high)
    return [(int(i), int(j)) for i, j in np.argwhere(np.triu(both, 1))]


def _grid(view: View) -> Array:
    cols, rows = view.camera.width_px, view.camera.height_px
    x, y = np.meshgrid(np.linspace(0, cols - 1, GRID), np.linspace(0, rows - 1, GRID))
    return np.column_stack([x.ravel(), y.ravel()])


def _shares(view: View, grounds: Sequence[Array]) -> Array:
    """Return the share of the points of every ground that a view shows."""
    colrow = pixels_of(view, np.concatenate(grounds))
    return np.asarray(inside(view.camera, colrow).reshape(len(grounds), -1).mean(axis=1))


def _ground_px(view: View, x_m: Array) -> float:
    """Return the size of a picture's pixel on the ground, m, at the declared size."""
    high = float(np.nanmedian(np.linalg.norm(x_m - view.T_m_c.r[0], axis=1)))
    return high * view.declared.pixel_mm / view.declared.interior.f
