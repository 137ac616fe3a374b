"""Rotations and poses: the paper's eq. (6) as printed, scipy's rotations, and their algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4lib.geometry import frames
from acx4lib.geometry.frames import Pose
from support.helpers import numeric_jacobian, rotation_angle
from support.strategies import directions, opk, poses, vectors

ROUNDING = 1e-14  # a few products of numbers of size one in double precision


def printed_m(omega, phi, kappa):
    """Eq. (6), element by element as the paper prints it."""
    so, co, sp, cp = np.sin(omega), np.cos(omega), np.sin(phi), np.cos(phi)
    sk, ck = np.sin(kappa), np.cos(kappa)
    return np.array(
        [
            [cp * ck, co * sk + so * sp * ck, so * sk - co * sp * ck],
            [-cp * sk, co * ck - so * sp * sk, so * ck + co * sp * sk],
            [sp, -so * cp, co * cp],
        ]
    )


# --- printed and other people's numbers ------------------------------------------------------


@given(angles=opk())
def test_rotation_is_the_transpose_of_the_printed_m(angles):
    assert_allclose(frames.rotation_from_opk(angles), printed_m(*angles).T, atol=ROUNDING)


@given(angles=opk())
def test_omega_phi_kappa_are_intrinsic_turns_about_x_y_z(angles):
    expected = Rotation.from_euler("XYZ", angles).as_matrix()
    assert_allclose(frames.rotation_from_opk(angles), expected, atol=ROUNDING)


@given(angles=vectors(3.0))
def test_heading_pitch_roll_are_intrinsic_turns_about_z_y_x(angles):
    expected = Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
    assert_allclose(frames.rotation_from_rph(angles), expected, atol=ROUNDING)


def test_roll_lowers_the_right_wing_pitch_raises_the_nose_heading_turns_east():
    right, nose = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
    assert (frames.rotation_from_rph(np.array([0.1, 0.0, 0.0])) @ right)[2] > 0  # down
    assert (frames.rotation_from_rph(np.array([0.0, 0.1, 0.0])) @ nose)[2] < 0  # up
    assert (frames.rotation_from_rph(np.array([0.0, 0.0, 0.1])) @ nose)[1] > 0  # east


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_elementary_turns_turn_vectors_right_handed(axis):
    angles = np.array([-2.0, 0.0, 0.3])
    expected = Rotation.from_rotvec(np.outer(angles, np.eye(3)[axis])).as_matrix()
    assert_allclose(frames.turn(axis, angles), expected, atol=ROUNDING)


@given(delta=vectors(1.8))
def test_exp_and_log_are_scipys_rotation_vectors(delta):
    expected = Rotation.from_rotvec(delta)
    assert_allclose(frames.exp(delta), expected.as_matrix(), atol=ROUNDING)
    # within a milliradian of a half turn the sine has lost three digits
    if np.linalg.norm(delta) < np.pi - 1e-3:
        assert_allclose(frames.log(expected.as_matrix()), delta, atol=1e-12)


@given(a=vectors(10.0), b=vectors(10.0))
def test_skew_is_the_cross_product(a, b):
    assert_allclose(frames.skew(a) @ b, np.cross(a, b), atol=1e-13)


# --- inverse pairs and chains ----------------------------------------------------------------


@given(angles=opk())
def test_angles_come_back_from_their_rotation(angles):
    assert_allclose(
        frames.opk_from_rotation(frames.rotation_from_opk(angles)), angles, atol=1e-14 * 180
    )


@pytest.mark.parametrize("phi", [np.pi / 2 - 1e-7, -np.pi / 2 + 1e-7])
def test_phi_is_exact_near_a_quarter_turn(phi):
    """There the arc sine would lose half of the digits: 1e-8 instead of 1e-15."""
    R = frames.rotation_from_opk(np.array([0.3, phi, -0.4]))
    assert frames.opk_from_rotation(R)[1] == pytest.approx(phi, abs=1e-15)


@given(scale=st.sampled_from([0.0, 1e-12, 1e-6, 1e-3, 1.0, 3.1]), direction=directions())
def test_log_is_the_inverse_of_exp_at_every_size(scale, direction):
    delta = scale * direction
    # relative to the vector, not to its parts: small ones must not drown in the rounding of the
    # identity, and 3.1 is so near a half turn that rounding counts twenty-fold
    assert_allclose(frames.log(frames.exp(delta)), delta, rtol=0, atol=1e-13 * scale + 1e-28)


@given(T_a_b=poses(), T_b_c=poses(), x_c=vectors(2000.0))
def test_poses_chain_as_their_letters_touch(T_a_b, T_b_c, x_c):
    x_b = T_b_c.R @ x_c + T_b_c.r
    x_a = frames.transform(T_a_b.R, x_b) + T_a_b.r
    T_a_c = T_a_b @ T_b_c
    assert_allclose(frames.transform(T_a_c.R, x_c[None]) + T_a_c.r, x_a, atol=1e-11)  # m, of 1e4


@given(T=poses())
def test_a_pose_times_its_inverse_is_nothing(T):
    for identity in (T @ T.inverse, T.inverse @ T):
        assert_allclose(identity.R[0], np.eye(3), atol=ROUNDING)
        assert_allclose(identity.r[0], 0.0, atol=1e-11)  # m, of 1e4


@given(T=poses())
def test_a_pose_knows_its_angles(T):
    assert_allclose(frames.rotation_from_opk(T.opk), T.R, atol=ROUNDING)


def test_poses_are_counted_and_selected_along_the_first_axis():
    T = Pose(R=np.tile(np.eye(3), (4, 1, 1)), r=np.arange(12.0).reshape(4, 3))
    assert len(T) == 4
    assert_allclose(T[np.array([3, 1])].r, [[9, 10, 11], [3, 4, 5]])
    assert len(T[:0]) == 0


def test_functions_work_over_leading_axes(rng):
    angles = rng.uniform(-1, 1, (2, 5, 3))
    R = frames.rotation_from_opk(angles)
    assert R.shape == (2, 5, 3, 3)
    assert_allclose(R[1, 3], frames.rotation_from_opk(angles[1, 3]), atol=0)
    assert_allclose(frames.exp(angles)[1, 3], frames.exp(angles[1, 3]), atol=ROUNDING)
    assert frames.opk_jacobian(angles).shape == (2, 5, 3, 3)
    assert_allclose(
        frames.log_jacobian(angles)[1, 3], frames.log_jacobian(angles[1, 3]), atol=ROUNDING
    )
    assert_allclose(frames.log(R)[0, 2], frames.log(R[0, 2]), atol=ROUNDING)
    assert frames.log(R[:0]).shape == (0, 5, 3)


def test_transform_takes_matrices_that_are_not_square(rng):
    R, x = rng.normal(size=(4, 2, 3)), rng.normal(size=(4, 3))
    assert_allclose(frames.transform(R, x), (R @ x[:, :, None])[..., 0], atol=ROUNDING)


# --- nearest rotation ------------------------------------------------------------------------


# --- Jacobians -------------------------------------------------------------------------------

STEP = 1e-5  # rad: truncation 1e-10, rounding 1e-11
ALIKE = 1e-8


@given(angles=opk(75.0))
def test_opk_jacobian(angles):
    """The Jacobian agrees with the value; says nothing of the value itself."""
    R = frames.rotation_from_opk(angles)

    def change(delta):
        difference = frames.opk_from_rotation(R @ frames.exp(delta)) - angles
        return np.arctan2(np.sin(difference), np.cos(difference))  # across the date line

    numeric = numeric_jacobian(change, np.zeros(3), step=STEP)
    # near 75 degrees the third derivative has grown by 1 / cos(phi)^3, about 60
    assert_allclose(frames.opk_jacobian(angles), numeric, atol=60 * ALIKE)


@given(scale=st.sampled_from([0.0, 1e-9, 1e-5, 1e-4, 2e-4, 0.01, 1.0, 3.0]), direction=directions())
def test_log_jacobian(scale, direction):
    delta = scale * direction
    R = frames.exp(delta)
    numeric = numeric_jacobian(lambda eps: frames.log(R @ frames.exp(eps)), np.zeros(3), step=STEP)
    # towards the half turn the derivatives grow
    assert_allclose(frames.log_jacobian(delta), numeric, atol=ALIKE * (100 if scale > 2 else 1))


def test_the_helper_measures_the_angle_between_rotations():
    R = frames.exp(np.array([0.0, 3e-9, 4e-9]))
    assert rotation_angle(R) == pytest.approx(5e-9, rel=1e-6)  # rounding of the identity: 1e-16


def test_roll_pitch_and_heading_come_back():
    rph = np.array([[0.1, -0.2, 3.0], [-3.0, 1.5, -3.1], [0.0, 0.0, 0.0]])
    assert_allclose(frames.rph_from_rotation(frames.rotation_from_rph(rph)), rph, atol=1e-12)
