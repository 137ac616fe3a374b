"""Uses of the bundle, and its unknowns."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation, with_held_poses
from acx4lib.bundle.observations import PoseObservations
from acx4lib.bundle.unknowns import holding, layout
from acx4lib.errors import AdjustmentError
from acx4lib.flight.block import NO_POINTS
from acx4lib.geometry.frames import Pose, log
from acx4lib.results import rows
from support import blocks

# --- poses that are held: the limit of an observation whose sigma goes to zero ---------------


HELD = [0, 4, 5, 9]
FREE = ("f", "xp", "yp", "k1")


def cameras_of(block):
    """Return the true poses of the cameras."""
    (camera,) = block.cameras
    return block.T_m_b_images @ Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None])


def held(net, T_m_c):
    names = [net.pose_names[i] for i in HELD]
    return adjust(with_held_poses(net, names, T_m_c[np.array(HELD)]))


@pytest.fixture(scope="module")
def pair(noisy_block):
    """Return an adjustment with four held poses, and one in which they have tiny sigma."""
    T_m_c = cameras_of(blocks.standard())
    sigma = np.full((len(T_m_c), 3), np.inf)
    tiny = sigma.copy()
    tiny[HELD] = 1e-7
    observed = PoseObservations(
        T_m_b=T_m_c,
        R_g_m=noisy_block.trajectory.R_g_m,
        sigma_position=tiny,
        sigma_attitude=tiny / 1000,
    )
    net = free_orientation(noisy_block, free=FREE, positions=observed)
    return held(free_orientation(noisy_block, free=FREE), T_m_c), adjust(net)


def test_a_held_pose_is_the_limit_of_an_observation_without_error(pair):
    fit, limit = pair
    assert fit.solution.redundancy == limit.solution.redundancy
    assert fit.solution.cost == pytest.approx(limit.solution.cost, rel=1e-6)
    left = [i for i in range(len(fit.state.T_m_b)) if i not in HELD]
    assert_allclose(fit.state.T_m_b.r[left], limit.state.T_m_b.r[left], atol=1e-5)
    for a, b in zip(fit.cameras, limit.cameras, strict=True):
        assert_allclose(a.interior.to_array(), b.interior.to_array(), atol=1e-7)
    of_interior = limit.network.layout.interior[0]
    of_interior = of_interior[of_interior >= 0]
    block = np.ix_(of_interior, of_interior)
    assert_allclose(fit.solution.cov[block], limit.solution.cov[block], rtol=1e-4)
    assert_allclose(fit.solution.cov_points, limit.solution.cov_points, rtol=1e-3, atol=1e-9)


def test_a_held_pose_stays_exactly_and_has_no_sigma(pair, noisy_block):
    fit, _ = pair
    T_m_c = cameras_of(blocks.standard())
    assert np.array_equal(fit.T_m_c.r[HELD], T_m_c.r[HELD])
    assert np.array_equal(fit.T_m_c.R[HELD], T_m_c.R[HELD])
    assert not fit.camera_pose_covariances[HELD].any()
    assert fit.oriented.all()
    owners = {name.partition("/")[0] for name in fit.network.column_names()}
    assert not owners & {noisy_block.images.names[i] for i in HELD}
    table = rows.exterior_orientations(fit)
    sigma = table[[c for c in table if c.startswith("sigma")]].to_numpy()
    assert not sigma[HELD].any()
    assert (np.delete(sigma, HELD, axis=0) > 0).all()


def test_two_held_bodies_are_the_datum_of_all(exact_block, rng):
    """Nothing else is observed but image points; the other bodies begin metres off."""
    T, sigma = exact_block.trajectory.T_m_b, np.full((len(exact_block.trajectory), 3), np.inf)
    off = Pose(R=T.R, r=T.r + rng.normal(0, 3.0, T.r.shape))
    trajectory = replace(
        exact_block.trajectory, T_m_b=off, sigma_position=sigma, sigma_attitude=sigma
    )
    alone = replace(exact_block, trajectory=trajectory, control=exact_block.control[:0])
    net = mounted_orientation(alone, free=(), free_mount=())
    fit = adjust(with_held_poses(net, ["0", "1"], T[:2]))
    assert_allclose(fit.state.T_m_b.r, T.r, atol=1e-6)
    assert np.abs(log(np.swapaxes(fit.state.T_m_b.R, 1, 2) @ T.R)).max() < 1e-9


@pytest.mark.parametrize(
    ("names", "n", "says"),
    [(["0", "nowhere"], 2, "nowhere"), (["0", "0"], 2, "different"), (["0"], 2, "1 poses")],
)
def test_poses_that_cannot_be_held_are_named(exact_block, names, n, says):
    net = mounted_orientation(exact_block, free=FREE)
    with pytest.raises(ValueError, match=says):
        with_held_poses(net, names, exact_block.trajectory.T_m_b[:n])


def test_a_block_without_a_trajectory_begins_with_resections():
    block = blocks.noisy(blocks.standard(check=None), np.random.default_rng(3))
    alone = replace(block, trajectory=None)
    assert alone.trajectory.exposures == block.images.names
    fit, same = (adjust(free_orientation(one, free=("f",))) for one in (alone, block))
    assert_allclose(fit.cameras[0].interior.f, same.cameras[0].interior.f, atol=1e-8)
    with pytest.raises(AdjustmentError, match="has no image with"):
        free_orientation(replace(alone, control=NO_POINTS), free=("f",))


def test_held_images_keep_the_poses_of_the_trajectory():
    block = blocks.standard(check=None)
    names = block.images.names[:2]
    network = free_orientation(replace(block, control=NO_POINTS), free=("f",), held=names)
    fit = adjust(network)
    T = cameras_of(block)
    assert_allclose(fit.T_m_c.r[:2], T.r[:2], atol=0)
    assert_allclose(fit.T_m_c.r, T.r, atol=1e-5)  # exact measurements
    with pytest.raises(ValueError, match="held"):
        free_orientation(block, free=("f",), held=("nobody",))


def test_no_point_is_left_out_at_an_angle_of_zero():
    block = blocks.standard(check=None)
    counts = [
        free_orientation(block, free=("f",), smallest_angle=angle).left_out
        for angle in (0.0, np.radians(60.0))
    ]
    assert counts[0] == {}
    assert "whose rays meet at less than 60 degrees" in counts[1]


# --- the columns of the unknowns, and what is left of them when some are held ----------------


def test_held_columns_leave_no_gap():
    columns = layout(2, 3, free=("f", "k1"), free_mount=("lever_x",), free_shift=("east",))
    assert columns.n_columns == 2 * 3 + 1 + 18
    left = holding(columns, columns.interior[1, [0, 3]])
    assert left.n_columns == columns.n_columns - 2
    assert left.interior[0, [0, 3]].tolist() == [0, 1]
    assert np.all(left.interior[1] == -1)
    assert left.mount[:, 0].tolist() == [2, 3]
    assert np.all(left.mount[:, 1:] == -1)
    assert left.shift.tolist() == [4, -1, -1]
    assert left.pose.ravel().tolist() == list(range(5, 23))
    assert left.drift.shape == (0, 3)
