"""Joint tests of several parameters of a calibration, from their covariance.

A single test compares a parameter with a value while the others are free. Where k1, k2 and k3
correlate by -0.99, each of them may be near zero if the other two take over its part. So none seems
significant, although together they are. A joint test compares all of them at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.bundle.unknowns import Layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.frames import log
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM, MOUNT
from acx4lib.least_squares import statistics
from acx4lib.least_squares.covariance import correlation, sigmas

KEYS = (*INTERIOR, *MOUNT)

GROUPS = (("k1", "k2", "k3"), ("p1", "p2"), LEVER_ARM, BORESIGHT)
"""Parameters that are tested together."""


@dataclass(frozen=True, kw_only=True)
class GroupTest:
    """Several parameters of one camera, tested together against given values.

    Attributes
    ----------
    camera : str
    keys : tuple of str
        The library's names of the parameters.
    largest : float
        The largest of their single test statistics, absolute.
    f_ratio : float
        d^T C^-1 d / k of the k differences, C their a posteriori covariance.
    redundancy : int
        Of the adjustment from which sigma0 comes.
    """

    camera: str
    keys: tuple[str, ...]
    largest: float
    f_ratio: float
    redundancy: int

    @property
    def p(self) -> float:
        """Probability of such an F-ratio or a larger one, where the given values are right."""
        return statistics.f_sf(self.f_ratio, len(self.keys), max(self.redundancy, 1))


def undistorted(camera: Camera) -> Camera:
    """Return a camera to test against: it has no distortion, and keeps its mounting."""
    interior = camera.interior
    return camera.with_interior(Interior(f=interior.f, xp=interior.xp, yp=interior.yp))


def group_tests(
    calibration: Calibration, against: Sequence[Camera], *, redundancy: int
) -> list[GroupTest]:
    """Test every group of parameters of every camera, where two or more of it are estimated.

    Parameters
    ----------
    calibration : Calibration
    against : sequence of Camera
        With the values to test against, in the order of the calibration's cameras.
    redundancy : int
        Of the calibration's adjustment.
    """
    expected.instance("calibration", calibration, Calibration)
    expected.sequence("against", against, Camera)
    expected.many("against", against, len(calibration.cameras), "cameras")
    expected.whole("redundancy", redundancy, least=0)
    return list(_group_tests(calibration, against, redundancy))


def _group_tests(
    calibration: Calibration, against: Sequence[Camera], redundancy: int
) -> Iterator[GroupTest]:
    for k, (camera, other) in enumerate(zip(calibration.cameras, against, strict=True)):
        differences = difference(camera, other)
        for group in GROUPS:
            indices, columns = estimated(calibration.layout, k, group)
            if len(indices) < 2 or calibration.open_columns[columns].any():
                continue
            cov = calibration.sigma0_sq * calibration.cov[np.ix_(columns, columns)]
            z = differences[indices] / sigmas(cov)
            yield GroupTest(
                camera=camera.name,
                keys=tuple(KEYS[i] for i in indices),
                largest=float(np.abs(z).max()),
                f_ratio=float(z @ np.linalg.solve(correlation(cov), z)) / len(indices),
                redundancy=redundancy,
            )


def estimated(columns: Layout, k: int, keys: Sequence[str]) -> tuple[Index, Index]:
    """Return the estimated ones among named parameters of camera k, and their columns.

    Parameters
    ----------
    columns : Layout
    k : int
    keys : sequence of str
        The library's names of parameters.

    Returns
    -------
    indices, columns : ndarray of int, shape (m,)
        Indices into `KEYS`, and columns of the layout.
    """
    all_columns = np.concatenate([columns.interior[k], columns.mount[k]])
    indices = np.flatnonzero(np.isin(KEYS, keys) & (all_columns >= 0))
    return indices, all_columns[indices]


def difference(camera: Camera, other: Camera) -> Array:
    """Return all parameters less another camera's, in the order of `KEYS`.

    The boresight's are about the other camera's axes, radians.
    """
    return np.concatenate(
        [
            camera.interior.to_array() - other.interior.to_array(),
            camera.T_b_c.r - other.T_b_c.r,
            log(other.T_b_c.R.T @ camera.T_b_c.R),
        ]
    )
