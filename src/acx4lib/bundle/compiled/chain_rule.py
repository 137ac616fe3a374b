"""Normal equations carried from camera poses to body poses and mountings, eq. (14), and back.

Besides points, a bundle has two kinds of unknowns: the *border* (interior orientations and
mountings), which may affect every image, and *poses*, each connected with its neighbours only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.bundle.compiled.elimination import CameraCovariances, CameraNormals
from acx4lib.bundle.compiled.packing import pose_band
from acx4lib.bundle.compiled.rays import INTERIOR, POINT
from acx4lib.bundle.compiled.small_products import aligned
from acx4lib.compiling import load, uncounted
from acx4lib.expected import Array, Index
from acx4lib.least_squares.reduced_system import Bordered, BorderedCovariance

N_INTERIOR, N_POSE = POINT - INTERIOR, 6
PER_CAMERA = N_INTERIOR + N_POSE
"""Border columns of a camera, free or held: interior orientation, then mounting."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Hanging:
    """How camera poses depend on poses and mountings, eq. (14).

    Attributes
    ----------
    by_pose, by_mount : ndarray, shape (n_images, 6, 6)
        d(camera pose) / d(pose) and d(mounting); a camera pose varies along its own axes.
    pose : ndarray, shape (n_images,)
        The pose of each image, in ascending order.
    camera : ndarray, shape (n_images,)
    n_poses, n_cameras : int
    """

    by_pose: Array
    by_mount: Array
    pose: Index
    camera: Index
    n_poses: int
    n_cameras: int


def reduced_normals(
    normals: CameraNormals, hanging: Hanging, pair: Index, room: Array | None = None
) -> Bordered:
    """Return the normal equations of border and poses.

    The border has `PER_CAMERA` columns for each camera.

    Parameters
    ----------
    normals : CameraNormals
    hanging : Hanging
    pair : ndarray, shape (n_images, band)
        As in `SortedRays`.
    room : ndarray, optional
        Where `Bordered.P` is built, if it has that shape.
    """
    M, S, E, I, g, _ = normals  # noqa: E741
    A, B, pose, camera = hanging.by_pose, hanging.by_mount, hanging.pose, hanging.camera
    n_images, n_cameras, n_poses = len(pose), hanging.n_cameras, hanging.n_poses
    each = np.arange(n_images)
    before = np.triu(M) + np.swapaxes(np.triu(M, 1), 1, 2)
    by_interior = E[:, :, :, INTERIOR:POINT].copy()
    by_interior[each, camera] += before[:, :N_POSE, INTERIOR:POINT]
    gradient = g[:, :N_POSE]
    shape = (n_poses * N_POSE, pose_band(pose, pair.shape[1]) * N_POSE)
    P = np.empty(shape) if room is None or room.shape != shape else room
    P[:] = 0.0
    Z = np.zeros((n_images, n_cameras, N_POSE, N_POSE))
    own = np.ascontiguousarray(before[:, :N_POSE, :N_POSE])
    _pairs(pair, S, own, A, B, pose, camera, P, Z, np.empty((3, 6, 6)))

    interior = np.zeros((n_cameras, n_images, N_INTERIOR, N_POSE))
    interior[:] = np.transpose(by_interior, (1, 0, 3, 2))
    to_pose = np.zeros((n_cameras, PER_CAMERA, n_poses, N_POSE))
    by_image = np.concatenate(
        [interior @ A, np.transpose(np.swapaxes(A, 1, 2)[:, None] @ Z, (1, 0, 3, 2))], axis=2
    )
    np.add.at(np.moveaxis(to_pose, 2, 0), pose, np.moveaxis(by_image, 1, 0))
    corner = np.zeros((n_cameras, PER_CAMERA, n_cameras, PER_CAMERA))
    _corner(corner, before, I, hanging, (interior @ B, np.swapaxes(B, 1, 2)[:, None] @ Z))
    g_border = np.zeros((n_cameras, PER_CAMERA))
    diagonal_border = np.zeros((n_cameras, PER_CAMERA))
    np.add.at(g_border[:, :N_INTERIOR], camera, g[:, INTERIOR:POINT])
    np.add.at(g_border[:, N_INTERIOR:], camera, np.einsum("iab,ia->ib", B, gradient))
    squares = np.diagonal(before, axis1=1, axis2=2)[:, INTERIOR:POINT]
    np.add.at(diagonal_border[:, :N_INTERIOR], camera, squares)
    np.add.at(diagonal_border[:, N_INTERIOR:], camera, _squares(own, B))
    g_pose, diagonal_pose = np.zeros((n_poses, N_POSE)), np.zeros((n_poses, N_POSE))
    np.add.at(g_pose, pose, np.einsum("iab,ia->ib", A, gradient))
    np.add.at(diagonal_pose, pose, _squares(own, A))
    n_border = n_cameras * PER_CAMERA
    return Bordered(
        P=P,
        C=to_pose.reshape(n_border, -1),
        D=corner.reshape(n_border, n_border),
        g=np.concatenate([g_border.ravel(), g_pose.ravel()]),
        diagonal=np.concatenate([diagonal_border.ravel(), diagonal_pose.ravel()]),
    )


