"""The worked example: by hand, by the library, and against what it was made with."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from acx4book.foundations import example
from acx4lib.calibration import mounting

TRUE = np.radians([example.TRUTH[f"{name}_deg"] for name in ("omega", "phi", "kappa")])


def axes_turned(omega, phi, kappa):
    """Write out eq. (6): object to image."""
    (so, co), (sp, cp), (sk, ck) = ((np.sin(a), np.cos(a)) for a in (omega, phi, kappa))
    return np.array(
        [
            [cp * ck, co * sk + so * sp * ck, so * sk - co * sp * ck],
            [-cp * sk, co * ck - so * sp * sk, so * ck + co * sp * sk],
            [sp, -so * cp, co * cp],
        ]
    )


def images(values):
    """Project: boresight 3, errors of positions 4 x 3, attitudes 4 x 3 and points 2 x 3."""
    boresight, of_body, turned, of_points = np.split(values, [3, 15, 27])
    out = []
    for i, angles in enumerate(example.attitudes()):
        a = turned[3 * i : 3 * i + 3]
        small = np.array([[1, a[2], -a[1]], [-a[2], 1, a[0]], [a[1], -a[0], 1]])
        to_body = small @ axes_turned(*angles)
        at = example.positions()[i] + of_body[3 * i : 3 * i + 3]
        for x_m in example.points() + of_points.reshape(2, 3):
            d = axes_turned(*boresight) @ (to_body @ (x_m - at) - example.LEVER_ARM_M)
            out += [-example.F_MM * d[0] / d[2], -example.F_MM * d[1] / d[2]]
    return np.array(out)


def weighted(boresight):
    """Return Jacobian, inverse covariance and misclosures at a boresight, all by differences."""
    values = np.r_[boresight, np.zeros(30)]
    step = 1e-6 * np.eye(33)
    jacobian = np.array([(images(values + e) - images(values - e)) / 2e-6 for e in step]).T
    sigma = np.r_[
        np.tile(example.SIGMA_POSITION_M, 4),
        np.radians(np.tile(example.SIGMA_ATTITUDE_DEG, 4)),
        np.tile(example.SIGMA_CONTROL_M, 2),
    ]
    of_given = jacobian[:, 3:] * sigma
    cov = of_given @ of_given.T + np.eye(16) * example.SIGMA_IMAGE_MM**2
    return jacobian[:, :3], np.linalg.inv(cov), example.measured().ravel() - images(values)


@pytest.fixture(scope="module")
def by_hand():
    """Return boresight, its covariance, and the weighted sum of squares."""
    boresight = np.zeros(3)
    for _ in range(4):
        A, W, v = weighted(boresight)
        boresight = boresight + np.linalg.solve(A.T @ W @ A, A.T @ W @ v)
    A, W, v = weighted(boresight)
    return boresight, np.linalg.inv(A.T @ W @ A), v @ W @ v


def test_the_library_calibrates_it_as_it_is_done_by_hand(by_hand):
    boresight, cov, square = by_hand
    step = mounting.single_step(example.block(), free=(), fix=("lever_arm",))
    R = step.calibration.cameras[0].T_b_c.R
    assert_allclose(R, axes_turned(*boresight).T, atol=1e-7)  # a fiftieth of the last digit given
    assert_allclose(step.calibration.cov, cov, rtol=2e-2, atol=1e-11)
    assert_allclose(step.calibration.sigma0_sq, square / 13, rtol=1e-3)


def test_its_errors_are_those_that_sigma_allows(by_hand):
    boresight, cov, square = by_hand
    d = boresight - TRUE
    assert chi2.cdf(d @ np.linalg.solve(cov, d), 3) < 0.99
    assert 0.005 < chi2.cdf(square, 13) < 0.995


def test_the_tables_belong_together():
    assert list(example.MEASURED["image"].unique()) == list(example.EXPOSURES["image"])
    assert set(example.MEASURED["point"]) == set(example.CONTROL["point"])
    assert example.block().image_points.colrow[0] == pytest.approx([2691.5, 869.7])
