"""Poses by resection: those with which an exact block was made."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.start.resections import resected
from acx4lib.errors import AdjustmentError
from acx4lib.flight.block import Trajectory
from acx4lib.geometry.frames import Pose, rotation_from_opk
from support import blocks

SECOND = replace(
    blocks.CAMERA,
    name="SIDE",
    T_b_c=Pose(R=rotation_from_opk(np.radians([18.0, 0.0, 90.0])), r=np.array([0.1, 0.3, 0.0])),
)


def without_poses(block):
    n = len(block.trajectory)
    nowhere = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    return replace(
        block, trajectory=Trajectory(exposures=block.trajectory.exposures, T_m_b=nowhere)
    )


@pytest.mark.parametrize("cameras", [(blocks.CAMERA,), (blocks.CAMERA, SECOND)])
def test_body_poses_come_back_from_exact_measurements(cameras):
    exact = blocks.standard(cameras=cameras, control=blocks.terrain(30))
    found = resected(without_poses(exact)).trajectory
    assert_allclose(found.T_m_b.r, exact.trajectory.T_m_b.r, atol=1e-5)  # m; SQPnP stops there
    assert_allclose(found.T_m_b.R, exact.trajectory.T_m_b.R, atol=1e-8)
    assert np.isinf([found.sigma_position, found.sigma_attitude]).all()


def test_an_exposure_without_three_control_points_is_named():
    exact = blocks.standard()
    few = replace(exact, control=exact.control[:2])
    with pytest.raises(AdjustmentError, match=r"^exposure '0' has no image with 3 control points"):
        resected(few)


def test_an_exposure_without_images_is_named():
    exact = blocks.standard()
    more = replace(
        exact, images=replace(exact.images, exposure_idx=np.zeros(len(exact.images), dtype=int))
    )
    with pytest.raises(AdjustmentError, match=r"^exposure '1' has no image"):
        resected(more)