def _squares(U: Array, J: Array) -> Array:
    """Return the diagonals of J^T U J."""
    return np.sum(J * (U @ J), axis=1)


def _corner(
    corner: Array,
    before: Array,
    eliminated: Array,
    hanging: Hanging,
    products: tuple[Array, Array],
) -> None:
    """Fill the normal equations of the border with itself."""
    camera, n_cameras = hanging.camera, hanging.n_cameras
    interior_by_mount, mount_by_mount = products
    a, b = slice(0, N_INTERIOR), slice(N_INTERIOR, PER_CAMERA)
    own = before[:, INTERIOR:POINT, INTERIOR:POINT]
    for k in range(n_cameras):
        mine = camera == k
        corner[k, a, k, a] = own[mine].sum(axis=0)
        # interior orientations of all cameras with the mounting of camera k
        corner[:, a, k, b] = interior_by_mount[:, mine].sum(axis=1)
        for j in range(n_cameras):
            corner[k, a, j, a] += eliminated[k, j, INTERIOR:POINT, INTERIOR:POINT]
            corner[k, b, j, b] = mount_by_mount[mine, j].sum(axis=0)
    for k in range(n_cameras):
        for j in range(n_cameras):
            corner[k, b, j, a] = corner[j, a, k, b].T


@uncounted
def _pairs(
    pair: Index,
    S: Array,
    own: Array,
    A: Array,
    B: Array,
    pose: Index,
    camera: Index,
    P: Array,
    Z: Array,
    room: Array,
) -> None:
    """Add all pairs of images to pairs of poses, P, and to pairs with mountings, Z."""
    n_images, band = pair.shape
    N, NA, NB = room[0], room[1], room[2]
    for i in range(n_images):
        for j in range(i, min(i + band, n_images)):
            if pair[i, j - i] < 0:
                continue
            for a in range(6):
                for b in range(6):
                    N[a, b] = S[pair[i, j - i], a, b]
            if i == j:
                _add(N, own[i])
            _product(N, A[j], NA)
            _product(N, B[j], NB)
            _add(Z[i, camera[j]], NB)
            _add_congruent(P, 6 * pose[i], 6 * pose[j], A[i], NA)
            if i != j and pose[i] == pose[j]:
                _add_congruent(P, 6 * pose[i], 6 * pose[j], NA, A[i])
            if i != j:
                _add_transposed_product(N, B[i], Z[j, camera[i]])


@uncounted
def _add(total: Array, more: Array) -> None:
    for a in range(6):
        for b in range(6):
            total[a, b] += more[a, b]


@uncounted
def _product(left: Array, right: Array, out: Array) -> None:
    for a in range(6):
        for b in range(6):
            total = 0.0
            for c in range(6):
                total += left[a, c] * right[c, b]
            out[a, b] = total


@uncounted
def _add_transposed_product(left: Array, right: Array, out: Array) -> None:
    """Add left^T right."""
    for a in range(6):
        for b in range(6):
            total = 0.0
            for c in range(6):
                total += left[c, a] * right[c, b]
            out[a, b] += total


@uncounted
def _add_congruent(P: Array, row: int, column: int, left: Array, right: Array) -> None:
    """Add left^T right to `Bordered.P`, from its diagonal on."""
    for a in range(6):
        for b in range(max(a + row - column, 0), 6):
            total = 0.0
            for c in range(6):
                total += left[c, a] * right[c, b]
            P[row + a, column + b - row - a] += total


# --- and back --------------------------------------------------------------------------------


