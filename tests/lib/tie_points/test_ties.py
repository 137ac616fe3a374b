"""Tie points between heads, and the paper's refinement by mean differences."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.tie_points import ties as tie_points
from acx4lib.tie_points.ties import overlaps, refine_by_mean_differences, shared_points
from support import blocks

OPK = np.radians([[-5.0, 6.0, 90.0], [5.0, 6.0, -90.0], [5.0, -6.0, -90.0]])
LABELS = ("A", "B", "C")


def head(k):
    """A head without a lever arm: all of them see the synthetic image from one point."""
    return replace(
        blocks.CAMERA,
        name=LABELS[k],
        interior=Interior(f=50.0, xp=0.02 * k, k1=1e-6),
        T_b_c=Pose(R=rotation_from_opk(OPK[k]), r=np.zeros(3)),
    )


@pytest.fixture(scope="module")
def block():
    return blocks.simulate(
        blocks.fly([(1000.0, 0.0, 0.0), (1300.0, 0.0, 0.0)], per_strip=2),
        cameras=[head(k) for k in range(3)],
        ties=blocks.terrain(60),
    )


@pytest.fixture(scope="module")
def orientation():
    """The truth: body and synthetic frame are one."""
    return RelativeOrientation(
        heads=tuple(head(k) for k in range(3)),
        xyz_mm=np.tile([0.0, 0.0, 50.0], (3, 1)),
        opk=OPK,
        cov_joint=np.zeros((48, 48)),
        n_exposures=4,
    )


@pytest.fixture(scope="module")
def ties(block, orientation):
    return shared_points(block, orientation)


def shifted(orientation, by):
    xyz = orientation.xyz_mm.copy()
    xyz[:, :2] += by
    return replace(orientation, xyz_mm=xyz)


# --- finding them ----------------------------------------------------------------------------


def test_every_point_that_two_heads_saw_at_one_exposure_is_a_tie_point(block, ties):
    points, images = block.image_points, block.images
    seen = {}
    for i, p, colrow in zip(points.image_idx, points.point_idx, points.colrow, strict=True):
        key = (int(images.exposure_idx[i]), int(p))
        seen.setdefault(key, {})[int(images.camera_idx[i])] = tuple(colrow)
    expected = {
        (a, b, e, p, colrows[a], colrows[b])
        for (e, p), colrows in seen.items()
        for a in colrows
        for b in colrows
        if a < b
    }
    found = {
        (int(a), int(b), int(e), int(p), tuple(ca), tuple(cb))
        for a, b, e, p, ca, cb in zip(
            ties.head_a,
            ties.head_b,
            ties.exposure_idx,
            ties.point_idx,
            ties.colrow_a,
            ties.colrow_b,
            strict=True,
        )
    }
    assert found == expected
    assert len(ties) == len(expected) > 50
    assert {(a, b) for a, b, *_ in found} == {(0, 1), (0, 2), (1, 2)}


def test_heads_count_in_the_order_of_the_orientation(block, orientation, ties):
    n = len(ties)
    backwards = replace(orientation, heads=orientation.heads[::-1], opk=OPK[::-1])
    found = shared_points(block, backwards)
    assert len(found) == n
    assert np.all(found.head_a < found.head_b)
    for overlap in overlaps(found, backwards):
        assert_allclose(overlap.d, 0.0, atol=1e-9)


def test_rejected_measurements_tie_nothing(block, orientation, ties):
    points = block.image_points
    sigma = points.sigma_px.copy()
    image = 4  # head B at exposure 1
    sigma[points.image_idx == image] = np.inf
    found = shared_points(replace(block, image_points=replace(points, sigma_px=sigma)), orientation)
    lost = (ties.exposure_idx == 1) & ((ties.head_a == 1) | (ties.head_b == 1))
    assert lost.any()
    assert len(found) == len(ties) - lost.sum()


def test_a_tie_point_has_the_larger_sigma_of_its_two_measurements(block, orientation):
    points = block.image_points
    head_idx = block.images.camera_idx[points.image_idx]
    uneven = replace(points, sigma_px=np.where(head_idx == 1, 0.8, 0.3))
    found = shared_points(replace(block, image_points=uneven), orientation)
    with_b = (found.head_a == 1) | (found.head_b == 1)
    assert_allclose(found.sigma_px[with_b], 0.8, atol=0)
    assert_allclose(found.sigma_px[~with_b], 0.3, atol=0)


# --- differences -----------------------------------------------------------------------------


def test_differences_are_the_second_head_less_the_first(ties, orientation):
    by = np.array([[0.0, 0.0], [0.003, -0.001], [0.0, 0.0]])
    by_pair = {(o.head_a, o.head_b): o for o in overlaps(ties, shifted(orientation, by))}
    assert_allclose(by_pair[0, 1].mean, [0.003, -0.001], atol=1e-9)
    assert_allclose(by_pair[1, 2].mean, [-0.003, 0.001], atol=1e-9)
    assert_allclose(by_pair[0, 2].mean, 0.0, atol=1e-9)
    assert_allclose(by_pair[0, 1].rms, [0.003, 0.001], atol=1e-9)


# --- refinement ------------------------------------------------------------------------------


def test_planted_shifts_are_taken_back_and_the_mean_stays(ties, orientation):
    by = np.array([[0.010, -0.004], [-0.002, 0.006], [0.001, 0.004]])
    refined = refine_by_mean_differences(shifted(orientation, by), ties)
    expected = orientation.xyz_mm[:, :2] + by.mean(axis=0)  # what all have in common stays
    assert_allclose(refined.xyz_mm[:, :2], expected, atol=1e-9)
    assert_allclose(refined.xyz_mm[:, 2], 50.0, atol=0)
    assert_allclose(refined.opk, OPK, atol=0)


def test_pairs_weigh_as_many_points_as_they_have(ties, orientation):
    """Differences that contradict each other: the pair with more points gives way less."""
    contradicting = replace(ties, colrow_b=ties.colrow_b.copy())
    own = (ties.head_a == 0) & (ties.head_b == 1)
    contradicting.colrow_b[own] += [2.0, 0.0]
    before = {(o.head_a, o.head_b): o.mean for o in overlaps(contradicting, orientation)}
    refined = refine_by_mean_differences(orientation, contradicting)
    after = {(o.head_a, o.head_b): o for o in overlaps(contradicting, refined)}
    assert np.linalg.norm(before[0, 1]) > 0.01
    # stationary: what is left, times the points, balances at every head
    for k in range(3):
        pull = sum(
            ((k == b) * 1.0 - (k == a) * 1.0) * len(o.d) * o.mean for (a, b), o in after.items()
        )
        assert_allclose(pull, 0.0, atol=1e-7)


def with_variance(orientation, i, variance):
    cov = np.zeros_like(orientation.cov_joint)
    cov[i, i] = variance
    return replace(orientation, cov_joint=cov)


def test_an_error_of_one_heads_place_is_repaired_but_for_the_mean(ties, orientation):
    """What is left of an error in Yc of head B is a third of it, the same for all heads."""
    quiet = replace(ties, sigma_px=np.full(len(ties), 1e-12))
    refined = refine_by_mean_differences(with_variance(orientation, 7, 0.01**2), quiet)
    y = np.array([1, 7, 13])
    assert_allclose(refined.cov_joint[np.ix_(y, y)], (0.01 / 3) ** 2, rtol=1e-6)
    rest = np.delete(np.diag(refined.cov_joint), y)
    assert_allclose(rest, 0.0, atol=1e-20)


@pytest.mark.parametrize(
    ("i", "sigma"),
    [
        (10, 2e-5),  # phi of head B
        (2, 0.01),  # Zc of head A
        (18 + 10 + 1, 3e-3),  # xp of head B
        (18 + 20 + 3, 1e-8),  # k1 of head C
    ],
)
def test_any_other_error_is_carried_into_all_heads_places(ties, orientation, i, sigma):
    """The covariance of one error is its effect times itself: the Jacobian, numerically."""
    quiet = replace(ties, sigma_px=np.full(len(ties), 1e-12))

    def refined_xy(by):
        changed = orientation
        if i < 18:
            xyz, opk = orientation.xyz_mm.copy(), orientation.opk.copy()
            (xyz if i % 6 < 3 else opk)[i // 6, i % 3] += by
            changed = replace(orientation, xyz_mm=xyz, opk=opk)
        else:
            k, j = divmod(i - 18, 10)
            values = orientation.heads[k].interior.to_array()
            values[j] += by
            heads = list(orientation.heads)
            heads[k] = heads[k].with_interior(Interior.from_array(values))
            changed = replace(orientation, heads=tuple(heads))
        return refine_by_mean_differences(changed, quiet).xyz_mm[:, :2]

    effect = (refined_xy(sigma) - refined_xy(-sigma)) / 2
    found = refine_by_mean_differences(with_variance(orientation, i, sigma**2), quiet).cov_joint
    for axis in (0, 1):
        own = found[axis:18:6, axis:18:6]
        expected = np.outer(effect[:, axis], effect[:, axis])
        assert_allclose(own, expected, atol=1e-4 * np.max(np.square(effect)))
    assert found[i, i] == pytest.approx(sigma**2)  # what tie points cannot repair stays


def test_the_noise_of_the_tie_points_is_carried_over(ties, orientation):
    """Monte Carlo, 300 copies: a sigma to 1 / sqrt(600) = 4 %, over six values."""
    rng = np.random.default_rng(4)
    places = []
    for _ in range(300):
        noisy = replace(
            ties,
            colrow_a=ties.colrow_a + rng.normal(0, 0.5, ties.colrow_a.shape),
            colrow_b=ties.colrow_b + rng.normal(0, 0.5, ties.colrow_b.shape),
        )
        xyz = orientation.xyz_mm.copy()
        xyz[:, :2] += tie_points.refine_by_mean_differences(orientation, noisy).xyz_mm[:, :2]
        places.append(xyz[:, :2].ravel())
    stated = refine_by_mean_differences(orientation, ties).sigma[:, :2].ravel()
    scatter = np.std(places, axis=0, ddof=1)
    # the head's pixel is taken for the synthetic one: 10 % at 8 degrees from the nadir
    assert_allclose(scatter, stated, rtol=0.2)


def test_heads_that_nothing_ties_stay_where_they_are(ties, orientation):
    none = ties[np.zeros(0, dtype=int)]
    assert overlaps(none, orientation) == []
    refined = refine_by_mean_differences(orientation, none)
    assert_allclose(refined.xyz_mm, orientation.xyz_mm, atol=0)
    assert_allclose(refined.cov_joint, orientation.cov_joint, atol=0)
