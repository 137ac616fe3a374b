"""Adjustments small enough to print: one point, the whole example, a camera from single images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4book.foundations import example
from acx4lib.expected import Array
from acx4lib.geometry.camera import colrow_from_xy
from acx4lib.geometry.collinearity import (
    Measurement,
    image_derivatives,
    pinhole,
    pinhole_jacobian,
    to_camera,
)
from acx4lib.geometry.frames import Pose, exp, log, rotation_from_opk, skew

# --- The worked example as one linear system: 46 observations, 33 unknowns
#
# The unknowns are the boresight, position and attitude of the body at four exposures, and two
# points; all of them but the boresight are observed as well. Nothing is eliminated and nothing is
# packed: the system is what the library's bundle solves, written out.


BORESIGHT, POSES, POINTS = slice(0, 3), slice(3, 27), slice(27, 33)
"""Columns of the unknowns: three angles; position and attitude by exposure; P and Q."""

IMAGE, POSITION, ATTITUDE, CONTROL = slice(0, 16), slice(16, 28), slice(28, 40), slice(40, 46)
"""Rows of the observations: x and y of P and Q by image, then observed poses and points."""


def row_names() -> list[str]:
    """Name each observation; attitudes are small turns about the axes of the body."""
    images, points = example.EXPOSURES["image"], example.CONTROL["point"]
    coordinates = [
        f"{axis} of {point} in {image}" for image in images for point in points for axis in "xy"
    ]
    along = ("east", "north", "height")
    positions = [f"{axis} of {image}" for image in images for axis in along]
    turns = [f"turn of {image} about {axis}" for image in images for axis in "xyz"]
    return [
        *coordinates,
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


def equations(state: State) -> tuple[Array, Array, Array]:
    """Return the derivatives, the misclosures and the standard deviations of all observations.

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
    observed, R_b_m = start(), np.swapaxes(state.T_m_b.R, 1, 2)
    dl[POSITION] = (observed.T_m_b.r - state.T_m_b.r).ravel()
    dl[ATTITUDE] = log(R_b_m @ observed.T_m_b.R).ravel()
    dl[CONTROL] = (observed.x_m - state.x_m).ravel()
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
    """Return the state after a number of full steps, and the fit of each step.

    Parameters
    ----------
    state : State
        To start from.
    steps : int
    """
    fits = []
    for _ in range(steps):
        fits.append(fit(*equations(state)))
        state = _moved(state, fits[-1].dx)
    return state, fits


def _moved(state: State, dx: Array) -> State:
    """Return the state after a step; rotations turn about the turned axes."""
    pose = dx[POSES].reshape(4, 6)
    return State(
        R_b_c=state.R_b_c @ exp(dx[BORESIGHT]),
        T_m_b=Pose(R=state.T_m_b.R @ exp(pose[:, 3:]), r=state.T_m_b.r + pose[:, :3]),
        x_m=state.x_m + dx[POINTS].reshape(2, 3),
    )


# --- The camera from single images of known points: f and the principal point
#
# The example's camera is held over ground that is flat or has hills. Every image has a pose of its
# own; a change that a pose can imitate does not determine the camera.


HEIGHT_M = 480.0
"""Height of the camera over the ground."""

