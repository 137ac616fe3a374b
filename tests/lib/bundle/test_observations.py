"""What positions are off in common: a shift, and drifts along strips."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.observations import (
    Strips,
    mounting_equations,
    position_errors,
    strips_of,
)
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.camera import mountings
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
