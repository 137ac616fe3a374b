"""Correlations between the parameters that a bundle estimates (section 4.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.collinearity import mounted_jacobian
from acx4lib.geometry.frames import opk_jacobian
from acx4lib.geometry.parameters import REPORTED
from acx4lib.least_squares.covariance import propagate, sigmas

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
    padded = np.pad(bundle.solution.cov, (0, 1))  # column -1 is held: it has no variance
    interior = padded[columns[estimated][:, None], unknowns[:, None, :]]
    cross = interior @ np.swapaxes(np.concatenate([by_mount, by_body], axis=2), 1, 2)
    to_grid = _to_grid(bundle)[oriented]
    sigma_exterior = sigmas(propagate(to_grid, bundle.camera_pose_covariances[oriented]))
    sigma_interior = sigmas(bundle.solution.cov)[columns[estimated]]
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
