"""The bundle's equations: what each column moves, what each residual is, and the whole Jacobian."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import adjust
from acx4lib.bundle.unknowns import layout
from acx4lib.geometry.camera import INTERIOR
from acx4lib.geometry.frames import Pose, exp, log, rotation_from_opk, transform
from acx4lib.geometry.parameters import AXES, GNSS, MOUNT, POSE
from acx4lib.model import Model
from support import blocks
from support.helpers import dense_jacobian, numeric_dense_jacobian

SECOND = replace(
    blocks.CAMERA,
    name="SIDE",
    interior=replace(blocks.CAMERA.interior, f=48.0, k2=1e-9, k3=1e-13, b1=2e-4, b2=-3e-4),
    T_b_c=Pose(R=rotation_from_opk(np.radians([12.0, -5.0, 90.0])), r=np.array([0.1, 0.3, 0.2])),
)
STEPS = (
    dict(zip(INTERIOR, (1e-2, 1e-2, 1e-2, 1e-8, 1e-11, 1e-14, 1e-6, 1e-6, 1e-5, 1e-5), strict=True))
    | dict.fromkeys((*MOUNT[:3], *POSE[:3]), 1e-2)
    | dict.fromkeys((*MOUNT[3:], *POSE[3:]), 1e-5)
    | dict.fromkeys((f"{kind}_{axis}" for kind in GNSS[:2] for axis in AXES), 1e-2)
    | {"delay": 1e-3}
)
"""Steps of 1e-3 px and more in the image, where rounding is 1e-9 px, and far below curvature."""


def small(cameras=(blocks.CAMERA,), refraction="none"):
    """Six exposures at two heights, a few points, one of them held, one component taken out."""
    block = blocks.simulate(
        blocks.fly(blocks.BOTH_WAYS[1:3]),
        cameras=cameras,
        control=blocks.crosses(spacing_m=200.0),
        ties=blocks.terrain(6, half_m=150.0),
        refraction=refraction,
    )
    sigma = block.control.sigma_m.copy()
    sigma[0] = 0.0
    sigma[1, 2] = np.inf
    return replace(block, control=replace(block.control, sigma_m=sigma))


def timed(block):
    """The block in two strips of three exposures, with times."""
    block = blocks.in_strips(block, 3)
    time_s = np.array([0.0, 3.0, 7.0, 100.0, 104.0, 107.0])
    return replace(block, trajectory=replace(block.trajectory, time_s=time_s))


def off(net, rng):
    """A state some way from the solution, so that no residual is small."""
    state = adjust.adjust(net).state if net.refraction == "none" else net.start
    steps = np.array([STEPS[name.split("/")[1]] for name in net.column_names()])
    dx = 20 * steps * rng.normal(size=net.n_columns)
    dp = net.free_points[:, None] * rng.normal(0, 1.0, (net.n_points, 3))
    return net.moved(state, dx, dp)


def networks():
    """The uses of the one model, on six exposures."""
    one, rig = small(), small((blocks.CAMERA, SECOND))
    observed = adjust.mounted_orientation(one, Model()).observed
    return {
        "free": adjust.free_orientation(one, Model(free=("xp", "yp", "k1"))),
        "positions": adjust.free_orientation(
            one,
            Model(free=INTERIOR),
            positions=replace(observed, sigma_attitude=np.full((6, 3), np.inf)),
        ),
        "mounted": adjust.mounted_orientation(one, Model(free=("f", "xp", "yp"))),
        "boresight held": adjust.mounted_orientation(one, Model(free=("f",), fix=("boresight",))),
        "mounting held": adjust.mounted_orientation(
            one, Model(free=("k3", "b1"), fix=("lever_arm", "boresight"))
        ),
        "rig": adjust.mounted_orientation(rig, Model(free=INTERIOR)),
        "shift": adjust.mounted_orientation(rig, Model(free=("f",), gnss=("shift",))),
        "drift": adjust.mounted_orientation(
            blocks.in_strips(one, 3), Model(free=("f",), fix=("lever_arm",), gnss=GNSS[:2])
        ),
        "delay": adjust.mounted_orientation(timed(one), Model(free=("f",), gnss=GNSS[2:])),
    }


@pytest.fixture(scope="module", params=sorted(networks()))
def net(request):
    return networks()[request.param]


# --- columns ---------------------------------------------------------------------------------


def described(net, state):
    """Every unknown by its column's name, rotations about their own axes against the start."""
    start, out = net.start, {}
    for k, camera in enumerate(net.block.cameras):
        for name in INTERIOR:
            out[f"{camera.name}/{name}"] = getattr(state.interiors[k], name)
        turned = log(start.T_b_c.R[k].T @ state.T_b_c.R[k])
        for name, value in zip(MOUNT, [*state.T_b_c.r[k], *turned], strict=True):
            out[f"{camera.name}/{name}"] = value
    for i, pose in enumerate(net.pose_names):
        turned = log(start.T_m_b.R[i].T @ state.T_m_b.R[i])
        for name, value in zip(POSE, [*state.T_m_b.r[i], *turned], strict=True):
            out[f"{pose}/{name}"] = value
    for k, axis in enumerate(AXES):
        out[f"GNSS/shift_{axis}"] = state.shift[k]
        for strip, drift in zip(net.observed.strips.names, state.drift, strict=True):
            out[f"strip {strip}/drift_{axis}"] = drift[k]
    (out["GNSS/delay"],) = state.delay
    return out


