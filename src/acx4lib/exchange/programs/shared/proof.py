"""The proof of conventions: a program's own points, projected by what was imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from acx4lib.exchange.brought import number_of
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import project, rays
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.intersection import intersect


def misfits(
    cameras: Mapping[str, Camera], names: Sequence[str], T_w_c: Pose, x_w: Array, colrow: Array
) -> Array:
    """Return the distances of measured points from projected ones, px, shape (n,).

    Parameters
    ----------
    cameras : mapping of str to Camera
    names : sequence of str
        The camera of each measurement.
    T_w_c : Pose
        The camera pose of each measurement in any Cartesian frame, the library's camera axes.
    x_w : ndarray, shape (n, 3)
        The point of each measurement.
    colrow : ndarray, shape (n, 2)
        The library's pixels.

    Returns
    -------
    ndarray, shape (n,)
        NaN where a point is not seen.
    """
    of, apart = np.asarray(names), np.full(len(colrow), np.nan)
    for name, camera in cameras.items():
        k = np.flatnonzero(of == name)
        if len(k):
            seen = project(camera, T_w_c[k], x_w[k])
            apart[k] = np.hypot(*(seen - colrow[k]).T)
    return apart


def intersected(
    cameras: Mapping[str, Camera],
    names: Sequence[str],
    T_w_c: Pose,
    colrow: Array,
    point_idx: Index,
    n_points: int,
) -> Array:
    """Return the points in which rays meet best, shape (n_points, 3); arrays as in `misfits`."""
    of, along = np.asarray(names), np.zeros((len(colrow), 3))
    for name, camera in cameras.items():
        k = np.flatnonzero(of == name)
        if len(k):
            along[k] = rays(camera, T_w_c[k], colrow[k])
    return intersect(T_w_c.r, along, point_idx, n_points)


def said(apart: Array) -> str:
    """Return the size of misfits as text: rms, median and largest, px."""
    known = apart[np.isfinite(apart)]
    if not len(known):
        return "none is seen by its image"
    rms = np.sqrt(np.mean(known**2))
    return (
        f"{rms:.3g} px rms, median {np.median(known):.3g} px, largest {known.max():.3g} px "
        f"({number_of(len(known), 'measurements')}"
        + (f", {n} not seen)" if (n := len(apart) - len(known)) else ")")
    )
