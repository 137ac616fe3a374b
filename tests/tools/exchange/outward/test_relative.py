"""Heads relative to the first: against a numerical derivative, and as a chain of poses."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.geometry.frames import Pose, exp, log
from acx4tools.exchange.outward.relative import R_C_V, to_first
from support.run_results import estimated

RIG = estimated("LEFT", "RIGHT")


def moved(k, step):
    """Return the rig with one mounting changed: lever arm along body, rotation about camera."""
    cameras = list(RIG.cameras)
    T = cameras[k].T_b_c
    cameras[k] = replace(cameras[k], T_b_c=Pose(R=T.R @ exp(step[3:]), r=T.r + step[:3]))
    return replace(RIG, cameras=tuple(cameras))


def test_points_go_from_head_to_reference_as_through_the_body():
    first, second = RIG.cameras
    x_h = np.array([0.3, -0.2, -5.0])
    x_b = second.T_b_c.R @ x_h + second.T_b_c.r
    x_r = first.T_b_c.R.T @ (x_b - first.T_b_c.r)
    T = to_first(RIG)[1]
    assert_allclose(T.T_r_h.R @ x_h + T.T_r_h.r, x_r, atol=1e-12)
    assert_allclose(T.T_v_r_h.R @ (R_C_V @ x_h) + T.T_v_r_h.r, R_C_V @ x_r, atol=1e-12)


def test_the_covariance_is_that_of_numerical_derivatives():
    at, step = to_first(RIG)[1].T_r_h, 1e-5
    J = np.zeros((6, RIG.n_columns))
    for k in range(2):
        for j, column in enumerate(RIG.layout.mount[k]):
            for sign in (1, -1):
                T = to_first(moved(k, sign * step * np.eye(6)[j]))[1].T_r_h
                change = np.concatenate([T.r - at.r, log(at.R.T @ T.R)])
                J[:, column] += sign * change / (2 * step)
    assert_allclose(to_first(RIG)[1].cov, J @ RIG.cov @ J.T, rtol=1e-6, atol=1e-14)


def test_sigma_of_angles_is_that_of_many_rotations(rng):
    one = to_first(RIG)[1]
    turns = rng.multivariate_normal(np.zeros(3), one.cov[3:, 3:], size=20_000)
    R = one.T_r_h.R @ exp(turns)
    opk = Pose(R=R_C_V @ R @ R_C_V, r=np.zeros((len(R), 3))).opk
    assert_allclose(one.sigma_opk, opk.std(axis=0), rtol=0.03)  # 4 sigma of 20 000 draws
