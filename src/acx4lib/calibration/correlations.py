"""Correlations between the parameters that a bundle estimates (section 4.1); tests by adjusting."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from acx4lib import expected
from acx4lib.bundle.adjust import Bundle, adjust
from acx4lib.bundle.unknowns import holding
from acx4lib.calibration.estimates import Calibration, parameters, reported_covariance
from acx4lib.calibration.trust.joint_tests import GroupTest, estimated
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.collinearity import mounted_jacobian
from acx4lib.geometry.frames import Pose, opk_jacobian
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM, REPORTED
from acx4lib.least_squares.covariance import correlation, propagate, sigmas
from acx4lib.least_squares.dense import held_at_zero

EXTERIOR = ("east_m", "north_m", "height_m", "omega_deg", "phi_deg", "kappa_deg")
"""The exterior orientation as results report it: relative to the grid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Correlations:
    """Correlations of a camera's interior with the exterior orientation of its images.

    Attributes
    ----------
    interior : tuple of str
        Names of the estimated interior parameters, as results report them.
    values : ndarray, shape (n_images, n_interior, 6)
        Correlations with the components of `EXTERIOR`, for oriented images only.
    """

    interior: tuple[str, ...]
    values: Array

    @property
    def largest(self) -> Array:
        """The largest absolute correlation of every pair, shape (n_interior, 6)."""
        out: Array = np.abs(self.values).max(axis=0, initial=0.0)
        return out


def parameter_correlations(calibration: Calibration) -> pd.DataFrame:
    """Return the correlation matrix of all reported parameters, by their names in results."""
    names = [
        p.name if len(calibration.cameras) == 1 else f"{p.camera}/{p.name}"
        for p in parameters(calibration)
    ]
    matrix = correlation(reported_covariance(calibration))
    return pd.DataFrame(matrix, index=names, columns=names)


def interior_exterior(bundle: Bundle) -> Correlations:
    """Return how the interior orientation correlates with the exterior, image by image.

    Parameters
    ----------
    bundle : Bundle
        An adjustment of one camera.
    """
    network, images = bundle.network, bundle.network.block.images
    columns = network.layout.interior[0]
    estimated = np.flatnonzero(columns >= 0)
    oriented = np.flatnonzero(bundle.oriented)
    pose_idx, camera_idx = network.pose_idx[oriented], images.camera_idx[oriented]
    by_body, by_mount = mounted_jacobian(
        bundle.state.T_m_b[pose_idx], bundle.state.T_b_c[camera_idx]
    )
    unknowns = np.concatenate(
        [network.layout.mount[camera_idx], network.layout.pose[pose_idx]], axis=1
    )
    inverse, free = bundle.solution.inverse, columns[estimated]
    interior = held_at_zero(inverse, free[:, None], unknowns[:, None, :])
    cross = interior @ np.swapaxes(np.concatenate([by_mount, by_body], axis=2), 1, 2)
    to_grid = _to_grid(bundle)[oriented]
    sigma_exterior = sigmas(propagate(to_grid, bundle.camera_pose_covariances[oriented]))
    sigma_interior = sigmas(inverse.at(free[:, None], free))
    values = cross @ np.swapaxes(to_grid, 1, 2)
    return Correlations(
        interior=tuple(REPORTED[INTERIOR[i]][0] for i in estimated),
        values=values / sigma_interior[:, None] / sigma_exterior[:, None, :],
    )


def _to_grid(bundle: Bundle) -> Array:
    """Return d(east, north, height, omega, phi, kappa) / d(pose of every image)."""
    frame, T_m_c = bundle.network.block.frame, bundle.T_m_c
    out = np.zeros((len(T_m_c), 6, 6))
    out[:, :3, :3] = frame.grid_axes(T_m_c.r)
    out[:, 3:, 3:] = opk_jacobian(frame.pose_to_grid(T_m_c)[1])
    return out


def largest_pairs(correlations: Correlations, *, n: int = 4) -> dict[str, float]:
    """Return the largest absolute correlations by the names of their pairs, largest first.

    Parameters
    ----------
    correlations : Correlations
    n : int
        Number of pairs.

    Returns
    -------
    dict
        ``xp_mm/phi_deg`` and the like.
    """
    largest = correlations.largest
    order = np.argsort(-largest, axis=None, kind="stable")[:n]
    return {
        f"{correlations.interior[i]}/{EXTERIOR[j]}": float(largest[i, j])
        for i, j in zip(*np.unravel_index(order, largest.shape), strict=True)
    }


def nested_f_ratio(bundle: Bundle, test: GroupTest, against: Sequence[Camera]) -> float:
    """Return the F-ratio of a group by an adjustment that holds it at the given values.

    It uses the same observations. In a linear problem it equals that of the covariance.

    Parameters
    ----------
    bundle : Bundle
        In which the group was estimated.
    test : GroupTest
    against : sequence of Camera
        With the values to hold, in the order of the bundle's cameras.

    Returns
    -------
    float
        (v^T P v of this adjustment - v^T P v of the bundle) / (k sigma0^2).

    Raises
    ------
    AdjustmentError
        Where the adjustment does not converge.
    """
    expected.instance("bundle", bundle, Bundle)
    expected.instance("test", test, GroupTest)
    network = bundle.network
    expected.many("against", against, len(network.block.cameras), "cameras")
    expected.one_of("test.camera", test.camera, [c.name for c in network.block.cameras])
    k = [camera.name for camera in network.block.cameras].index(test.camera)
    _, columns = estimated(network.layout, k, test.keys)
    state = bundle.state
    interiors, mounts = list(state.interiors), state.T_b_c
    interiors[k], T_b_c = _at(test.keys, interiors[k], mounts[k], against[k])
    R, r = mounts.R.copy(), mounts.r.copy()
    R[k], r[k] = T_b_c.R, T_b_c.r
    start = replace(state, interiors=tuple(interiors), T_b_c=Pose(R=R, r=r))
    held = adjust(replace(network, layout=holding(network.layout, columns), start=start))
    drop = held.solution.cost - bundle.solution.cost
    return drop / len(test.keys) / bundle.solution.sigma0_sq


def _at(
    keys: Sequence[str], interior: Interior, T_b_c: Pose, given: Camera
) -> tuple[Interior, Pose]:
    """Return interior orientation and mounting with the named parameters of another camera."""
    values = {key: getattr(given.interior, key) for key in keys if key in INTERIOR}
    return replace(interior, **values), Pose(
        R=given.T_b_c.R if set(keys) & set(BORESIGHT) else T_b_c.R,
        r=np.where(np.isin(LEVER_ARM, keys), given.T_b_c.r, T_b_c.r),
    )
