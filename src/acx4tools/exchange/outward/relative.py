"""Heads of a rig relative to the first of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import Pose, opk_jacobian, skew
from acx4lib.least_squares.covariance import propagate, sigmas

R_C_V = np.diag([1.0, -1.0, -1.0])
"""From the axes of computer vision, y down and z ahead, to the library's camera axes, and back."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relative:
    """A head in the axes of the reference head.

    Attributes
    ----------
    T_r_h : Pose
        Head to reference, library's camera axes, m.
    cov : ndarray, shape (6, 6)
        Of the position along the reference's axes, m, and of a rotation about the head's axes,
        radians; zero where nothing is estimated.
    """

    T_r_h: Pose
    cov: Array

    @property
    def T_v_r_h(self) -> Pose:
        """The same with y down and z ahead in both heads."""
        return Pose(R=R_C_V @ self.T_r_h.R @ R_C_V, r=R_C_V @ self.T_r_h.r)

    @property
    def sigma_opk(self) -> Array:
        """Standard deviations of omega, phi, kappa of `T_v_r_h`, radians, shape (3,)."""
        J = opk_jacobian(self.T_v_r_h.opk) @ R_C_V
        return sigmas(propagate(J, self.cov[3:, 3:]))

    @property
    def sigma_position(self) -> Array:
        """Standard deviations of the position, m, shape (3,); signs of axes do not matter."""
        return sigmas(self.cov[:3, :3])


def to_first(calibration: Calibration) -> tuple[Relative, ...]:
    """Return all cameras of a calibration relative to the first one, which is the identity.

    Parameters
    ----------
    calibration : Calibration
        With a posteriori covariance.
    """
    first = calibration.cameras[0].T_b_c
    out = []
    for k, camera in enumerate(calibration.cameras):
        T_r_h = first.inverse @ camera.T_b_c if k else Pose(R=np.eye(3), r=np.zeros(3))
        J = np.zeros((6, calibration.n_columns + 1))  # the last column is of what is held
        if k:
            by_first, by_head = _derivatives(first, T_r_h)
            _add(J, calibration.layout.mount[0], by_first)
            _add(J, calibration.layout.mount[k], by_head)
        out.append(Relative(T_r_h=T_r_h, cov=propagate(J[:, :-1], calibration.cov)))
    return tuple(out)


def _derivatives(first: Pose, T_r_h: Pose) -> tuple[Array, Array]:
    """Return d(relative pose) / d(mounting) of the reference and of the head, (6, 6) each."""
    by_first, by_head = np.zeros((6, 6)), np.eye(6)
    by_first[:3, :3], by_head[:3, :3] = -first.R.T, first.R.T
    by_first[:3, 3:] = skew(T_r_h.r)
    by_first[3:, 3:] = -T_r_h.R.T
    return by_first, by_head


def _add(J: Array, columns: Index, derivative: Array) -> None:
    for j, column in enumerate(columns):
        J[:, column] += derivative[:, j]  # column -1 is the one of what is held
