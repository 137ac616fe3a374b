"""The worked example as one linear system: 46 observations, 33 unknowns.

The unknowns are the boresight, position and attitude of the body at four exposures, and two points;
all of them but the boresight are observed as well. Nothing is eliminated and nothing is packed: the
system is what the library's bundle solves, written out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4book.foundations import example
from acx4book.foundations.adjusting.fitted import Fit, fit
from acx4lib.expected import Array
from acx4lib.geometry.collinearity import pinhole, pinhole_jacobian
from acx4lib.geometry.frames import Pose, exp, log, rotation_from_opk, skew

BORESIGHT, POSES, POINTS = slice(0, 3), slice(3, 27), slice(27, 33)
"""Columns of the unknowns: three angles; position and attitude by exposure; P and Q."""

IMAGE, POSITION, ATTITUDE, CONTROL = slice(0, 16), slice(16, 28), slice(28, 40), slice(40, 46)
"""Rows of the observations: x and y of P and Q by image, then what is observed of unknowns."""


def row_names() -> list[str]:
    """Return what each observation is; attitudes are small turns about the axes of the body."""
    images, points = example.EXPOSURES["image"], example.CONTROL["point"]
    seen = [
        f"{axis} of {point} in {image}" for image in images for point in points for axis in "xy"
    ]
    along = ("east", "north", "height")
    positions = [f"{axis} of {image}" for image in images for axis in along]
    turns = [f"turn of {image} about {axis}" for image in images for axis in "xyz"]
    return [
        *seen,
        *positions,
        *turns,
        *(f"{axis} of {point}" for point in points for axis in along),
    ]


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """Values of all unknowns.

    Attributes
    ----------
    R_b_c : ndarray, shape (3, 3)
        Boresight.
    T_m_b : Pose
        Four poses of the body.
    x_m : ndarray, shape (2, 3)
        Points, m.
    """

    R_b_c: Array
    T_m_b: Pose
    x_m: Array


def start(boresight_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> State:
    """Return the observed values, and a boresight given by omega, phi, kappa."""
    return State(
        R_b_c=rotation_from_opk(np.radians(boresight_deg)),
        T_m_b=Pose(R=rotation_from_opk(example.attitudes()), r=example.positions()),
        x_m=example.points(),
    )


def moved(state: State, dx: Array) -> State:
    """Return the state after a step; rotations turn about the turned axes."""
    pose = dx[POSES].reshape(4, 6)
    return State(
        R_b_c=state.R_b_c @ exp(dx[BORESIGHT]),
        T_m_b=Pose(R=state.T_m_b.R @ exp(pose[:, 3:]), r=state.T_m_b.r + pose[:, :3]),
        x_m=state.x_m + dx[POINTS].reshape(2, 3),
    )


def equations(state: State) -> tuple[Array, Array, Array]:
    """Return the derivatives, the misclosures and the standard deviations of all observations.

    Parameters
    ----------
    state : State

    Returns
    -------
    A : ndarray, shape (46, 33)
        mm, m and rad by rad, m.
    dl : ndarray, shape (46,)
        Measured minus computed.
    sigma : ndarray, shape (46,)
    """
    A, dl, pose = np.zeros((46, 33)), np.zeros(46), np.arange(24).reshape(4, 6)
    for i, k in np.ndindex(4, 2):
        row = 4 * i + 2 * k
        A[row : row + 2, BORESIGHT], by_pose, by_point, dl[row : row + 2] = _ray(state, i, k)
        A[row : row + 2, POSES.start + pose[i]] = by_pose
        A[row : row + 2, POINTS.start + 3 * k : POINTS.start + 3 * k + 3] = by_point
    A[POSITION, POSES.start + pose[:, :3].ravel()] = np.eye(12)
    A[ATTITUDE, POSES.start + pose[:, 3:].ravel()] = np.eye(12)  # errors are small angles
    A[CONTROL, POINTS] = np.eye(6)
    given, R_b_m = start(), np.swapaxes(state.T_m_b.R, 1, 2)
    dl[POSITION] = (given.T_m_b.r - state.T_m_b.r).ravel()
    dl[ATTITUDE] = log(R_b_m @ given.T_m_b.R).ravel()
    dl[CONTROL] = (given.x_m - state.x_m).ravel()
    return A, dl, _sigma()


def _ray(state: State, i: int, k: int) -> tuple[Array, Array, Array, Array]:
    """Return the derivatives of an image point by boresight, pose and point, and its misclosure."""
    R_c_b, R_b_m = state.R_b_c.T, state.T_m_b.R[i].T
    x_b = R_b_m @ (state.x_m[k] - state.T_m_b.r[i])
    x_c = R_c_b @ (x_b - example.LEVER_ARM_M)
    by_x_c = pinhole_jacobian(example.F_MM, x_c[None])[0]
    by_point = by_x_c @ R_c_b @ R_b_m
    by_pose = np.hstack([-by_point, by_x_c @ R_c_b @ skew(x_b)])
    misclosure = example.measured()[i, k] - pinhole(example.F_MM, x_c[None])[0]
    return by_x_c @ skew(x_c), by_pose, by_point, misclosure


def _sigma() -> Array:
    return np.concatenate(
        [
            np.full(16, example.SIGMA_IMAGE_MM),
            np.tile(example.SIGMA_POSITION_M, 4),
            np.radians(np.tile(example.SIGMA_ATTITUDE_DEG, 4)),
            np.tile(example.SIGMA_CONTROL_M, 2),
        ]
    )


def adjusted(state: State, *, steps: int = 6) -> tuple[State, list[Fit]]:
    """Return the adjusted state and the steps that lead there, as full steps.

    Parameters
    ----------
    state : State
        To start from.
    steps : int
    """
    fits = []
    for _ in range(steps):
        fits.append(fit(*equations(state)))
        state = moved(state, fits[-1].dx)
    return state, fits
