"""Control points that lie far from all of their rays, unlike the other control points.

Statistical tests cannot find an error of kilometres: before any test, it turns cameras or puts
points behind them. Therefore such points are searched for before an adjustment.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.gross_errors.limits import too_many
from acx4lib.bundle.gross_errors.rejections import Rejection, without
from acx4lib.bundle.network import Network
from acx4lib.bundle.start.ray_misfits import ASTRAY, control_misfits
from acx4lib.bundle.start.start_values import turned_alike
from acx4lib.bundle.unknowns import State
from acx4lib.bundle.uses import robust_start
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.intersection import intersect
from acx4lib.least_squares.covariance import medians, propagate

DOUBTFUL = 2 * ASTRAY
"""Median angle between a control point and its rays above which the point is examined."""

BESIDE = np.radians(60.0)
"""Angle that a wrong measurement, in an image that shows the point, cannot reach."""

THROUGH = ASTRAY / 10
"""A ray that misses a point by a smaller angle passes through it: heights may be a little wrong."""

UNLIKE = 5.0
"""It must also exceed this multiple of the median: bad approximate values affect all points."""

SHARE = 4
"""At most one point in so many is absurd, or one alone: if more are, the others may be wrong."""

ENOUGH = 3
"""Number of other points that must remain; fewer do not orient a block."""


def without_absurd_control(
    block: Block, set_up: Callable[[Block], Network]
) -> tuple[Network, Index]:
    """Return the network of a block without the control points far from all of their rays.

    Parameters
    ----------
    block : Block
    set_up : callable
        Makes the network of a block.

    Returns
    -------
    network : Network
    rows : ndarray of int
        Rows of these points in the control of the given block.
    """
    network = set_up(block)
    rows = _absurd(network, set_up)
    if len(rows):
        network = set_up(without(block, _taken_out(rows)))
    return network, rows


def _absurd(network: Network, set_up: Callable[[Block], Network]) -> Index:
    """Return the absurd control points: some are doubted first, then tested without them.

    For the first step all poses of a camera turn alike onto the control points. For the second
    the orientation is the one that most of the other observations agree on.
    """
    none = np.zeros(0, dtype=np.intp)
    if not np.any(control_misfits(network, network.start) > DOUBTFUL):
        return none
    doubted = unlike(_misfits(network, turned_alike(network)))
    if not doubted.any():
        return none
    surveyed = network.block.control.point_idx
    rows = np.flatnonzero(np.isin(surveyed, network.control.point_idx[doubted]))
    state = robust_start(set_up(without(network.block, _taken_out(rows))))
    astray = network.control.point_idx[_misfits(network, state) > ASTRAY]
    return rows[np.isin(surveyed[rows], astray)]


def _misfits(network: Network, state: State) -> Array:
    """Return the median angles of control points; zero for a single ray that may be wrong."""
    off = control_misfits(network, state)
    rays = np.bincount(network.image_points.point_idx, minlength=network.n_points)
    return np.where((rays[network.control.point_idx] == 1) & (off < BESIDE), 0.0, off)


def unlike(misfits: Array) -> Mask:
    """Tell which few points miss their rays by far more than the others; none if there are many.

    Parameters
    ----------
    misfits : ndarray, shape (k,)
        Median angles between points and their rays, radians.
    """
    if len(misfits) <= ENOUGH:
        return np.zeros(len(misfits), dtype=bool)
    out: Mask = misfits > max(DOUBTFUL, UNLIKE * float(np.median(misfits)))
    n, n_all = int(out.sum()), len(out)
    few = n <= max(1, n_all // SHARE) and not too_many(n, n_all)
    return out if few and n_all - n >= ENOUGH else np.zeros_like(out)


def tested(block: Block, bundle: Bundle, rows: Index) -> tuple[Rejection, ...]:
    """Return the rejections of absurd control, with the largest w of each if it were put back.

    Parameters
    ----------
    block : Block
        The block with these control points.
    bundle : Bundle
        Adjusted without them. A point with too few rays has its approximate coordinates, and they
        count as known.
    rows : ndarray of int
        Rows of the block's control.
    """
    control = block.control[rows]
    estimated = bundle.state.x_m[control.point_idx]
    d = np.einsum("nij,nj->ni", control.R_g_m, estimated - control.x_m)
    cov = propagate(control.R_g_m, bundle.solution.cov_points[control.point_idx])
    predicted = np.diagonal(cov, axis1=1, axis2=2)
    w = np.max(np.abs(d) / np.sqrt(control.sigma_m**2 + predicted), axis=1)
    return tuple(replace(r, statistic=float(x)) for r, x in zip(_taken_out(rows), w, strict=True))


def elsewhere(origins: Array, directions: Array, point_idx: Index, x_m: Array) -> Mask:
    """Tell which points were surveyed far from where their rays meet, unlike the other points.

    "Far" is a share of the distance to the cameras. The survey of a point is not blamed where
    most of its rays pass through the surveyed position, or where its rays do not meet.

    Parameters
    ----------
    origins, directions : ndarray, shape (n, 3)
        Start points and directions of the rays, mapping frame.
    point_idx : ndarray, shape (n,)
    x_m : ndarray, shape (k, 3)
        Surveyed coordinates, m.
    """
    to = x_m[point_idx] - origins
    distance = np.linalg.norm(to, axis=1)
    chord = np.linalg.norm(to / distance[:, None] - directions, axis=1)
    miss = medians(chord, point_idx, len(x_m)) > THROUGH
    met_m = intersect(origins, directions, point_idx, len(x_m))
    along = np.sum((met_m[point_idx] - origins) * directions, axis=1)
    meets = np.bincount(point_idx, minlength=len(x_m)) > 1
    meets[point_idx[~(along > 0)]] = False
    off = np.linalg.norm(met_m - x_m, axis=1) / np.maximum(medians(along, point_idx, len(x_m)), 1)
    out = np.zeros(len(x_m), dtype=bool)
    out[meets] = unlike(off[meets])
    return out & miss


def _taken_out(rows: Index) -> tuple[Rejection, ...]:
    """Return the rejections of whole control points, not tested yet."""
    return tuple(
        Rejection(kind="control_point", row=int(row), component=-1, statistic=np.inf)
        for row in rows
    )
