"""The free rig against the rigid one: dense least squares, a planted turn, and levels."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration.trust.rigidity import rigidity
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.frames import exp
from support import blocks
from support.flights import rigs

FREE = ("f", *rigs.FREE)


def noisy(seed, *, ties=12):
    return blocks.noisy(rigs.simulated(ties=ties), np.random.default_rng(seed))


@pytest.fixture(scope="module")
def small():
    block = noisy(4)
    return adjust(mounted_orientation(block, free=FREE))


def dense(bundle, exposures):
    """Return the fall of the sum of squares, and the angles, by dense least squares."""
    network = bundle.network
    seen, *others = network.equations(bundle.state)
    images = network.block.images
    n, n_points = network.n_columns, network.n_points
    rows, right = [], []
    for e in (seen, *others):
        for i in range(len(e.v)):
            for j in range(e.v.shape[1]):
                if not np.isfinite(e.sigma[i, j]):
                    continue
                row = np.zeros(n + 3 * n_points + 3 * len(images))
                columns = e.columns[e.unit[i]] if e.A.shape[2] else np.zeros(0, dtype=int)
                held = columns < 0
                np.add.at(row, columns[~held], e.A[i, j][~held])
                if e.B is not None:
                    row[n + 3 * e.point[i] : n + 3 * e.point[i] + 3] = e.B[i, j]
                if e is seen:
                    k = images.camera_idx[e.unit[i]]
                    own = [list(columns).index(c) for c in network.layout.mount[k, 3:]]
                    at = n + 3 * n_points + 3 * e.unit[i]
                    row[at : at + 3] = e.A[i, j][own]
                rows.append(row / e.sigma[i, j])
                right.append(e.v[i, j] / e.sigma[i, j])
    A, b = np.array(rows), -np.array(right)
    turning = [
        i
        for i in range(len(images))
        if images.exposure_idx[i] in exposures and images.camera_idx[i] > 0
    ]
    extra = np.concatenate([n + 3 * n_points + 3 * i + np.arange(3) for i in turning])
    rigid = A[:, : n + 3 * n_points]
    free = np.hstack([rigid, A[:, extra]])
    left = [b - M @ np.linalg.lstsq(M, b, rcond=1e-12)[0] for M in (rigid, free)]
    x = np.linalg.lstsq(free, b, rcond=1e-12)[0][-len(extra) :]
    return left[0] @ left[0] - left[1] @ left[1], x.reshape(-1, 3)


def test_one_exposure_is_what_dense_least_squares_makes_of_it(small):
    found = rigidity(small)
    explained, angles = dense(small, {2})
    i = found.exposures.index(small.network.pose_names[2])
    assert_allclose(found.tests[i].explained, explained, rtol=1e-4)
    assert_allclose(found.turns[i, 1], angles[0], rtol=1e-4, atol=1e-9)
    assert found.tests[i].dof == 3
    assert found.tests[i].redundancy == small.solution.redundancy - 3
    omega = small.solution.sigma0_sq * small.solution.redundancy
    assert_allclose(found.tests[i].left, omega - explained, rtol=1e-6)


def test_all_exposures_are_what_dense_least_squares_makes_of_them(small):
    found = rigidity(small)
    explained, _ = dense(small, set(range(len(small.network.pose_names))))
    assert_allclose(found.whole.explained, explained, rtol=1e-3)
    assert found.whole.dof == 3 * len(found.exposures) - 3  # one boresight takes up three
    f = found.whole.explained / found.whole.dof
    f /= found.whole.left / found.whole.redundancy
    assert_allclose(found.whole.p, stats.f.sf(f, found.whole.dof, found.whole.redundancy))


def test_the_first_head_is_what_the_others_turn_against(small):
    found = rigidity(small)
    assert_allclose(found.turns[:, 0], 0)
    assert_allclose(found.sigma[:, 0], 0)
    assert np.all(found.sigma[:, 1] > 0)
    assert found.heads == ("CAM1", "CAM2")


def test_probabilities_of_a_rigid_rig_are_uniform():
    p, t = [], []
    for seed in range(6):
        block = noisy(seed)
        found = rigidity(adjust(mounted_orientation(block, free=FREE)))
        p += [test.p for test in found.tests]
        t.append((found.turns / np.where(found.sigma > 0, found.sigma, np.nan))[:, 1])
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    assert_allclose(np.std(np.concatenate(t)), 1.0, atol=0.15)


def turned(block, exposure, angle):
    """Turn the second head at an exposure, by the library's rotations, in the true block."""
    points, images = block.image_points, block.images
    image = int(np.flatnonzero((images.exposure_idx == exposure) & (images.camera_idx == 1))[0])
    own = points.image_idx == image
    camera = block.cameras[1]
    f_px = camera.interior.f / camera.pixel_mm
    colrow = points.colrow.copy()
    middle = np.array([(camera.width_px - 1) / 2, (camera.height_px - 1) / 2])
    x, y = ((colrow[own] - middle) * [1, -1]).T
    ray = np.column_stack([x, y, np.full_like(x, -f_px)]) @ exp(np.array([[0.0, angle, 0.0]]))[0]
    seen = -f_px * ray[:, :2] / ray[:, 2:]
    colrow[own] = middle + seen * [1, -1]
    return replace(block, image_points=replace(points, colrow=colrow))


def test_a_head_that_turned_at_one_exposure_is_found():
    angle = np.radians(60 / 3600)
    block = turned(noisy(1, ties=30), 3, angle)
    bundle = adjust(mounted_orientation(block, free=FREE))
    found = rigidity(bundle)
    i = found.exposures.index(bundle.network.pose_names[3])
    assert np.argmin(found.p_joint) == i
    assert found.p_joint[i] < 1e-3
    assert abs(found.turns[i, 1, 1] - angle) < 4 * found.sigma[i, 1, 1]


def test_a_single_camera_cannot_turn_against_another(mounted):
    with pytest.raises(AdjustmentError, match="no exposure has measurements of two heads"):
        rigidity(mounted)
