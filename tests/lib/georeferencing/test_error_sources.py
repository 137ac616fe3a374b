"""Joint tests of points that share errors, against closed forms and the dense covariance."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.observations import SharedErrors
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.georeferencing import error_sources
from acx4lib.georeferencing.error_sources import ErrorSources


@pytest.fixture(params=["white", "slow"])
def sources(request, rng):
    """Six points on four exposures, each on two or three of them, and five parameters."""
    point = np.repeat(np.arange(6), [2, 3, 2, 3, 2, 3])
    exposure = np.concatenate([np.sort(rng.permutation(4)[:k]) for k in (2, 3, 2, 3, 2, 3)])
    root = rng.normal(size=(6, 3, 3)) * 0.02 + 0.05 * np.eye(3)
    mix = np.linalg.qr(rng.normal(size=(5, 5)))[0] * rng.uniform(0.5, 1.5, 5)
    sigma = np.array([3e-3, 2e-2, 1e-7, 1e-12, 1e-4])
    sigma_body = np.array([0.05] * 3 + [1e-4] * 3)
    return ErrorSources(
        image=root @ np.swapaxes(root, 1, 2),
        survey=np.tile(np.diag([1e-4, 1e-4, 4e-4]), (6, 1, 1)),
        point=point,
        exposure=exposure,
        by_body=rng.normal(size=(15, 3, 6)) * [1, 1, 1, 1000, 1000, 1000],
        by_parameters=rng.normal(size=(6, 3, 5)) * 0.1 / sigma,
        cov_body=np.tile(np.diag(sigma_body**2), (4, 1, 1)),
        cov_parameters=sigma[:, None] * (mix @ mix.T) * sigma,
        shared=SHARED if request.param == "slow" else None,
    )


APART = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
SHARED = SharedErrors(
    roots=np.tile(0.9 * np.diag([0.05] * 3 + [1e-4] * 3), (4, 1, 1)),
    together=np.stack([np.exp(-APART / 5.0), np.exp(-APART / 2.0)]) * (APART > 0),
)


def dense(sources):
    """The joint covariance, assembled block by block."""
    n = len(sources)
    C = np.zeros((3 * n, 3 * n))
    J = sources.by_parameters
    for i in range(n):
        for j in range(n):
            block = J[i] @ sources.cov_parameters @ J[j].T + (i == j) * sources.own[i]
            for a in np.flatnonzero(sources.point == i):
                for b in np.flatnonzero(sources.point == j):
                    e, f = sources.exposure[[a, b]]
                    between = sources.cov_body[e] if e == f else np.zeros((6, 6))
                    if sources.shared is not None and e != f:
                        (between,) = sources.shared.between(e[None], f[None])
                    block += sources.by_body[a] @ between @ sources.by_body[b].T
            C[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = block
    return C


def test_chi_square_is_that_of_the_dense_covariance(sources, rng):
    C, d = dense(sources), rng.normal(size=(6, 3))
    assert error_sources.chi_square(sources, d) == pytest.approx(
        d.ravel() @ np.linalg.solve(C, d.ravel()), rel=1e-8
    )
    for i in range(6):
        assert_allclose(sources.cov[i], C[3 * i : 3 * i + 3, 3 * i : 3 * i + 3], rtol=1e-9)


def test_covariance_of_the_mean_is_that_of_the_dense_covariance(sources):
    average = np.tile(np.eye(3) / 6, 6)
    expected = average @ dense(sources) @ average.T
    assert_allclose(error_sources.mean_covariance(sources), expected, rtol=1e-9, atol=1e-12)


def test_the_joint_covariance_is_the_dense_one(sources):
    expected = dense(sources)
    scale = np.sqrt(np.diag(expected))
    joint = error_sources.joint_covariance(sources)
    assert_allclose(joint / scale / scale[:, None], expected / scale / scale[:, None], atol=1e-9)


def test_covariances_along_an_axis_are_parts_of_the_dense_covariance(sources):
    C, size = dense(sources), np.sqrt(np.diag(dense(sources)))
    for axis, among in enumerate(error_sources.axis_covariances(sources)):
        scale = np.outer(size[axis::3], size[axis::3])
        assert_allclose(among / scale, C[axis::3, axis::3] / scale, atol=1e-9)


def test_other_axes_change_no_chi_square(sources, rng):
    R, d = rotation_from_opk(rng.uniform(-3, 3, (6, 3))), rng.normal(size=(6, 3))
    turned = error_sources.turned(sources, R)
    there = np.einsum("nij,nj->ni", R, d)
    assert error_sources.chi_square(turned, there) == pytest.approx(
        error_sources.chi_square(sources, d), rel=1e-8
    )
    same = error_sources.turned(sources, np.tile(R[0], (6, 1, 1)))
    assert_allclose(
        error_sources.mean_covariance(same),
        R[0] @ error_sources.mean_covariance(sources) @ R[0].T,
        rtol=1e-9,
        atol=1e-12,
    )


def sharing_one_shift(n, *, own_m, shared_m):
    """Points of which each has its own error, and all have one shift in common."""
    return ErrorSources(
        image=np.tile(own_m**2 * np.eye(3), (n, 1, 1)),
        survey=np.zeros((n, 3, 3)),
        point=np.zeros(0, dtype=int),
        exposure=np.zeros(0, dtype=int),
        by_body=np.zeros((0, 3, 6)),
        by_parameters=np.tile(np.eye(3), (n, 1, 1)),
        cov_body=np.zeros((0, 6, 6)),
        cov_parameters=shared_m**2 * np.eye(3),
    )


def test_a_shift_that_all_points_share_does_not_average_out():
    """Variance of the mean: s^2 / n + S^2, not (s^2 + S^2) / n."""
    cov = error_sources.mean_covariance(sharing_one_shift(25, own_m=0.05, shared_m=0.10))
    assert_allclose(cov, (0.05**2 / 25 + 0.10**2) * np.eye(3), rtol=1e-12)


def test_chi_square_of_a_shared_shift_has_a_closed_form(rng):
    """Mean and scatter part: n m^2 / (s^2 + n S^2) + sum (d - m)^2 / s^2, each axis."""
    d, n, own, shared = rng.normal(size=(25, 3)), 25, 0.05, 0.10
    mean = d.mean(axis=0)
    expected = np.sum(n * mean**2 / (own**2 + n * shared**2))
    expected += np.sum((d - mean) ** 2) / own**2
    sources = sharing_one_shift(n, own_m=own, shared_m=shared)
    assert error_sources.chi_square(sources, d) == pytest.approx(expected, rel=1e-12)


def test_one_point_is_judged_by_its_own_covariance(sources, rng):
    one = replace(
        sources,
        image=sources.image[:1],
        survey=sources.survey[:1],
        point=sources.point[:2],
        exposure=sources.exposure[:2],
        by_body=sources.by_body[:2],
        by_parameters=sources.by_parameters[:1],
    )
    d = rng.normal(size=(1, 3))
    expected = d[0] @ np.linalg.solve(sources.cov[0], d[0])
    assert error_sources.chi_square(one, d) == pytest.approx(expected, rel=1e-9)
    assert_allclose(error_sources.mean_covariance(one), sources.cov[0], rtol=1e-9)


def test_given_cameras_and_no_points(sources, rng):
    d = rng.normal(size=(6, 3))
    none = replace(sources, by_parameters=np.zeros((6, 3, 0)), cov_parameters=np.zeros((0, 0)))
    C = dense(none)
    assert error_sources.chi_square(none, d) == pytest.approx(
        d.ravel() @ np.linalg.solve(C, d.ravel()), rel=1e-9
    )
    nothing = sharing_one_shift(0, own_m=0.05, shared_m=0.10)
    assert error_sources.chi_square(nothing, np.zeros((0, 3))) == 0.0
    assert np.isnan(error_sources.mean_covariance(nothing)).all()
