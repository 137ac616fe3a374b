"""Steps and drifts of the boresight: dense least squares, planted turns, and the level."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.planning import design, plan, tables
from acx4lib.bundle.adjust import adjust, designed, free_orientation, mounted_orientation
from acx4lib.calibration import stability, trajectory_errors
from acx4lib.calibration.stability import LEFT, TIE_POINTS, calm_sigmas
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.parameters import Prior
from acx4lib.model import Model
from support import blocks
from support.flights.planned import strip, values

FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def adjusted(block):
    return adjust(mounted_orientation(block, Model(free=FREE)))


@pytest.fixture(scope="module")
def exact():
    block = blocks.simulate(
        blocks.fly(per_strip=5), ties=blocks.terrain(25), control=blocks.crosses()[::2]
    )
    return blocks.in_strips(block, 5)


@pytest.fixture(scope="module")
def noisy(exact):
    return adjusted(blocks.noisy(exact, np.random.default_rng(3)))


def turned(block, by_deg, names="C"):
    """Return the block with the body's recorded attitude as if the camera had turned."""
    T, strips = block.trajectory.T_m_b, np.array(block.images.strips)
    own = np.isin(strips, list(names))[:, None]
    back = exp(-np.where(own, np.radians(by_deg), 0.0))
    return replace(block, trajectory=replace(block.trajectory, T_m_b=Pose(R=T.R @ back, r=T.r)))


def dense(bundle, C):
    """Return F of turns C, their number, and what redundancy the attitudes have beside them."""
    network = bundle.network
    n, n_points = network.n_columns, network.n_points
    rows, right, is_attitude, extra = [], [], [], []
    for e in network.equations(bundle.state):
        for i, j in np.argwhere(np.isfinite(e.sigma)):
            row = np.zeros(n + 3 * n_points)
            columns = e.columns[e.unit[i]] if e.A.shape[2] else np.zeros(0, dtype=int)
            np.add.at(row, columns[columns >= 0], e.A[i, j][columns >= 0])
            if e.B is not None:
                row[n + 3 * e.point[i] : n + 3 * e.point[i] + 3] = e.B[i, j]
            own = e.kind == "attitude"
            rows.append(row / e.sigma[i, j])
            extra.append((C[i, j] if own else np.zeros(C.shape[2])) / e.sigma[i, j])
            right.append(e.v[i, j] / e.sigma[i, j])
            is_attitude.append(own)
    A, b, own = np.array(rows), np.array(right), np.array(is_attitude)
    A = A[:, np.any(A != 0, axis=0)]
    Q, singular, _ = np.linalg.svd(A / np.linalg.norm(A, axis=0), full_matrices=False)
    Q = Q[:, singular > 1e-10 * singular[0]]
    X = np.array(extra) / np.linalg.norm(extra, axis=0)
    U, shown, _ = np.linalg.svd(X - Q @ (Q.T @ X), full_matrices=False)
    U = U[:, shown > 0.03]  # what all strips share is the boresight
    before = b - Q @ (Q.T @ b)
    after = before - U @ (U.T @ before)
    redundancy = np.sum(own) - np.sum(Q[own] ** 2) - np.sum(U[own] ** 2)
    dof = U.shape[1]
    explained = before @ before - after @ after
    return explained / dof / (after[own] @ after[own] / redundancy), dof, redundancy


def test_steps_are_tested_as_by_dense_least_squares_with_turns_as_unknowns(noisy):
    strips = np.array(noisy.network.block.images.strips)
    one_hot = (strips[:, None] == np.array(list("ABCD"))).astype(float)
    C = np.einsum("mn,ab->manb", one_hot, np.eye(3)).reshape(-1, 3, 12)
    f, dof, redundancy = dense(noisy, C)
    found = stability.between_strips(noisy)
    assert found.names == ("A", "B", "C", "D")
    assert found.dof == dof == 9
    assert_allclose(found.redundancy, redundancy, rtol=1e-4)
    assert_allclose(found.f, f, rtol=1e-3)
    assert found.p == pytest.approx(stats.f.sf(f, dof, redundancy), rel=0.01)


def test_a_strip_whose_camera_turned_is_found_with_its_size(exact):
    by_deg = np.array([0.02, -0.03, 0.05])
    found = stability.between_strips(
        adjusted(turned(blocks.noisy(exact, np.random.default_rng(5)), by_deg))
    )
    assert found.p < 1e-4
    expected = np.radians(np.array([-1, -1, 3, -1])[:, None] * by_deg / 4)
    assert np.all(np.abs(found.turns - expected) < 3.5 * found.sigma)
    assert np.all(np.abs(found.turns[2]) > 3 * found.sigma[2])


def test_a_camera_that_turns_the_same_everywhere_is_no_step(exact):
    found = stability.between_strips(adjusted(turned(exact, np.full(3, 0.3), "ABCD")))
    assert_allclose(found.turns, 0.0, atol=1e-9)


