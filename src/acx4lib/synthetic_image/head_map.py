"""Positions of synthetic pixels in the heads: exact at the nodes of a grid, bilinear between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.polynomial.chebyshev import chebpts1, chebvander

from acx4lib import expected
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import Camera, inside, xy_from_colrow
from acx4lib.synthetic_image.frame import head_from_synthetic

TOLERANCE = 0.0006
"""Largest allowed error of a position between nodes, px: less than rounding to 16 bits."""

STEPS = (16, 8, 4, 2)
"""Distances of the nodes, px, that are tried to reach `TOLERANCE`."""

DEGREE = 16
"""Degree of the polynomial through positions; aerial lenses need less."""

EXACT = 1e-7
"""Largest allowed error of this polynomial, px."""

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

    def __post_init__(self) -> None:
        if self.nodes.ndim != 3 or self.nodes.shape[2] != 2 or min(self.nodes.shape[:2]) < 2:
            msg = f"nodes must have shape (rows, cols, 2), two at least, got {self.nodes.shape}"
            raise ValueError(msg)
        if self.step_px < 1 or min(self.width_px, self.height_px) < 2:
            msg = (
                "a map needs a step of 1 px at least and an image of 2 x 2 px at least, got "
                f"{self.step_px} px and {self.width_px} x {self.height_px} px"
            )
            raise ValueError(msg)


def fitting_step(orientation: RelativeOrientation, synthetic: Camera) -> int:
    """Return the largest distance of nodes, px, for which position errors are below `TOLERANCE`.

    The error of a position, px, is proportional to the squared step and to the pixel size. So an
    image at 1/4 of the size needs half the step.
    """
    for step in STEPS[:-1]:
        if _largest_error(orientation, synthetic, step) <= TOLERANCE:
            return step
    return STEPS[-1]


def _largest_error(orientation: RelativeOrientation, synthetic: Camera, step: int) -> float:
    """Return the largest position error in the middle of cells all over the image, px."""
    size = np.array([synthetic.width_px, synthetic.height_px])
    corners = [np.unique(np.linspace(0, n, 40).astype(int) // step * step) for n in size]
    first = np.stack(np.meshgrid(*corners), axis=-1).reshape(-1, 2)
    offsets = step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.5]])
    xy = xy_from_colrow(synthetic, first[:, None, :] + offsets)
    error = 0.0
    for k, camera in enumerate(orientation.heads):
        colrow = head_from_synthetic(orientation, k, xy.reshape(-1, 2)).reshape(xy.shape)
        colrow = colrow[inside(camera, colrow).any(axis=1)]
        misfits = np.linalg.norm(colrow[:, :4].mean(axis=1) - colrow[:, 4], axis=-1)
        error = max(error, float(np.nanmax(misfits, initial=0.0)))
    return error


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
    expected.places("k", k, len(orientation.heads))
    expected.whole("step_px", step_px)
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

    The map is smooth. Therefore a polynomial through few points is as good as the map itself, and
    much faster. A few nodes are used to check it; if it is not good enough, all are computed.
    """
    if wanted.sum() > 4 * DEGREE**2:
        (points_x, by_x), (points_y, by_y) = _through_points(x), _through_points(y)
        exact = _exact(orientation, k, *np.meshgrid(points_x, points_y))
        positions = np.stack([by_y @ exact[..., i] @ by_x.T for i in (0, 1)], axis=-1)
        rows, cols = np.nonzero(wanted)
        checked = np.linspace(0, len(rows) - 1, DEGREE**2).astype(int)
        rows, cols = rows[checked], cols[checked]
        error = np.abs(positions[rows, cols] - _exact(orientation, k, x[cols], y[rows]))
        if error.max() < EXACT:  # False for NaN
            return positions
    positions = np.full((len(y), len(x), 2), np.nan)
    rows, cols = np.nonzero(wanted)
    positions[rows, cols] = _exact(orientation, k, x[cols], y[rows])
    return positions


def _exact(orientation: RelativeOrientation, k: int, x: Array, y: Array) -> Array:
    """Return the positions of points x, y of the synthetic image in a head, px, (..., 2)."""
    xy = np.stack([x, y], axis=-1)
    return head_from_synthetic(orientation, k, xy.reshape(-1, 2)).reshape(xy.shape)


def _through_points(positions: Array) -> tuple[Array, Array]:
    """Return the points of an interpolating polynomial, and their weights at given positions."""
    unit = chebpts1(DEGREE + 1)
    middle, half = (positions[0] + positions[-1]) / 2, (positions[-1] - positions[0]) / 2
    from_values = chebvander(unit, DEGREE).T * (2 / (DEGREE + 1))
    from_values[0] /= 2
    return middle + half * unit, chebvander((positions - middle) / half, DEGREE) @ from_values


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
    box = _around_seen(moved)
    for axis in (0, 1):
        nodes, target = (np.moveaxis(part[box], axis, 0) for part in (head.nodes, moved))
        if len(nodes) > 2:
            bend = np.nan_to_num(np.diff(nodes, n=2, axis=0) / 12, copy=False)
            target[1:-1] -= bend
            target[[0, -1]] -= bend[[0, -1]]  # as at their neighbours
    return replace(head, nodes=moved)


def _around_seen(nodes: Array) -> tuple[slice, slice]:
    """Return the slices of rows and columns with visible nodes, and one more on each side."""
    seen = np.isfinite(nodes[..., 0])
    indices = [np.flatnonzero(seen.any(axis=axis)) for axis in (1, 0)]
    first, last = zip(*((f[0], f[-1]) if len(f) else (0, 0) for f in indices), strict=True)
    rows, cols = (slice(max(a - 1, 0), b + 2) for a, b in zip(first, last, strict=True))
    return rows, cols


def _n_nodes(n_px: int, step_px: int) -> int:
    """Return the number of nodes that enclose a line of pixels."""
    return -(-n_px // step_px) + 1
