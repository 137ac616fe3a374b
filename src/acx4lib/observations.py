"""Observations of a bundle that are no image points: control points, positions, attitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib._typing import Array, Index
from acx4lib.block import SurveyedPoints
from acx4lib.frames import Pose, log, log_jacobian, transform
from acx4lib.normal_equations import Equations


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseObservations:
    """Positions and attitudes of poses, observed.

    Attributes
    ----------
    T_m_b : Pose
        n_poses observed poses.
    R_g_m : ndarray, shape (n_poses, 3, 3)
        Mapping axes to the axes along which position sigma is given.
    sigma_position : ndarray, shape (n_poses, 3)
        m; infinite where a position is no observation.
    sigma_attitude : ndarray, shape (n_poses, 3)
        About the pose's own axes, radians; infinite where an attitude is no observation.
    """

    T_m_b: Pose
    R_g_m: Array
    sigma_position: Array
    sigma_attitude: Array


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
        # a single component that is given free of error is good to a micrometre
        sigma=np.maximum(control.sigma_m, 1e-6),
        A=np.zeros((n, 3, 0)),
        columns=np.zeros((1, 0), dtype=np.intp),
        unit=np.zeros(n, dtype=np.intp),
        B=control.R_g_m,
        point=control.point_idx,
    )


def position_equations(observed: PoseObservations, T_m_b: Pose, columns: Index) -> Equations:
    """Linearise observed positions, along the grid's axes.

    Parameters
    ----------
    observed : PoseObservations
    T_m_b : Pose
        Estimates.
    columns : ndarray, shape (n_poses, 3)
        Of the positions.
    """
    return Equations(
        kind="gnss",
        v=transform(observed.R_g_m, T_m_b.r - observed.T_m_b.r),
        sigma=observed.sigma_position,
        A=observed.R_g_m,
        columns=columns,
        unit=np.arange(len(T_m_b)),
    )


def attitude_equations(observed: PoseObservations, T_m_b: Pose, columns: Index) -> Equations:
    """Linearise observed attitudes, about the body's axes.

    Parameters
    ----------
    observed : PoseObservations
    T_m_b : Pose
        Estimates.
    columns : ndarray, shape (n_poses, 3)
        Of the attitudes.
    """
    v = log(np.swapaxes(observed.T_m_b.R, -1, -2) @ T_m_b.R)
    return Equations(
        kind="attitude",
        v=v,
        sigma=observed.sigma_attitude,
        A=log_jacobian(v),
        columns=columns,
        unit=np.arange(len(T_m_b)),
    )
