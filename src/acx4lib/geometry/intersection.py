"""Approximate values: forward intersection of rays and space resection of images."""

from __future__ import annotations

import numpy as np

from acx4lib import expected
from acx4lib.errors import not_installed
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, correct, xy_from_colrow
from acx4lib.geometry.frames import Pose

R_C_CV = np.diag([1.0, -1.0, -1.0])
"""Rotation from OpenCV's camera axes, z ahead and y down, to the library's."""

NEARLY = 1e-6
"""Largest error of the squared length of a unit vector."""


def intersect(
    origins: Array,
    directions: Array,
    point_idx: Index,
    n_points: int,
    *,
    weights: Array | float = 1.0,
) -> Array:
    """Return the points with the least sum of squared distances from their rays.

    Parameters
    ----------
    origins, directions : ndarray, shape (n, 3)
        Start points of the rays, m, and their unit vectors.
    point_idx : ndarray, shape (n,)
        The point of each ray.
    n_points : int
    weights : ndarray, shape (n,), optional
        Weights of the rays, at most about one.

    Returns
    -------
    ndarray, shape (n_points, 3)
        m; NaN where a point has fewer than two rays, only parallel rays, or a zero direction.

    Raises
    ------
    ValueError
        If a direction is neither a unit vector nor zero, or `point_idx` reaches n_points.
    """
    expected.shape("directions", directions, ("n", 3))
    expected.shape("origins", origins, (len(directions), 3))
    expected.shape("point_idx", point_idx, (len(directions),))
    expected.places("point_idx", point_idx, n_points)
    length_sq = np.einsum("ni,ni->n", directions, directions)
    _check_lengths(length_sq)
    middle = origins.mean(axis=0) if len(origins) else np.zeros(3)  # large numbers lose digits
    from_middle = origins - middle
    along = np.sum(from_middle * directions, axis=1)
    normal, right = np.empty((n_points, 3, 3)), np.empty((n_points, 3))
    for i in range(3):
        foot = weights * (from_middle[:, i] - along * directions[:, i])
        right[:, i] = np.bincount(point_idx, foot, minlength=n_points)
        for j in range(i, 3):
            across = weights * ((i == j) - directions[:, i] * directions[:, j])
            normal[:, i, j] = np.bincount(point_idx, across, minlength=n_points)
            normal[:, j, i] = normal[:, i, j]
    with np.errstate(invalid="ignore"):  # rays that are NaN meet nowhere
        meets = np.linalg.det(normal) > 1e-9  # about 0.003 degrees between two rays
    out = np.full((n_points, 3), np.nan)
    out[meets] = np.linalg.solve(normal[meets], right[meets][..., None])[..., 0] + middle
    out[point_idx[length_sq == 0]] = np.nan
    return out


def _check_lengths(length_sq: Array) -> None:
    """Raise for a direction that is neither a unit vector nor zero."""
    wrong = (np.abs(length_sq - 1) > NEARLY) & (length_sq != 0)
    if wrong.any():
        row = int(np.argmax(wrong))
        length = np.sqrt(length_sq[row])
        msg = f"directions: expected unit vectors, got one of length {length:.3g} in row {row}"
        raise ValueError(msg)


def largest_angles(directions: Array, point_idx: Index, n_points: int) -> Array:
    """Return the largest angle between any two rays of every point.

    Parameters
    ----------
    directions : ndarray, shape (n, 3)
        Unit vectors.
    point_idx : ndarray, shape (n,)
    n_points : int

    Returns
    -------
    ndarray, shape (n_points,)
        Radians; zero for fewer than two rays.
    """
    order = np.argsort(point_idx, kind="stable")
    counts = np.bincount(point_idx, minlength=n_points)
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    longest = np.zeros(n_points)  # chords, as arc cosines of small angles are not exact
    for count in np.unique(counts[counts > 1]):
        points = np.flatnonzero(counts == count)
        d = directions[order[starts[points][:, None] + np.arange(count)]]
        for offset in range(1, count):
            chord = np.linalg.norm(d[:, offset:] - d[:, :-offset], axis=-1)
            longest[points] = np.maximum(longest[points], chord.max(axis=1))
    return 2 * np.arcsin(np.minimum(longest / 2, 1.0))


def resect(camera: Camera, colrow: Array, x_m: Array) -> Pose:
    """Return a camera's pose from measured points with known coordinates.

    An approximate value, not an adjustment: OpenCV's SQPnP on corrected image points.

    Parameters
    ----------
    camera : Camera
    colrow : ndarray, shape (n, 2)
        Pixels; at least three points.
    x_m : ndarray, shape (n, 3)
        m; they may lie in a plane.

    Returns
    -------
    Pose
        T_m_c.

    Raises
    ------
    ModuleNotFoundError
        Where OpenCV is not installed.
    ValueError
        Where fewer than three points are given, one is not finite, or no pose is found.
    """
    colrow = expected.numbers("colrow", colrow, ("n", 2))
    x_m = expected.numbers("x_m", x_m, (len(colrow), 3))
    expected.finite("colrow", colrow)
    expected.finite("x_m", x_m)
    if len(colrow) < 3:
        msg = f"a resection needs three points or more, got {len(colrow)}"
        raise ValueError(msg)
    try:
        import cv2  # noqa: PLC0415 few flights need a resection, and it loads long
    except ModuleNotFoundError:
        raise not_installed("a resection", "cv2", "images") from None

    ideal = correct(camera.interior, xy_from_colrow(camera, colrow)) / camera.interior.f
    centre = x_m.mean(axis=0)
    success, rvec, tvec = cv2.solvePnP(
        x_m - centre, ideal * [1, -1], np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP
    )
    if not success:
        msg = "no pose found that fits the points"
        raise ValueError(msg)
    R_m_cv: Array = cv2.Rodrigues(rvec)[0].T.astype(float)
    return Pose(R=R_m_cv @ R_C_CV, r=centre - R_m_cv @ tvec[:, 0])
