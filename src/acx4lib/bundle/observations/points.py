"""Observations of points besides their rays: surveyed coordinates, and distances between them."""

from __future__ import annotations

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.flight.block import SurveyedPoints
from acx4lib.geometry.distances import Distances, lengths
from acx4lib.geometry.frames import transform
from acx4lib.least_squares.problem import Equations
from acx4lib.least_squares.statistical.residuals import Group


def control_equations(control: SurveyedPoints, x_m: Array) -> Equations:
    """Linearise surveyed coordinates, along the grid's axes.

    Parameters
    ----------
    control : SurveyedPoints
    x_m : ndarray, shape (n_points, 3)
        All points of the block.
    """
    n = len(control)
    return Equations(
        kind="control_point",
        v=transform(control.R_g_m, x_m[control.point_idx] - control.x_m),
        # a single component that is given without error gets a sigma of one micrometre
        sigma=np.maximum(control.sigma_m, 1e-6),
        A=np.zeros((n, 3, 0)),
        columns=np.zeros((1, 0), dtype=np.intp),
        unit=np.zeros(n, dtype=np.intp),
        B=control.R_g_m,
        point=control.point_idx,
    )


def distance_equations(distances: Distances, x_m: Array, joints: Index) -> Equations:
    """Linearise measured distances, in halves: first those at the one end, then at the other.

    An observation has one point at most. A distance d between a and b is two halves, each with
    half of its residual, sigma over the root of two, and one point; an unknown t, added to the
    one and taken off the other, joins them: minimising over t gives the distance's own equation,
    exactly. The unknown has no state.

    Parameters
    ----------
    distances : Distances
    x_m : ndarray, shape (n_points, 3)
        All points of the block.
    joints : ndarray, shape (n,)
        Columns of the unknowns that join the halves.
    """
    n = len(distances)
    length, along = lengths(x_m, distances.point_idx)
    sign = np.repeat([-1.0, 1.0], n)
    return Equations(
        kind="distance",
        v=np.tile((length - distances.distance_m) / 2, 2)[:, None],
        sigma=np.tile(distances.sigma_m / np.sqrt(2), 2)[:, None],
        A=sign[:, None, None],
        columns=joints[:, None],
        unit=np.tile(np.arange(n), 2),
        B=(sign[:, None] * np.tile(along, (2, 1)))[:, None, :],
        point=distances.point_idx.T.ravel(),
    )


def usable(distances: Distances, measured: Index) -> Index:
    """Return the distances that are used: of finite sigma, with both ends among measured points.

    Parameters
    ----------
    distances : Distances
    measured : ndarray
        Points with rays.
    """
    both = np.isin(distances.point_idx, measured).all(axis=1)
    return np.flatnonzero(both & np.isfinite(distances.sigma_m))


def of_halves(values: Array) -> Array:
    """Return the sum of the two halves of every distance, over the first axis."""
    n = len(values) // 2
    total: Array = values[:n] + values[n:]
    return total


def whole(group: Group, distances: Distances) -> Group:
    """Return a group of residuals in which distances are not in halves."""
    if group.kind != "distance":
        return group
    return Group(
        kind=group.kind,
        v=of_halves(group.v),
        sigma=distances.sigma_m[:, None],
        redundancy=of_halves(group.redundancy),
    )