def camera_steps(hanging: Hanging, border: Array, poses: Array) -> Array:
    """Return the steps of each image's camera pose and interior orientation.

    Parameters
    ----------
    hanging : Hanging
    border : ndarray, shape (n_cameras * PER_CAMERA,)
    poses : ndarray, shape (n_poses, 6)

    Returns
    -------
    ndarray, shape (n_images, 16)
    """
    by_camera = border.reshape(hanging.n_cameras, PER_CAMERA)[hanging.camera]
    interior, mount = by_camera[:, :N_INTERIOR], by_camera[:, N_INTERIOR:]
    turned = np.einsum("iab,ib->ia", hanging.by_pose, poses[hanging.pose])
    turned += np.einsum("iab,ib->ia", hanging.by_mount, mount)
    return np.concatenate([turned, interior], axis=1)


def camera_covariances(cov: BorderedCovariance, hanging: Hanging, pair: Index) -> CameraCovariances:
    """Return the covariances of camera poses that share points, and of interior orientations.

    Parameters
    ----------
    cov : BorderedCovariance
        Its border has `PER_CAMERA` columns for each camera, zero where one is held.
    hanging : Hanging
    pair : ndarray, shape (n_images, band)
        As in `SortedRays`.
    """
    A, B, pose, camera = hanging.by_pose, hanging.by_mount, hanging.pose, hanging.camera
    n_cameras, n_images = hanging.n_cameras, len(pose)
    corner = cov.D.reshape(n_cameras, PER_CAMERA, n_cameras, PER_CAMERA)
    to_pose = cov.C.reshape(n_cameras, PER_CAMERA, hanging.n_poses, N_POSE)
    # covariance of each camera pose with every column of the border
    U = np.einsum("iab,lmib->ilam", A, to_pose[:, :, pose], optimize=True)
    U_pose = np.ascontiguousarray(U[..., N_INTERIOR:])
    mount_rows = corner[camera][:, N_INTERIOR:]
    U = U + np.einsum("iab,iblm->ilam", B, mount_rows, optimize=True)
    Q = aligned(pair.max() + 1, 2, 6, 8)
    by_mount = np.ascontiguousarray(U[..., N_INTERIOR:])
    _camera_pairs(pair, cov.P, A, B, U_pose, by_mount, pose, camera, Q, np.empty((6, 6)))
    F = aligned(n_images, n_cameras, 6, 16)
    F[..., INTERIOR:POINT] = U[..., :N_INTERIOR]
    F_T = aligned(n_images, n_cameras, N_INTERIOR, 8)
    F_T[..., :6] = np.swapaxes(U[..., :N_INTERIOR], 2, 3)
    H = aligned(n_cameras, n_cameras, N_INTERIOR, 16)
    inner = np.transpose(corner[:, :N_INTERIOR, :, :N_INTERIOR], (0, 2, 1, 3))
    H[..., INTERIOR:POINT] = inner
    each = np.arange(n_images)
    K = aligned(n_images, 16, 16)
    K[:, :6, :6] = Q[pair[:, 0], 0, :, :6]
    K[:, :6, INTERIOR:POINT] = U[each, camera][..., :N_INTERIOR]
    K[:, INTERIOR:POINT, :6] = np.swapaxes(K[:, :6, INTERIOR:POINT], 1, 2)
    K[:, INTERIOR:POINT, INTERIOR:POINT] = inner[camera, camera]
    return CameraCovariances(Q=Q, F=F, F_T=F_T, H=H, K=K)


@uncounted
def _camera_pairs(
    pair: Index,
    P: Array,
    A: Array,
    B: Array,
    U_pose: Array,
    U: Array,
    pose: Index,
    camera: Index,
    Q: Array,
    PA: Array,
) -> None:
    """Fill in the covariances of all pairs of images, and their transposes."""
    n_images, band = pair.shape
    for i in range(n_images):
        for j in range(i, min(i + band, n_images)):
            at = pair[i, j - i]
            if at < 0:
                continue
            block = P[pose[i], pose[j] - pose[i]]
            for a in range(6):  # block @ A_j^T
                for b in range(6):
                    total = 0.0
                    for c in range(6):
                        total += block[a, c] * A[j, b, c]
                    PA[a, b] = total
            for a in range(6):
                for b in range(6):
                    total = 0.0
                    for c in range(6):
                        total += A[i, a, c] * PA[c, b]
                        total += U[i, camera[j], a, c] * B[j, b, c]
                        total += B[i, a, c] * U_pose[j, camera[i], b, c]
                    Q[at, 0, a, b] = total
                    Q[at, 1, b, a] = total
                    if i == j:  # symmetric to the last bit
                        Q[at, 0, b, a] = Q[at, 1, a, b] = total


load(_pairs, _camera_pairs)
