"""What positions are off in common: a shift, and drifts along strips."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.observations import (
    Strips,
    distance_equations,
    mounting_equations,
    of_halves,
    position_errors,
    strips_of,
    usable,
)
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.distances import Distances, lengths
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.prior import Prior
from support import blocks
from support.helpers import numeric_jacobian


@pytest.fixture(scope="module")
def block():
    """Twelve exposures in three strips of four."""
    return blocks.in_strips(blocks.standard(), 4)


def with_strips(block, names, time_s):
    return replace(
        block,
        images=replace(block.images, strips=tuple(names)),
        trajectory=replace(block.trajectory, time_s=np.asarray(time_s, dtype=float)),
    )


def test_time_is_counted_from_the_middle_of_each_strip(block):
    times = [10.0, 12.0, 20.0, 30.0, *range(100, 108)]
    found = strips_of(with_strips(block, "AAAABBBBBBBB", times))
    assert found.names == ("A", "B")
    assert found.unit == "s"
    assert found.idx.tolist() == [0] * 4 + [1] * 8
    assert_allclose(found.elapsed[:4], [-8.0, -6.0, 2.0, 12.0], atol=1e-12)
    assert_allclose(found.elapsed[4:], np.arange(8) - 3.5, atol=1e-12)


def test_without_times_the_order_in_the_strip_counts(block):
    found = strips_of(with_strips(block, "ABABABABAAAA", np.full(12, np.nan)))
    assert found.unit == "exposure"
    assert_allclose(found.elapsed[[1, 3, 5, 7]], [-1.5, -0.5, 0.5, 1.5], atol=1e-12)
    assert_allclose(found.elapsed[[0, 2, 4, 6, 8, 9, 10, 11]], np.arange(8) - 3.5, atol=1e-12)


def test_an_exposure_alone_or_in_no_strip_does_not_drift(block):
    times = np.array([*range(10), 20.0, 20.0])  # the last strip has one time only
    found = strips_of(with_strips(block, [*"AAAB", *([""] * 6), *"CC"], times))
    assert found.names == ("A",)
    assert found.idx.tolist() == [0] * 3 + [-1] * 9
    assert_allclose(found.elapsed[3:], 0.0, atol=0)


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


def test_positions_are_off_by_the_shift_and_what_the_drift_has_added_up():
    net = uses.mounted_orientation(blocks.standard(), free=())
    strips = Strips(names=("A", "B"), idx=np.array([0, 1, -1]), elapsed=np.array([2.0, -3.0, 0.0]))
    drift = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 0.01]])
    found = position_errors(replace(net.observed, strips=strips), np.array([1.0, 2.0, 3.0]), drift)
    assert_allclose(found, [[1.2, 2.0, 3.0], [1.0, 1.4, 2.97], [1.0, 2.0, 3.0]], atol=1e-15)


def test_observed_positions_are_the_true_ones_and_their_errors(block):
    """At the truth, positions shifted and drifting along the grid's axes leave no residual."""
    net = uses.mounted_orientation(block, free=(), gnss=("shift", "drift"))
    shift, drift = np.array([0.3, -0.2, 0.1]), 0.01 * np.arange(9).reshape(3, 3)
    by = position_errors(net.observed, shift, drift)
    off = uses.mounted_orientation(
        blocks.changed(block, "gnss", by), free=(), gnss=("shift", "drift")
    )
    truth = replace(off.start, T_m_b=net.start.T_m_b, shift=shift, drift=drift)
    v, _ = off.residuals(truth)[2]
    assert_allclose(v, 0.0, atol=1e-9)  # m, of coordinates of 1e3


def test_a_block_without_strips_cannot_drift():
    with pytest.raises(AdjustmentError, match=r"images\.csv needs its column strip"):
        uses.mounted_orientation(blocks.standard(), free=(), gnss=("drift",))


# --- distances -------------------------------------------------------------------------------


def _distances(sigma=0.01):
    """A tape of 5.02 m along a 3-4-5 triangle's longest side, and one of 4 m."""
    return Distances(
        point_idx=np.array([[0, 1], [1, 2]]),
        distance_m=np.array([5.02, 4.0]),
        sigma_m=np.array([sigma, 2 * sigma]),
    ), np.array([[0.0, 0.0, 7.0], [3.0, 4.0, 7.0], [3.0, 0.0, 7.0]])


def test_the_halves_of_a_distance_are_its_residual_with_one_point_each():
    distances, x_m = _distances()
    e = distance_equations(distances, x_m, np.array([6, 7]))
    assert_allclose(e.v.ravel(), [-0.01, 0.0, -0.01, 0.0], atol=1e-15)
    assert_allclose(of_halves(e.v).ravel(), [-0.02, 0.0], atol=1e-15)
    assert_allclose(np.sqrt(of_halves(e.sigma**2)).ravel(), distances.sigma_m)
    assert e.point.tolist() == [0, 1, 1, 2]
    assert_allclose(e.B[:, 0], [[-0.6, -0.8, 0], [0, 1, 0], [0.6, 0.8, 0], [0, -1, 0]], atol=1e-15)


def test_eliminating_the_joining_unknown_leaves_the_distances_own_normal_equations(rng):
    distances, x_m = _distances()
    x_m = x_m + rng.normal(0, 0.05, x_m.shape)
    e = distance_equations(distances, x_m, np.array([0, 1]))
    J = np.zeros((4, 2 + 9))
    for i in range(4):
        J[i, e.unit[i]] = e.A[i, 0, 0]
        J[i, 2 + 3 * e.point[i] : 5 + 3 * e.point[i]] = e.B[i, 0]
    J /= e.sigma
    v = (e.v / e.sigma).ravel()
    N, g = J.T @ J, J.T @ v
    reduced = N[2:, 2:] - N[2:, :2] @ np.linalg.solve(N[:2, :2], N[:2, 2:])
    right = g[2:] - N[2:, :2] @ np.linalg.solve(N[:2, :2], g[:2])

    def residuals(x):
        length, _ = lengths(x.reshape(-1, 3), distances.point_idx)
        return (length - distances.distance_m) / distances.sigma_m

    own = numeric_jacobian(residuals, x_m.ravel())
    assert_allclose(reduced, own.T @ own, rtol=1e-6, atol=1e-3)
    assert_allclose(right, own.T @ residuals(x_m.ravel()), rtol=1e-6, atol=1e-4)
    assert v @ v == pytest.approx(np.sum(residuals(x_m.ravel()) ** 2))


def test_distances_are_used_whose_ends_are_both_measured():
    distances, _ = _distances()
    assert usable(distances, np.array([0, 1, 1, 2, 5])).tolist() == [0, 1]
    assert usable(distances, np.array([1, 2])).tolist() == [1]
    out = replace(distances, sigma_m=np.array([0.1, np.inf]))
    assert usable(out, np.array([0, 1, 2])).tolist() == [0]
