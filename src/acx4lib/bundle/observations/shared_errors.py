"""What the errors of different exposures of a trajectory have in common, if they change slowly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.bundle.observations.trajectory import slow_errors
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedErrors:
    """Covariances between the body poses of n exposures; those of one are `Trajectory.cov`.

    Attributes
    ----------
    roots : ndarray, shape (n, 6, 6)
        Axes of a pose's errors, columns, times the sigma of their slow part: m and radians.
    together : ndarray, shape (2, n, n)
        Correlation of the slow parts of positions and of attitudes; zero of an exposure with
        itself.
    """

    roots: Array
    together: Array

    def __post_init__(self) -> None:
        n = len(self.roots)
        expected.shape("roots", self.roots, (n, 6, 6))
        expected.shape("together", self.together, (2, n, n))

    def between(self, first: Index, second: Index) -> Array:
        """Return the covariances of pairs of poses, shape (k, 6, 6); zero of one with itself."""
        related = np.repeat(self.together[:, first, second].T, 3, axis=1)
        cov: Array = (self.roots[first] * related[:, None]) @ np.swapaxes(self.roots[second], 1, 2)
        return cov

    def among(self, J: Array) -> Array:
        """Return the part of a covariance that is between exposures: sum of J_i C_ij J_j^T.

        Parameters
        ----------
        J : ndarray, shape (n, q, 6)
            Derivatives of q quantities by the pose of every exposure.

        Returns
        -------
        ndarray, shape (q, q)
        """
        along = np.moveaxis(J @ self.roots, 0, 1)  # (q, n, 6)
        q, n, _ = along.shape
        cov = np.zeros((q, q))
        for related, own in zip(self.together, (along[:, :, :3], along[:, :, 3:]), strict=True):
            cov += np.reshape(related @ own, (q, 3 * n)) @ np.reshape(own, (q, 3 * n)).T
        return cov


def shared_errors(trajectory: Trajectory, rows: Index | slice = slice(None)) -> SharedErrors | None:
    """Return what the errors of a trajectory share; None where exposures err independently.

    Parameters
    ----------
    trajectory : Trajectory
    rows : ndarray or slice
        Exposures, all by default.

    Raises
    ------
    AdjustmentError
        Where an exposure has no time.
    """
    parts = [slow_errors(trajectory, of, rows) for of in ("position", "attitude")]
    if not any(parts):
        return None
    R_m_g = np.swapaxes(trajectory.R_g_m[rows], 1, 2)
    n = len(R_m_g)
    roots, together = np.zeros((n, 6, 6)), np.zeros((2, n, n))
    for i, (slow, axes) in enumerate(zip(parts, (R_m_g, np.eye(3)), strict=True)):
        if slow is not None:
            part = slice(3 * i, 3 * i + 3)
            roots[:, part, part] = axes * slow.sigma[:, None]
            together[i] = slow.together - np.diag(np.diagonal(slow.together))
    return SharedErrors(roots=roots, together=together)
