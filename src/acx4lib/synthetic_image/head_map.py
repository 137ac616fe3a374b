"""Positions of synthetic pixels in the heads: exact at the nodes of a grid, bilinear between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.interpolate import RectBivariateSpline

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import Camera, inside, xy_from_colrow
from acx4lib.synthetic_image.frame import head_from_synthetic

TOLERANCE = 0.0006
"""Largest allowed error of a position between nodes, px: less than rounding to 16 bits."""

STEPS = (16, 8, 4, 2)
"""Distances of the nodes, px, that are tried to reach `TOLERANCE`."""

KNOTS = 33
"""Points along each side of a head, through which a spline of fifth degree gives its map: to 2e-7
px for the lenses of Table 1."""

EXACT = 1e-5
"""Largest allowed error of this spline, px."""

COARSE = 8  # every eighth node is tested first, to decide whether its neighbours are computed


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadMap:
    """Positions in one head's image of the nodes of a grid over another image.

    There is a node at every `step_px`-th pixel from the first on; the last node lies behind the
    last pixel. Between nodes positions are bilinear. Nodes may come from any geometry.

    Attributes
    ----------
    nodes : ndarray, shape (rows, cols, 2)
        col, row in the head's image, px; NaN where the head sees nothing.
    step_px : int
        Distance of the nodes.
    width_px, height_px : int
        Size of the head's image.
    """

    nodes: Array
    step_px: int
    width_px: int
    height_px: int


def fitting_step(orientation: RelativeOrientation, synthetic: Camera) -> int:
    """Return the largest distance of nodes, px, for which position errors are below `TOLERANCE`.

    The error of a position, px, is proportional to the squared step and to the pixel size. So an
    image at 1/4 of the size needs half the step.
    """
    error = 0.0
    for k, camera in enumerate(orientation.heads):
        nodes = head_map(orientation, k, synthetic, step_px=STEPS[0]).nodes
        inner = nodes[1:-1, 1:-1]
        around = nodes[2:, 1:-1] + nodes[:-2, 1:-1] + nodes[1:-1, 2:] + nodes[1:-1, :-2]
        misfit = np.hypot(*np.moveaxis(around - 4 * inner, -1, 0)).ravel() / 8
        some = np.flatnonzero(np.isfinite(misfit))
        some = some[:: max(len(some) // 20_000, 1)]
        seen = inside(camera, inner.reshape(-1, 2)[some])
        error = max(error, float(np.max(misfit[some][seen], initial=0.0)))
    fits = (step for step in STEPS if error * (step / STEPS[0]) ** 2 <= TOLERANCE)
    return next(fits, STEPS[-1])


def head_map(
    orientation: RelativeOrientation, k: int, synthetic: Camera, *, step_px: int = 16
) -> HeadMap:
    """Return the map from the synthetic image to a head.

    With the heads of Table 1 and a step of 16 px, errors between the nodes are below 0.0022 px;
    they are proportional to the squared step.

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    step_px : int
        Synthetic pixels from node to node.

    Returns
    -------
    HeadMap
        Exact at its nodes; those far outside the head's sensor are NaN.
    """
    window = (0, synthetic.height_px, 0, synthetic.width_px)
    return window_map(orientation, k, synthetic, window, step_px=step_px)


def window_map(
    orientation: RelativeOrientation,
    k: int,
    synthetic: Camera,
    window: tuple[int, int, int, int],
    *,
    step_px: int = 16,
) -> HeadMap:
    """Return the map from a part of the synthetic image to a head; its nodes begin at the part.

    Parameters
    ----------
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    window : tuple of int
        First row, row after the last, first column, column after the last.
    step_px : int
        Synthetic pixels from node to node.
    """
    row_0, row_1, col_0, col_1 = window
    rows = row_0 + step_px * np.arange(_n_nodes(row_1 - row_0, step_px))
    cols = col_0 + step_px * np.arange(_n_nodes(col_1 - col_0, step_px))
    x = xy_from_colrow(synthetic, np.column_stack([cols, np.zeros(len(cols))]))[:, 0]
    y = xy_from_colrow(synthetic, np.column_stack([np.zeros(len(rows)), rows]))[:, 1]
    camera = orientation.heads[k]
    nodes = np.full((len(y), len(x), 2), np.nan)
    near = _near_sensor(orientation, k, x, y)
    rows, cols = (np.flatnonzero(near.any(axis=axis)) for axis in (1, 0))
    if len(rows):
        box = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
        nodes[box] = _positions(orientation, k, x[box[1]], y[box[0]], near[box])
        nodes[box][~near[box]] = np.nan
    return HeadMap(
        nodes=nodes, step_px=step_px, width_px=camera.width_px, height_px=camera.height_px
    )


def _positions(orientation: RelativeOrientation, k: int, x: Array, y: Array, wanted: Mask) -> Array:
    """Return the positions of a grid's nodes in a head, px, shape (rows, cols, 2).

    The map is smooth. Therefore a spline through few points is as good as the map itself, and much
    faster. Where a few nodes show that it is not, all are computed.
    """
    rows, cols = np.nonzero(wanted)
    if len(rows) > KNOTS**2:
        knots_x, knots_y = (np.linspace(line[0], line[-1], KNOTS) for line in (x, y))
        exact = _exact(orientation, k, *np.meshgrid(knots_x, knots_y))
        both = np.moveaxis(np.nan_to_num(exact), -1, 0)
        # y falls, and a spline's knots must rise
        splines = [RectBivariateSpline(-knots_y, knots_x, one, kx=5, ky=5) for one in both]
        positions = np.stack([spline(-y, x) for spline in splines], axis=-1)
        i, j = (index[:: len(rows) // KNOTS**2] for index in (rows, cols))
        if np.max(np.abs(positions[i, j] - _exact(orientation, k, x[j], y[i]))) < EXACT:
            return positions
    positions = np.full((len(y), len(x), 2), np.nan)
    positions[rows, cols] = _exact(orientation, k, x[cols], y[rows])
    return positions


def _exact(orientation: RelativeOrientation, k: int, x: Array, y: Array) -> Array:
    """Return the positions of points x, y of the synthetic image in a head, px, (..., 2)."""
    xy = np.stack([x, y], axis=-1)
    return head_from_synthetic(orientation, k, xy.reshape(-1, 2)).reshape(xy.shape)


def _near_sensor(orientation: RelativeOrientation, k: int, x: Array, y: Array) -> Mask:
    """Return the mask of nodes of coarse cells that a head may see, at least in part."""
    camera = orientation.heads[k]
    rows, cols = (np.unique(np.r_[0:n:COARSE, n - 1]) for n in (len(y), len(x)))
    colrow = _exact(orientation, k, *np.meshgrid(x[cols], y[rows]))
    # a point of a coarse cell is at most twice its longest side away from its corners
    sides = [np.abs(np.diff(colrow, axis=axis)).ravel() for axis in (0, 1)]
    reach = 2 * np.nanmax(np.concatenate([*sides, [0.0]]))
    size = np.array([camera.width_px, camera.height_px])
    close = np.all((colrow > -reach) & (colrow < size + reach), axis=-1)
    near = np.zeros((len(y), len(x)), np.uint8)
    near[np.ix_(rows, cols)] = close
    return cv2.dilate(near, np.ones((2 * COARSE + 1, 2 * COARSE + 1), np.uint8)) > 0


def levelled(head: HeadMap) -> HeadMap:
    """Return a map correct on the average of each cell instead of at its nodes.

    Between exact nodes, bilinear positions all have an error to the same side, on average
    h^2 / 12 times the second derivatives. Moving the nodes by it reduces the RMS error to less
    than half, and the largest error to two thirds.

    Parameters
    ----------
    head : HeadMap
        A map that is exact at its nodes.
    """
    moved = head.nodes.copy()
    rows, cols = (np.flatnonzero(np.isfinite(moved[..., 0]).any(axis=axis)) for axis in (1, 0))
    box = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)) if len(rows) else ()
    for axis in (0, 1):
        nodes, target = (np.moveaxis(part[box], axis, 0) for part in (head.nodes, moved))
        if len(nodes) > 2:
            bend = np.nan_to_num(np.diff(nodes, n=2, axis=0) / 12, copy=False)
            target[1:-1] -= bend
            target[[0, -1]] -= bend[[0, -1]]  # as at their neighbours
    return replace(head, nodes=moved)


def _n_nodes(n_px: int, step_px: int) -> int:
    """Return the number of nodes that enclose a line of pixels."""
    return -(-n_px // step_px) + 1
