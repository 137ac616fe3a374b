"""Derivatives of the mountings of single images."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.uses import free_orientation
from acx4lib.calibration.averaged_mountings import mounting_jacobians, mountings_per_image
from acx4lib.calibration.mounting import two_step
from acx4lib.geometry.frames import Pose, exp, log
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from support import blocks
from support.helpers import numeric_jacobian


def test_mounting_jacobians(exact_block):
    """The Jacobians agree with eqs (12) and (13); say nothing of these themselves."""
    fit = adjust(free_orientation(exact_block, free=("xp",)))
    T_b_c = mountings_per_image(fit)
    by_camera, by_trajectory = mounting_jacobians(fit, T_b_c)
    net = fit.network

    def change(T):
        about = log(np.swapaxes(T_b_c.R, 1, 2) @ T.R)
        return np.concatenate([T.r - T_b_c.r, about], axis=1)

    def with_camera(step):
        """Move every camera pose by the same step; its columns are position and own axes."""
        dx = np.zeros(net.n_columns)
        dx[net.layout.pose] = step
        state = net.moved(fit.state, dx, np.zeros((net.n_points, 3)))
        return change(mountings_per_image(replace(fit, state=state)))

    def with_body(step):
        trajectory = exact_block.trajectory
        T = trajectory.T_m_b
        T = Pose(R=T.R @ exp(step[3:]), r=T.r + step[:3])
        block = replace(exact_block, trajectory=replace(trajectory, T_m_b=T))
        return change(mountings_per_image(replace(fit, network=replace(net, block=block))))

    # positions of 2e3 m: rounding of 1e-12 m over a step of 1e-5 rad is 1e-7 m per rad
    steps = np.array([1e-2] * 3 + [1e-5] * 3)
    assert_allclose(by_camera, numeric_jacobian(with_camera, np.zeros(6), step=steps), atol=1e-6)
    assert_allclose(by_trajectory, numeric_jacobian(with_body, np.zeros(6), step=steps), atol=1e-6)


def test_an_error_of_attitude_that_all_images_share_does_not_average_out():
    """As good as exact images: the boresight has all of it, and an n-th where errors are white."""
    exact = blocks.in_strips(blocks.standard(), 3)
    points = replace(exact.image_points, sigma_px=np.full(len(exact.image_points), 1e-3))
    control = replace(exact.control, sigma_m=np.full_like(exact.control.sigma_m, 1e-5))
    white = replace(exact, image_points=points, control=control)
    constant = GaussMarkov(share=1 - 1e-9, time_constant_s=1e9)
    slow = replace(white, trajectory=replace(white.trajectory, slow_attitudes=constant))
    R_b_c, sigma = blocks.CAMERA.T_b_c.R, white.trajectory.sigma_attitude[0]
    one = R_b_c.T @ np.diag(sigma**2) @ R_b_c
    for block, n in ((white, len(white.trajectory)), (slow, 1)):
        found = two_step(block, free=("xp",)).calibration
        boresight = found.layout.mount[0, 3:]
        assert_allclose(found.cov[np.ix_(boresight, boresight)], one / n, rtol=1e-3, atol=1e-12)