UNDETERMINED = 1e-9
"""Eigenvalue of the scaled normal matrix below which nothing is determined."""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Derivatives of the points of one image.

    Attributes
    ----------
    xy : ndarray, shape (n, 2)
        mm.
    by_camera : ndarray, shape (2 n, 3)
        By f, xp and yp, mm per mm.
    by_pose : ndarray, shape (2 n, 6)
        By position, mm per m, and rotation, mm per rad.
    """

    xy: Array
    by_camera: Array
    by_pose: Array

    @property
    def left(self) -> Array:
        """Residuals of `by_camera` after a least-squares fit by the pose, shape (2 n, 3)."""
        J = self.by_pose
        return self.by_camera - J @ np.linalg.lstsq(J, self.by_camera, rcond=1e-10)[0]


def view(opk_deg: Sequence[float], *, relief_m: float = 0.0) -> View:
    """Return an image of 35 points.

    Parameters
    ----------
    opk_deg : sequence of float
        omega, phi and kappa of the camera.
    relief_m : float
        Points lie so much over or under the ground, scattered.
    """
    camera = example.camera()
    x, y = np.meshgrid(np.linspace(-18.0, 18.0, 7), np.linspace(-13.0, 13.0, 5))
    xy = np.column_stack([x.ravel(), y.ravel()])
    n = len(xy)
    R = rotation_from_opk(np.radians(opk_deg))
    ray = np.column_stack([xy, np.full(n, -example.F_MM)]) @ R.T
    depth = relief_m * np.cos(np.arange(n) * 2.4) - HEIGHT_M  # scattered, since 2.4 rad is no grid
    T = Pose(R=np.tile(R, (n, 1, 1)), r=np.zeros((n, 3)))
    measurement = Measurement(
        cameras=(camera,),
        camera_idx=np.zeros(n, dtype=np.intp),
        T_m_c=T,
        colrow=colrow_from_xy(camera, xy),
    )
    _, *derivatives = image_derivatives(measurement, ray * (depth / ray[:, 2])[:, None])
    to_mm = 1 / measurement.px_per_mm[:, :, None]
    by_camera, by_pose, _ = ((to_mm * J).reshape(2 * n, -1) for J in derivatives)
    return View(xy=xy, by_camera=by_camera[:, :3], by_pose=by_pose)


def sigma_camera(views: Sequence[View], *, sigma_position: Sequence[float] | None = None) -> Array:
    """Return the standard deviations of f, xp and yp, which all images share, shape (3,), mm.

    Parameters
    ----------
    views : sequence of View
    sigma_position : sequence of float, optional
        Of the observed position of every image, m; by default it is not observed.

    Returns
    -------
    ndarray, shape (3,)
        Infinite, all of them, where one combination is left open.

    Notes
    -----
    The poses are eliminated, image by image, as a bundle eliminates its points.
    """
    N = np.zeros((3, 3))
    for each in views:
        C, J = each.by_camera / example.SIGMA_IMAGE_MM, each.by_pose / example.SIGMA_IMAGE_MM
        V = J.T @ J
        if sigma_position is not None:
            V[:3, :3] += np.diag(1 / np.square(sigma_position))
        N += C.T @ C - C.T @ J @ np.linalg.solve(V, J.T @ C)
    scale = np.sqrt(sum(np.sum(np.square(each.by_camera), axis=0) for each in views))
    scale = scale / example.SIGMA_IMAGE_MM
    if np.linalg.eigvalsh(N / scale / scale[:, None])[0] < UNDETERMINED:
        return np.full(3, np.inf)
    return np.sqrt(np.linalg.inv(N).diagonal())


# --- A point of the example from its images: the rays are intersected by least squares


STEPS = 5
"""Steps of the iteration, which doubles its correct digits with each of them."""


def cameras(boresight_deg: Sequence[float] = tuple(example.TRUTH.values())) -> Pose:
    """Return the camera poses of the four images from the observed ones of the body.

    Parameters
    ----------
    boresight_deg : sequence of float
        omega, phi, kappa; by default the true ones.
    """
    R_b_c = rotation_from_opk(np.radians(boresight_deg))
    T_m_b = Pose(R=rotation_from_opk(example.attitudes()), r=example.positions())
    return T_m_b @ Pose(R=R_b_c, r=np.array(example.LEVER_ARM_M))


def linearised(T_m_c: Pose, xy: Array, x_m: Array) -> tuple[Array, Array]:
    """Return the equations of a point: derivatives of its image points, observed minus computed.

    Parameters
    ----------
    T_m_c : Pose
        k camera poses.
    xy : ndarray, shape (k, 2)
        Measured in their images, mm.
    x_m : ndarray, shape (3,)
        Approximate point, m.

    Returns
    -------
    A : ndarray, shape (2 k, 3)
        mm per m.
    dl : ndarray, shape (2 k,)
        mm.
    """
    x_c = to_camera(T_m_c, np.tile(x_m, (len(xy), 1)))
    by_point = pinhole_jacobian(example.F_MM, x_c) @ np.swapaxes(T_m_c.R, 1, 2)
    return by_point.reshape(-1, 3), (xy - pinhole(example.F_MM, x_c)).ravel()


def intersected(T_m_c: Pose, xy: Array) -> tuple[Array, Fit]:
    """Return the least-squares intersection of rays, m, and the last step of its adjustment.

    Parameters
    ----------
    T_m_c, xy
        As in `linearised`; two images or more.
    """
    x_m = np.zeros(3)
    for _ in range(STEPS):
        step = fit(*linearised(T_m_c, xy, x_m), example.SIGMA_IMAGE_MM)
        x_m = x_m + step.dx
    return x_m, step


# --- Least squares of a small linear system with its statistics, as chapters 5 and 6 derive it


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """A linear system A dx = dl, adjusted.

    Attributes
    ----------
    dx : ndarray, shape (n,)
        Unknowns.
    cov : ndarray, shape (n, n)
        Their covariance, from the standard deviations a priori.
    v : ndarray, shape (m,)
        Residuals A dx - dl.
    sigma : ndarray, shape (m,)
        Of the observations.
    redundancy : ndarray, shape (m,)
        Share of an error of each observation that shows in its own residual.
    """

    dx: Array
    cov: Array
    v: Array
    sigma: Array
    redundancy: Array

    @property
    def degrees(self) -> int:
        """Degrees of freedom."""
        return len(self.v) - len(self.dx)

    @property
    def square(self) -> float:
        """Weighted sum of squared residuals."""
        return float(np.sum((self.v / self.sigma) ** 2))

    @property
    def w(self) -> Array:
        """Residuals over their own standard deviations, shape (m,)."""
        return self.v / (self.sigma * np.sqrt(self.redundancy))


def fit(A: Array, dl: Array, sigma: Array | float) -> Fit:
    """Adjust a linear system of uncorrelated observations.

    Parameters
    ----------
    A : ndarray, shape (m, n)
        Of full rank.
    dl : ndarray, shape (m,)
        Observed minus computed.
    sigma : float or ndarray, shape (m,)
        Standard deviations, in the units of `dl`.
    """
    sigma = np.broadcast_to(np.asarray(sigma, dtype=float), dl.shape)
    weighted = A / sigma[:, None]
    cov = np.linalg.inv(weighted.T @ weighted)
    dx = cov @ weighted.T @ (dl / sigma)
    explained = np.einsum("mi,ij,mj->m", weighted, cov, weighted)
    return Fit(dx=dx, cov=cov, v=A @ dx - dl, sigma=sigma, redundancy=1 - explained)


# --- How many multiplications normal equations cost, with and without eliminating the points
#
# Divisions count as multiplications; square roots and additions are not counted.


PER_POSE, PER_POINT = 6, 3


def banded_cholesky(n: int, width: int) -> int:
    """Return the multiplications that factor a symmetric matrix of n rows.

    Parameters
    ----------
    n : int
    width : int
        Its entries lie at most so many places off the diagonal.
    """
    width = min(width, n - 1)
    # the last rows of the band are those of a full matrix
    return (n - width) * width * (width + 3) // 2 + _cholesky(width)


def _cholesky(n: int) -> int:
    """Return the multiplications that factor a full symmetric matrix of n rows."""
    return n * (n - 1) * (n + 4) // 6


def whole(n_images: int, n_points: int, *, n_shared: int) -> int:
    """Return the multiplications that factor the whole normal matrix, its zeros not spared.

    Parameters
    ----------
    n_images, n_points : int
    n_shared : int
        Unknowns of the camera and its mounting, which all images share.
    """
    return _cholesky(n_shared + PER_POSE * n_images + PER_POINT * n_points)


def elimination(n_points: int, rays: float, *, n_shared: int) -> int:
    """Return the multiplications that eliminate points: V = L L^T, Z = L^-1 W^T, and Z^T Z.

    Parameters
    ----------
    n_points : int
    rays : float
        Mean number of images of a point.
    n_shared : int
        As in `whole`.
    """
    columns = n_shared + PER_POSE * rays
    of_point = _cholesky(PER_POINT) + 6 * columns + 3 * columns * (columns + 1) / 2
    return round(n_points * of_point)


def reduced(n_images: int, n_points: int, rays: float, *, n_shared: int) -> int:
    """Return the multiplications that eliminate the points and factor the reduced matrix.

    Parameters
    ----------
    n_images, n_points, rays, n_shared
        As in `whole` and `elimination`.
    """
    by_points = elimination(n_points, rays, n_shared=n_shared)
    return by_points + _cholesky(n_shared + PER_POSE * n_images)
