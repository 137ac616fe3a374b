"""What single images of known points tell about their camera: f and the principal point.

The example's camera is held over ground that is flat or has hills. Every image has a pose of its
own; whatever a change of pose can imitate says nothing about the camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4book.foundations import example
from acx4lib.expected import Array
from acx4lib.geometry.camera import colrow_from_xy
from acx4lib.geometry.collinearity import Measurement, image_derivatives
from acx4lib.geometry.frames import Pose, rotation_from_opk

HEIGHT_M = 480.0
"""Of the camera over the ground."""

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
        """What is left of `by_camera` where the pose moves to hide it, shape (2 n, 3)."""
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
    seen = Measurement(
        cameras=(camera,),
        camera_idx=np.zeros(n, dtype=np.intp),
        T_m_c=T,
        colrow=colrow_from_xy(camera, xy),
    )
    _, *derivatives = image_derivatives(seen, ray * (depth / ray[:, 2])[:, None])
    to_mm = 1 / seen.px_per_mm[:, :, None]
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