def test_every_column_moves_what_its_name_says_and_nothing_else(net):
    before = described(net, net.start)
    for column, name in enumerate(net.column_names()):
        dx = np.zeros(net.n_columns)
        dx[column] = 1e-3
        after = described(net, net.moved(net.start, dx, np.zeros((net.n_points, 3))))
        for other, value in after.items():
            by = 1e-3 if other == name else 0.0
            assert value - before[other] == pytest.approx(by, abs=1e-11), (name, other)


def test_columns_are_named_once(net):
    names = net.column_names()
    assert len(set(names)) == len(names) == net.n_columns
    assert "" not in names


def test_what_is_held_has_no_column():
    columns = layout(2, 3, free=("f", "k1"), free_mount=("lever_z",))
    assert columns.n_columns == 2 * 3 + 3 * 6
    assert columns.interior[:, [0, 3]].tolist() == [[0, 1], [3, 4]]
    assert np.all(columns.interior[:, [1, 2, 4, 5, 6, 7, 8]] == -1)
    assert columns.mount[:, 2].tolist() == [2, 5]
    assert np.all(columns.mount[:, [0, 1, 3, 4, 5]] == -1)
    assert columns.pose.ravel().tolist() == list(range(6, 24))


def test_shift_and_drifts_stand_between_cameras_and_poses():
    columns = layout(1, 2, free=("f",), free_shift=("east", "height"), n_drifts=2)
    assert columns.shift.tolist() == [1, -1, 2]
    assert columns.drift.tolist() == [[3, 4, 5], [6, 7, 8]]
    assert columns.pose.ravel().tolist() == list(range(9, 21))
    assert columns.n_columns == 21


def test_a_wild_step_leaves_the_focal_length_positive(net):
    dx = np.full(net.n_columns, -1e3)
    state = net.moved(net.start, dx, np.zeros((net.n_points, 3)))
    assert all(interior.f > 0 for interior in state.interiors)


def test_points_move_by_their_step(net, rng):
    dp = rng.normal(size=(net.n_points, 3))
    moved = net.moved(net.start, np.zeros(net.n_columns), dp)
    assert_allclose(moved.x_m, net.start.x_m + dp, atol=0)


# --- residuals -------------------------------------------------------------------------------


def test_residuals_of_the_truth_vanish():
    block = small()
    net = adjust.mounted_orientation(block, Model(free=("f",)))
    x_m = np.concatenate([blocks.crosses(spacing_m=200.0), blocks.terrain(6, half_m=150.0)])
    state = replace(net.start, x_m=x_m)
    for v, sigma in net.residuals(state):
        assert_allclose(v[np.isfinite(sigma)], 0.0, atol=1e-8)  # px, m or rad


def test_equations_and_residuals_say_the_same(net, rng):
    state = off(net, rng)
    for e, (v, sigma) in zip(net.equations(state), net.residuals(state), strict=True):
        assert_allclose(e.v, v, atol=1e-9)
        assert_allclose(e.sigma, sigma, atol=0)
    kinds = [e.kind for e in net.equations(state)]
    assert kinds == ["image_point", "control_point", "gnss", "attitude"]