@pytest.mark.parametrize("sigma_deg", [0.005, 0.02, 0.05, 0.1, 1.0])
def test_a_declared_boresight_leaves_the_number_and_the_sigma_of_steps(exact, noisy, sigma_deg):
    """A turn of all strips, which it shows in part, is no step, however well it is declared."""
    known = Prior(declared=(True,) * 6, sigma=(*3 * [np.inf], *3 * [np.radians(sigma_deg)]))
    camera = replace(exact.cameras[0], prior=known)
    block = replace(noisy.network.block, cameras=(camera,))
    declared, free = (stability.between_strips(b) for b in (adjusted(block), noisy))
    assert declared.dof == free.dof == 9
    assert_allclose(declared.sigma, free.sigma, rtol=0.1)
    assert_allclose(declared.turns, free.turns, atol=0.1 * free.sigma.max())
    assert_allclose(declared.f, free.f, rtol=0.1)


def test_a_drift_is_found_with_its_size(exact):
    time = exact.trajectory.time_s
    share = (time - time.mean()) / np.ptp(time)
    T, turn = exact.trajectory.T_m_b, share[:, None] * np.radians([0.04, 0.0, -0.06])
    drifting = replace(exact.trajectory, T_m_b=Pose(R=T.R @ exp(-turn), r=T.r))
    block = blocks.noisy(replace(exact, trajectory=drifting), np.random.default_rng(6))
    found = stability.over_time(adjusted(block))
    assert found.p < 1e-4
    off = np.abs(found.turns[0] - np.radians([0.04, 0.0, -0.06])) / found.sigma[0]
    assert np.all(off < 3.5)


def test_right_boresights_fail_as_often_as_is_said(exact):
    """80 flights: p is uniform, Kolmogorov-Smirnov at 0.1 %."""
    bundles = [adjusted(blocks.noisy(exact, np.random.default_rng(seed))) for seed in range(80)]
    for test in (stability.between_strips, stability.over_time):
        assert stats.kstest([test(bundle).p for bundle in bundles], "uniform").pvalue > 0.001


def test_without_strips_times_or_attitudes_nothing_is_tested(exact, noisy):
    assert stability.between_strips(adjusted(blocks.in_strips(exact, 20))) is None
    alike = replace(exact.trajectory, time_s=np.full(20, 7.0))
    assert stability.over_time(adjusted(replace(exact, trajectory=alike))) is None
    free = adjust(free_orientation(noisy.network.block, Model(free=FREE)))
    assert stability.between_strips(free) is None
    assert stability.over_time(free) is None


# --- What sigma would be in calm air over level ground


ONE_HEIGHT = {line: strip(line) for line in ("north", "south", "east", "west")}


def flown(tilt_deg, relief_m, *, ties=150):
    """Four strips of three exposures at two heights, tilted so much, over so high hills."""
    points = blocks.terrain(ties, half_m=450.0, relief_m=relief_m)
    control = blocks.crosses() * [1.0, 1.0, 0.0] + [0.0, 0.0, blocks.GROUND_M]
    poses = blocks.fly(ONE_LEVEL, tilt_deg=tilt_deg)
    block = blocks.in_strips(blocks.simulate(poses, ties=points, control=control), 3)
    return designed(mounted_orientation(block, Model(free=("f", "xp", "yp"))))


ONE_LEVEL = ((1000.0, 0.0, 0.0), (1000.0, 0.0, 90.0), (1000.0, 0.0, 180.0), (1000.0, 0.0, 270.0))


def sigma(bundle):
    return np.sqrt(np.diag(trajectory_errors.reported_covariance(bundle)))


def test_it_is_that_of_a_flight_of_which_a_twentieth_of_tilts_and_hills_is_left():
    """Two blocks, simulated each by itself; strips tilt otherwise on average, which is left out."""
    rough, calm = flown(1.5, 60.0), flown(1.5 * LEFT, 60.0 * LEFT)
    expected = sigma(calm) / sigma(rough)
    found = calm_sigmas(rough)
    f = 0  # the camera is mounted obliquely, by which x_p and y_p are told from the lever arm
    assert expected[f] > 5
    assert_allclose(found, expected, rtol=0.15)


def of_plan(**changes):
    bundle = design.of(plan.from_values(values(**changes))).mountings["single_step"].bundle
    names = [p.name for p in tables.unknowns(bundle)]
    return dict(zip(names, calm_sigmas(bundle), strict=True))


def test_of_one_height_focal_length_and_lever_arm_rest_on_the_wind():
    found = of_plan(calibration={"strips": ONE_HEIGHT})
    assert all(found[name] > 10 for name in ("f_mm", "lever_z_m", "lever_x_m", "xp_mm"))
    assert all(found[name] < 1.2 for name in ("k1", "p1", "boresight_kappa_deg"))


@pytest.mark.parametrize(
    ("speeds", "rests"), [((70, 70), True), ((70, 66), True), ((80, 55), False)]
)
def test_a_delay_rests_on_the_wind_where_strips_have_about_one_speed(speeds, rests):
    strips = {
        name: {**one, "speed_m_s": float(v)}
        for (name, one), v in zip(
            values()["calibration"]["strips"].items(), 2 * speeds, strict=True
        )
    }
    stages = {"mounting": {"estimate": ["f_mm"], "gnss": ["delay"]}}
    found = of_plan(calibration={"strips": strips}, stages=stages)
    assert (found["gnss_delay_s"] > 4) == rests


def test_a_part_of_many_tie_points_says_the_same_as_all():
    few, many = (flown(1.5, 60.0, ties=n) for n in (TIE_POINTS, 4 * TIE_POINTS))
    assert_allclose(calm_sigmas(few), calm_sigmas(many), rtol=0.3)
