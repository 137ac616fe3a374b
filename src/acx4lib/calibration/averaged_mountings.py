"""The second of two steps: mountings of single images, averaged, eqs (12) and (13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.observations.shared_errors import shared_errors
from acx4lib.bundle.unknowns import Layout, layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Mask
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, mean_rotation, skew
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM
from acx4lib.least_squares.covariance import propagate


def averaged(
    bundle: Bundle, *, free: Sequence[str], estimated: Sequence[str]
) -> tuple[Calibration, Pose, Mask]:
    """Average the mountings of all images, camera by camera, and propagate their covariance.

    Images have the weights that they have by themselves; the covariance of the mean holds for
    errors of the trajectory that change slowly, too.

    Parameters
    ----------
    bundle : Bundle
        An adjustment with free exterior orientations.
    free, estimated : sequence of str
        Interior parameters that the bundle estimated, and parts of the mounting to estimate.

    Returns
    -------
    calibration : Calibration
    per_image : Pose
        The mounting T_b_c of every image.
    entering : ndarray, shape (n_images,)
        Which images entered the mean.

    Raises
    ------
    AdjustmentError
        Where a camera has no image that both bundle and trajectory orient.
    """
    block = bundle.network.block
    T_b_c = mountings_per_image(bundle)
    trajectory, exposure = block.trajectory, block.images.exposure_idx
    sigma = np.hstack([trajectory.sigma_position, trajectory.sigma_attitude])
    known: Mask = np.all(np.isfinite(sigma), axis=1)
    entering = bundle.oriented & known[exposure]
    by_camera_pose, by_trajectory = mounting_jacobians(bundle, T_b_c)
    cov_trajectory = trajectory.cov
    per_image = propagate(by_camera_pose, _pose_covariances(bundle))
    per_image += propagate(by_trajectory, cov_trajectory[exposure])
    n_cameras, n_images = len(block.cameras), len(block.images)
    weights = np.zeros((n_cameras, 6, n_images, 6))
    cameras = list(bundle.cameras)
    for k, camera in enumerate(block.cameras):
        idx = np.flatnonzero(entering & (block.images.camera_idx == k))
        if len(idx) == 0:
            msg = f"no image of {camera.name} is oriented and has a trajectory row to compare with"
            raise AdjustmentError(msg)
        mean, weights[k][:, idx] = _weighted_mean(T_b_c[idx], per_image[idx])
        cameras[k] = _with_mounting(bundle.cameras[k], camera, mean, estimated)
    columns = layout(n_cameras, 0, free=free, free_mount=estimated)
    J = _by_bundle(bundle, weights, by_camera_pose, columns)
    K = _by_exposures(block, weights, by_trajectory, columns)
    cov = bundle.solution.inverse.times(J) @ J.T
    cov += np.einsum("iea,eab,jeb->ij", K, cov_trajectory, K)
    if (shared := shared_errors(trajectory)) is not None:
        cov += shared.among(np.moveaxis(K, 1, 0))
    calibration = Calibration(
        cameras=tuple(cameras),
        layout=columns,
        cov=cov,
        sigma0_sq=bundle.solution.sigma0_sq,
        open_columns=np.abs(J) @ bundle.solution.undetermined > 1e-9,
    )
    return calibration, T_b_c, entering


def mountings_per_image(bundle: Bundle) -> Pose:
    """Return T_b_c of every image from trajectory and bundle, eqs (12) and (13)."""
    return bundle.network.block.T_m_b_images.inverse @ bundle.T_m_c


def mounting_jacobians(bundle: Bundle, T_b_c: Pose) -> tuple[Array, Array]:
    """Return the derivatives of (lever arm, boresight) by camera poses and by the trajectory.

    Boresights are rotations about the camera's axes, attitudes about the body's axes.

    Returns
    -------
    by_camera_pose, by_trajectory : ndarray, shape (n_images, 6, 6)
    """
    R_b_m = np.swapaxes(bundle.network.block.T_m_b_images.R, -1, -2)
    by_camera_pose = np.zeros((len(T_b_c), 6, 6))
    by_camera_pose[:, :3, :3] = R_b_m
    by_camera_pose[:, 3:, 3:] = np.eye(3)
    by_trajectory = np.zeros_like(by_camera_pose)
    by_trajectory[:, :3, :3] = -R_b_m
    by_trajectory[:, :3, 3:] = skew(T_b_c.r)
    by_trajectory[:, 3:, 3:] = -np.swapaxes(T_b_c.R, -1, -2)
    return by_camera_pose, by_trajectory


def _pose_covariances(bundle: Bundle) -> Array:
    """Return the covariances of the poses, shape (n_poses, 6, 6)."""
    columns = bundle.network.layout.pose
    return bundle.solution.inverse.at(columns[:, :, None], columns[:, None, :])


def _weighted_mean(T_b_c: Pose, cov: Array) -> tuple[Pose, Array]:
    """Return the mean mounting and the weight matrices of its images, shape (6, n, 6)."""
    weights = np.zeros((6, len(T_b_c), 6))
    for part in (slice(0, 3), slice(3, 6)):
        P = np.linalg.inv(cov[:, part, part])
        weights[part, :, part] = np.moveaxis(np.linalg.inv(P.sum(axis=0)) @ P, 0, 1)
    r = np.einsum("inj,nj->i", weights[:3, :, :3], T_b_c.r)
    return Pose(R=mean_rotation(T_b_c.R, weights[3:, :, 3:]), r=r), weights


def _with_mounting(
    estimated_camera: Camera, declared: Camera, mean: Pose, estimated: Sequence[str]
) -> Camera:
    """Return the camera with the mean mounting, held parts as declared."""
    return replace(
        estimated_camera,
        T_b_c=Pose(
            R=mean.R if BORESIGHT[0] in estimated else declared.T_b_c.R,
            r=mean.r if LEVER_ARM[0] in estimated else declared.T_b_c.r,
        ),
    )


def _by_bundle(bundle: Bundle, weights: Array, by_pose: Array, columns: Layout) -> Array:
    """Return d(interior, mean mounting) / d(columns of the bundle), shape (n, n_columns)."""
    source = bundle.network.layout
    J = np.zeros((columns.n_columns, source.n_columns))
    free = source.interior >= 0
    J[columns.interior[free], source.interior[free]] = 1.0
    for k, mount in enumerate(columns.mount):
        mean = np.einsum("ina,nab->inb", weights[k], by_pose).reshape(6, -1)
        J[np.ix_(mount[mount >= 0], source.pose.ravel())] = mean[mount >= 0]
    return J


def _by_exposures(block: Block, weights: Array, by_trajectory: Array, columns: Layout) -> Array:
    """Return d(mean mounting) / d(body poses), shape (n, n_exposures, 6)."""
    K = np.zeros((columns.n_columns, len(block.trajectory), 6))
    for k, mount in enumerate(columns.mount):
        mean = np.einsum("ina,nab->inb", weights[k], by_trajectory)
        total = np.zeros((len(block.trajectory), 6, 6))
        np.add.at(total, block.images.exposure_idx, np.moveaxis(mean, 1, 0))
        K[mount[mount >= 0]] = np.moveaxis(total, 1, 0)[mount >= 0]
    return K