def test_a_position_residual_is_counted_along_the_grid_axes():
    net = networks()["mounted"]
    by = np.array([0.1, -0.2, 0.3])
    R_m_g = np.swapaxes(net.observed.R_g_m, 1, 2)
    moved = Pose(R=net.start.T_m_b.R, r=net.start.T_m_b.r + transform(R_m_g, by))
    v, _ = net.residuals(replace(net.start, T_m_b=moved))[2]
    assert_allclose(v, np.tile(by, (6, 1)), atol=1e-11)


def test_an_attitude_residual_is_counted_about_the_bodys_axes():
    net = networks()["mounted"]
    by = np.radians([0.1, -0.2, 0.3])
    turned = Pose(R=net.start.T_m_b.R @ exp(by), r=net.start.T_m_b.r)
    v, _ = net.residuals(replace(net.start, T_m_b=turned))[3]
    assert_allclose(v, np.tile(by, (6, 1)), atol=1e-14)


def test_a_control_residual_is_estimated_less_surveyed_along_the_grid_axes():
    net = networks()["free"]
    by = np.array([0.1, -0.2, 0.3])
    x_m = net.start.x_m.copy()
    R_m_g = np.swapaxes(net.control.R_g_m, 1, 2)
    x_m[net.control.point_idx] = net.control.x_m + transform(R_m_g, by)
    v, _ = net.residuals(replace(net.start, x_m=x_m))[1]
    assert_allclose(v, np.tile(by, (8, 1)), atol=1e-11)  # nine less the one that is held


# --- control ---------------------------------------------------------------------------------


def test_control_without_error_is_held_and_no_observation():
    net = networks()["free"]
    assert not net.free_points[0]
    assert net.free_points[1:].all()
    _, sigma = net.residuals(net.start)[1]
    assert sigma.shape == (8, 3)
    assert np.isinf(sigma[0, 2])  # of the second point: its height is taken out
    assert np.isfinite(np.delete(sigma.ravel(), 2)).all()


def test_a_single_component_without_error_is_a_micrometre():
    block = small()
    sigma = np.tile([0.01, 0.0, 0.02], (9, 1))
    block = replace(block, control=replace(block.control, sigma_m=sigma))
    _, used = adjust.free_orientation(block, Model()).residuals(networks()["free"].start)[1]
    assert_allclose(used, np.tile([0.01, 1e-6, 0.02], (9, 1)), atol=0)


# --- the whole Jacobian ----------------------------------------------------------------------


def largest_difference(net, state):
    """Relative to the largest entry of each column."""
    steps = [STEPS[name.split("/")[1]] for name in net.column_names()]
    numeric = numeric_dense_jacobian(net, state, step_columns=steps)
    difference = np.abs(dense_jacobian(net, state) - numeric)
    return np.max(difference / np.abs(numeric).max(axis=0))


def test_all_derivatives_agree_with_the_residuals(net, rng):
    # rounding of 1e-9 px over steps of 1e-3 px, and attitudes of 1e-16 rad over 1e-5
    measured = replace(net, distortion_at="measured")
    assert largest_difference(measured, off(measured, rng)) < 3e-6


def test_at_the_adjusted_point_derivatives_leave_out_how_the_last_step_curves(net, rng):
    """Steps of up to 0.01 mm, times the curvature of distortion, which is some 1e-3 per mm."""
    assert largest_difference(net, off(net, rng)) < 1e-4


@pytest.mark.parametrize("setup", [adjust.free_orientation, adjust.mounted_orientation])
def test_derivatives_leave_out_only_how_refraction_changes(setup, rng):
    """The lift is taken as constant: its own slope is of the size K = 3e-5 at most."""
    net = setup(small(refraction="standard"), Model(free=("f", "xp"), refraction="standard"))
    assert largest_difference(net, off(net, rng)) < 1e-4


def test_refraction_is_in_the_residuals():
    block = small(refraction="standard")
    x_m = np.concatenate([blocks.crosses(spacing_m=200.0), blocks.terrain(6, half_m=150.0)])
    for refraction, smallest, largest in (("standard", 0.0, 1e-8), ("none", 0.01, 1.0)):
        net = adjust.mounted_orientation(block, Model(refraction=refraction))
        v, _ = net.residuals(replace(net.start, x_m=x_m))[0]
        assert smallest <= np.abs(v).max() <= largest  # px
