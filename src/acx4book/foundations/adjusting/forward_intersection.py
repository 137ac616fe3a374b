"""A point of the example from its images: the rays are intersected by least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4book.foundations import example
from acx4book.foundations.adjusting.fitted import Fit, fit
from acx4lib.expected import Array
from acx4lib.geometry.collinearity import pinhole, pinhole_jacobian, to_camera
from acx4lib.geometry.frames import Pose, rotation_from_opk

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
    """Return the point where rays meet best, m, and the last step of its adjustment.

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
