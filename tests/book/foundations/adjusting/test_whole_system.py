"""Against differences, and against the library's bundle, which eliminates the points."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.foundations import example
from acx4book.foundations.adjusting import whole_system
from acx4lib.calibration import mounting
from acx4lib.geometry.frames import log
from support.helpers import numeric_jacobian


@pytest.fixture(scope="module")
def fitted():
    return whole_system.adjusted(whole_system.start())


@pytest.fixture(scope="module")
def bundle():
    return mounting.single_step(example.block(), free=(), fix=("lever_arm",)).bundle


def test_rows_are_derivatives():
    state = whole_system.moved(whole_system.start((0.3, -0.2, 0.5)), np.full(33, 1e-6))
    A, _, _ = whole_system.equations(state)

    def computed(dx):
        return -whole_system.equations(whole_system.moved(state, dx))[1]

    assert_allclose(A, numeric_jacobian(computed, np.zeros(33), step=1e-5), atol=1e-5)


def test_rows_have_the_names_of_what_they_depend_on():
    A, _, _ = whole_system.equations(whole_system.start())
    names = whole_system.row_names()
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
    by_image = fit.redundancy[whole_system.IMAGE].reshape(4, 2, 2)
    assert_allclose(
        bundle.solution.group("image_point").redundancy,
        by_image[points.image_idx, points.point_idx],
        atol=1e-5,
    )


def test_a_start_far_away_ends_in_the_same_place(fitted):
    state, _ = whole_system.adjusted(whole_system.start((8.0, -6.0, 10.0)), steps=10)
    assert_allclose(state.R_b_c, fitted[0].R_b_c, atol=1e-10)
