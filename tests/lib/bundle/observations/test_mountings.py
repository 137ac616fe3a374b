"""Declared mountings as observations."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.bundle.observations.mountings import mounting_equations
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.prior import Prior
from support import blocks
from support.helpers import numeric_jacobian


def test_declared_mountings_are_observed_where_they_have_sigma_and_are_estimated():
    sigma = (0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3)
    camera = replace(blocks.CAMERA, prior=Prior(declared=(True,) * 6, sigma=sigma))
    columns = np.arange(12).reshape(2, 6)
    cameras = (blocks.CAMERA, camera)
    found = list(mounting_equations(cameras, mountings(cameras), columns))
    assert [(e.kind, e.columns.tolist()) for e in found] == [
        ("lever_arm", [[6, 7, 8]]),
        ("boresight", [[9, 10, 11]]),
    ]
    held = np.where(columns < 9, columns, -1)
    assert [e.kind for e in mounting_equations(cameras, mountings(cameras), held)] == ["lever_arm"]
    assert list(mounting_equations(cameras[:1], mountings(cameras[:1]), columns[:1])) == []


def test_residuals_of_a_mounting_are_along_and_about_the_bodys_axes(rng):
    """Their derivatives agree with differences, far from the declared mounting, too."""
    sigma = (0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3)
    turned = Pose(R=blocks.CAMERA.T_b_c.R @ exp(np.array([0.0, 0.0, 1.4])), r=np.zeros(3))
    camera = replace(blocks.CAMERA, T_b_c=turned, prior=Prior(declared=(True,) * 6, sigma=sigma))
    about_body = np.radians([0.4, -0.3, 2.0])
    R, off = exp(about_body) @ turned.R, np.array([0.1, -0.2, 0.3])

    def v(step):
        T = Pose(R=(R @ exp(step[3:]))[None], r=(off + step[:3])[None])
        lever, boresight = mounting_equations((camera,), T, np.arange(6)[None])
        return np.concatenate([lever.v[0], boresight.v[0]]), (lever, boresight)

    value, (lever, boresight) = v(np.zeros(6))
    assert_allclose(value, np.concatenate([off, about_body]), atol=1e-12)
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = lever.A[0], boresight.A[0]
    assert_allclose(numeric_jacobian(lambda x: v(x)[0], np.zeros(6)), J, atol=1e-7)
