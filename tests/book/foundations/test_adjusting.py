"""Against differences, and against the library's bundle, which eliminates the points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from acx4book.foundations import adjusting, example
from acx4book.foundations.adjusting import fit
from acx4lib.calibration import mounting
from acx4lib.geometry import collinearity, intersection
from acx4lib.geometry.camera import Interior, colrow_from_xy
from acx4lib.geometry.frames import Pose, exp, log, rotation_from_opk
from acx4lib.model import Model
from support.helpers import numeric_jacobian


@pytest.fixture(scope="module")
def fitted():
    return adjusting.adjusted(adjusting.start())


@pytest.fixture(scope="module")
def bundle():
    return mounting.single_step(example.block(), Model(fix=("lever_arm",))).bundle


def moved(state, dx):
    """A state after a small step; rotations turn about the turned axes."""
    pose = dx[3:27].reshape(4, 6)
    turned = np.array([R @ exp(turn) for R, turn in zip(state.T_m_b.R, pose[:, 3:], strict=True)])
    return replace(
        state,
        R_b_c=state.R_b_c @ exp(dx[:3]),
        T_m_b=Pose(R=turned, r=state.T_m_b.r + pose[:, :3]),
        x_m=state.x_m + dx[27:].reshape(2, 3),
    )


def test_rows_are_derivatives():
    state = moved(adjusting.start((0.3, -0.2, 0.5)), np.full(33, 1e-6))
    A, _, _ = adjusting.equations(state)

    def computed(dx):
        return -adjusting.equations(moved(state, dx))[1]

    assert_allclose(A, numeric_jacobian(computed, np.zeros(33), step=1e-5), atol=1e-5)


def test_rows_have_the_names_of_what_they_depend_on():
    A, _, _ = adjusting.equations(adjusting.start())
    names = adjusting.row_names()
    pose_of = {image: 3 + 6 * i for i, image in enumerate(example.EXPOSURES["image"])}
    for name, row in zip(names, A, strict=True):
        for image, column in pose_of.items():
            assert (image in name.split()) == bool(row[column : column + 6].any())
    assert [names[k] for k in (5, 17, 28, 45)] == [
        "y of P in A2", "north of A1", "turn of A1 about x", "height of Q"]  # fmt: skip


def test_the_library_s_bundle_has_the_same_solution(fitted, bundle):
    state, fits = fitted
    boresight = bundle.cameras[0].T_b_c.R
    assert_allclose(log(boresight.T @ state.R_b_c), 0.0, atol=1e-9)
    assert_allclose(bundle.state.T_m_b.r, state.T_m_b.r, atol=1e-6)
    assert_allclose(bundle.state.x_m, state.x_m, atol=1e-6)
    assert_allclose(bundle.solution.cost, fits[-1].square, rtol=1e-6)
    assert bundle.solution.redundancy == fits[-1].degrees == 13


def test_so_are_covariances_and_redundancy_numbers(fitted, bundle):
    fit = fitted[1][-1]
    sigma = np.sqrt(fit.cov.diagonal()[:27])
    scaled = (bundle.solution.cov - fit.cov[:27, :27]) / np.outer(sigma, sigma)
    assert_allclose(scaled, 0.0, atol=1e-4)
    for k, own in enumerate(bundle.solution.cov_points):
        points = slice(27 + 3 * k, 30 + 3 * k)
        assert_allclose(own, fit.cov[points, points], atol=1e-7)
    points = bundle.network.image_points
    by_image = fit.redundancy[adjusting.IMAGE].reshape(4, 2, 2)
    assert_allclose(
        bundle.solution.group("image_point").redundancy,
        by_image[points.image_idx, points.point_idx],
        atol=1e-5,
    )


def test_a_start_far_away_ends_in_the_same_place(fitted):
    state, _ = adjusting.adjusted(adjusting.start((8.0, -6.0, 10.0)), steps=10)
    assert_allclose(state.R_b_c, fitted[0].R_b_c, atol=1e-10)


# --- Against differences of the library's projection, closed forms, and the system not reduced


FOUR_WAYS = [adjusting.view(opk) for opk in ((20, 0, 0), (-20, 0, 0), (0, 20, 0), (0, -20, 0))]


def test_columns_are_derivatives():
    opk = (12.0, -5.0, 30.0)
    view, camera = adjusting.view(opk, relief_m=40.0), example.camera()
    R = rotation_from_opk(np.radians(opk))
    ray = np.column_stack([view.xy, np.full(35, -example.F_MM)]) @ R.T
    x_m = ray * ((40.0 * np.cos(np.arange(35) * 2.4) - 480.0) / ray[:, 2])[:, None]

    def projected(values):
        f, xp, yp = values[:3]
        changed = replace(camera, interior=Interior(f=50.0 + f, xp=xp, yp=yp))
        T = Pose(R=(R @ exp(values[6:]))[None], r=values[None, 3:6])
        return ((collinearity.project(changed, T, x_m)) * [0.01, -0.01]).ravel()

    assert_allclose(collinearity.project(camera, Pose(R=R[None], r=np.zeros((1, 3))), x_m),
                    colrow_from_xy(camera, view.xy), atol=1e-9)  # fmt: skip
    numeric = numeric_jacobian(projected, np.zeros(9), step=1e-5)
    assert_allclose(np.hstack([view.by_camera, view.by_pose]), numeric, atol=1e-5)


def test_over_flat_ground_a_vertical_image_says_nothing_of_its_camera():
    flat = adjusting.view((0.0, 0.0, 60.0))
    assert_allclose(flat.left[:, 0], 0.0, atol=1e-9)
    assert np.isinf(adjusting.sigma_camera([flat] * 4)).all()


def test_the_focal_length_is_then_as_good_as_the_observed_height():
    # f / h is known, so sigma_f = f sigma_Z / h where the noise of the images is small beside it
    sigma = adjusting.sigma_camera(
        [adjusting.view((0.0, 0.0, 0.0))], sigma_position=(0.03, 0.03, 5.0)
    )
    assert_allclose(sigma[0], 50.0 * 5.0 / 480.0, rtol=1e-2)


def test_tilts_must_have_more_than_one_direction_in_the_image():
    assert np.isinf(adjusting.sigma_camera([adjusting.view((0.0, 20.0, 0.0))] * 4)).all()
    crossing = [adjusting.view((20.0, 0.0, kappa)) for kappa in (0.0, 90.0, 180.0, 270.0)]
    assert_allclose(adjusting.sigma_camera(crossing), adjusting.sigma_camera(FOUR_WAYS), rtol=1e-6)


@pytest.mark.parametrize("sigma_position", [None, (0.03, 0.03, 0.05)])
def test_sigma_is_that_of_the_whole_system(sigma_position):
    A = np.zeros((4 * 70, 3 + 24))
    for i, view in enumerate(FOUR_WAYS):
        rows = slice(70 * i, 70 * i + 70)
        A[rows, :3], A[rows, 3 + 6 * i : 9 + 6 * i] = view.by_camera, view.by_pose
    N = A.T @ A / example.SIGMA_IMAGE_MM**2
    for i in range(4 if sigma_position else 0):
        at = 3 + 6 * i + np.arange(3)
        N[at, at] += 1 / np.square(sigma_position)
    expected = np.sqrt(np.linalg.inv(N).diagonal()[:3])
    assert_allclose(
        adjusting.sigma_camera(FOUR_WAYS, sigma_position=sigma_position), expected, rtol=1e-6
    )


# --- Against differences, against the library's intersection, and against what was surveyed


@pytest.mark.parametrize("k", [0, 1])
def test_rows_are_the_derivatives_of_the_library_s_projection(k):
    T, x_m = adjusting.cameras(), example.points()[k]

    def projected(x):
        colrow = collinearity.project(example.camera(), T, np.tile(x, (4, 1)))
        return (colrow * [0.01, -0.01] + [-19.995, 14.995]).ravel()

    A, misfit = adjusting.linearised(T, example.measured()[:, k], x_m)
    assert_allclose(A, numeric_jacobian(projected, x_m, step=1e-3), atol=1e-8)
    assert_allclose(misfit, example.measured()[:, k].ravel() - projected(x_m), atol=1e-12)


def test_points_lie_where_the_rays_pass_and_where_they_were_surveyed():
    T = adjusting.cameras()
    for k, surveyed in enumerate(example.points()):
        x_m, step = adjusting.intersected(T, example.measured()[:, k])
        xy = np.column_stack([example.measured()[:, k], np.full(4, -example.F_MM)])
        ray = np.einsum("nij,nj->ni", T.R, xy / np.linalg.norm(xy, axis=1, keepdims=True))
        nearest = intersection.intersect(T.r, ray, np.zeros(4, dtype=int), 1)[0]
        assert_allclose(x_m, nearest, atol=0.02)  # another measure of nearness
        assert_allclose(step.dx, 0.0, atol=1e-9)
        cov = step.cov + np.diag(np.square([0.03, 0.03, 0.05]))  # and that of the positions
        d = x_m - surveyed
        assert chi2.cdf(d @ np.linalg.solve(cov, d), 3) < 0.99


# --- Against closed forms: the mean, the straight line, and numpy's own least squares


def test_a_mean_is_weighted_by_the_inverse_squares_of_sigma():
    mean = fit(np.ones((2, 1)), np.array([1.0, 4.0]), np.array([1.0, 2.0]))
    assert_allclose(mean.dx, [(1.0 + 4.0 / 4) / 1.25])
    assert_allclose(mean.cov, [[1 / 1.25]])
    assert_allclose(mean.redundancy, [1 - 1 / 1.25, 1 - 0.25 / 1.25])
    assert_allclose(mean.square, 3.0**2 / (1.0 + 4.0))  # the difference over its own variance


def test_a_straight_line_has_its_textbook_covariance():
    t = np.array([1.0, 2.0, 4.0, 7.0])
    line = fit(np.column_stack([np.ones(4), t]), 3.0 - 0.5 * t, 0.1)
    assert_allclose(line.dx, [3.0, -0.5])
    assert_allclose(line.cov[1, 1], 0.1**2 / np.sum((t - t.mean()) ** 2))
    assert_allclose(line.cov[0, 1], -t.mean() * line.cov[1, 1])


def test_redundancy_numbers_add_up_and_w_is_standard_normal():
    rng = np.random.default_rng(4)
    A, sigma = rng.normal(size=(12, 4)), rng.uniform(0.5, 2.0, 12)
    fits = [fit(A, sigma * rng.normal(size=12), sigma) for _ in range(4000)]
    assert_allclose(fits[0].redundancy.sum(), fits[0].degrees)
    w = np.array([each.w for each in fits])
    assert_allclose(w.std(axis=0), 1.0, atol=4 / np.sqrt(2 * 4000))
    assert_allclose(np.mean([each.square for each in fits]), 8.0, atol=4 * np.sqrt(16 / 4000))
    dx = np.linalg.lstsq(A / sigma[:, None], np.ones(12) / sigma, rcond=None)[0]
    assert_allclose(fit(A, np.ones(12), sigma).dx, dx)


# --- Against counting, in code that multiplies one number at a time


def counted_cholesky(N, width):
    """Factor a banded matrix in place; return the factor and the multiplications."""
    L, n, count = np.tril(N), len(N), 0
    for j in range(n):
        for i in range(j, min(j + width + 1, n)):
            for k in range(max(0, i - width), j):
                L[i, j] -= L[i, k] * L[j, k]
                count += 1
            if i == j:
                L[j, j] = np.sqrt(L[j, j])
            else:
                L[i, j] /= L[j, j]
                count += 1
    return L, count


@pytest.mark.parametrize(("n", "width"), [(1, 0), (3, 2), (9, 8), (12, 0), (12, 4), (5, 3)])
def test_multiplications_of_cholesky(n, width):
    rng = np.random.default_rng(n)
    N = np.eye(n) * 50 + sum(np.diag(rng.normal(size=n - k), k) for k in range(width + 1))
    N = (N + N.T) / 2
    L, count = counted_cholesky(N.copy(), width)
    np.testing.assert_allclose(L, np.linalg.cholesky(N), atol=1e-12)
    assert adjusting.banded_cholesky(n, width) == count


def test_elimination_of_one_point_seen_by_four_images():
    columns = 3 + 4 * 6
    solved = sum(1 for _ in range(columns) for i in range(3) for _ in range(i + 1))
    products = sum(1 for i in range(columns) for _ in range(i + 1) for _ in range(3))
    expected = adjusting.banded_cholesky(3, 2) + solved + products
    assert adjusting.elimination(1, 4, n_shared=3) == expected
    assert adjusting.reduced(4, 2, 4, n_shared=3) == 2 * expected + adjusting.banded_cholesky(
        27, 26
    )


def test_the_whole_example_has_33_unknowns():
    assert adjusting.whole(4, 2, n_shared=3) == adjusting.banded_cholesky(33, 32)
