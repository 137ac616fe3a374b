"""The worked example: by hand, by the library, and against what it was made with."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2

from acx4book.foundations import designs, example
from acx4book.foundations.designs import covariance, lines, planned
from acx4book.foundations.example import matrix
from acx4lib.calibration import mounting
from acx4lib.geometry.frames import Pose, exp, log
from acx4lib.model import Model

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
    step = mounting.single_step(example.block(), Model(fix=("lever_arm",)))
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


# --- The example on the map, against PROJ's own factors and against closed forms of each mistake


RADIUS = 6_371_000.0


@pytest.fixture(scope="module")
def right():
    return calibrated(example.placed())


def calibrated(block):
    """Return focal length, its sigma, and the boresight."""
    fit = mounting.single_step(block, Model(free=("f",), fix=("lever_arm",))).calibration
    camera = fit.cameras[0]
    return camera.interior.f, np.sqrt(fit.cov[0, 0]), camera.T_b_c.R


@pytest.mark.parametrize("height", [0.0, 900.0])
@pytest.mark.parametrize("east", [200_000.0, 500_000.0, 671_000.0])
def test_the_scale_is_that_of_the_projection_and_of_the_height(east, height):
    frame = example.frame(east_m=east)
    k = pyproj.Proj(example.CRS).get_factors(*frame.origin).meridional_scale
    lower = RADIUS / (RADIUS + height)  # the Earth's radius differs by 3e-3 at most
    assert_allclose(example.map_scale(frame, height), k * lower, atol=3e-3 * height / RADIUS + 1e-8)


def test_the_example_is_the_same_on_the_map_as_on_no_map(right):
    f, _, R = right
    local_f, _, local_R = calibrated(example.block())
    assert_allclose(f, local_f, rtol=1e-7)
    assert_allclose(R, local_R, atol=1e-7)


@pytest.mark.parametrize("east", [500_000.0, 830_000.0])
def test_map_coordinates_divide_the_focal_length_by_the_scale(east, right):
    block = example.placed(east_m=east)
    ground = example.GROUND_M + example.points()[:, 2].mean()
    s = example.map_scale(block.frame, ground)
    f = calibrated(example.in_map_coordinates(block))[0]
    assert_allclose(f - right[0], right[0] * (1 / s - 1), rtol=0.01)


def test_forgotten_convergence_goes_into_kappa(right):
    block = example.placed()
    f, sigma, R = calibrated(example.convergence_forgotten(block))
    factors = pyproj.Proj(example.CRS).get_factors(*block.frame.origin)
    turned = np.degrees(log(right[2].T @ R))
    # the images' tilts of 0.8 degrees let a hundredth of the angle go elsewhere
    assert_allclose(turned, [0, 0, factors.meridian_convergence], atol=0.01)
    assert abs(f - right[0]) < sigma


def test_a_forgotten_geoid_goes_into_the_focal_length(right):
    f, sigma, _ = calibrated(example.geoid_forgotten(example.placed(), 2.0))
    height = example.positions()[:, 2].mean() - example.points()[:, 2].mean()
    assert_allclose(f - right[0], right[0] * 2.0 / height, atol=sigma)


def test_a_vector_stands_upright_and_has_its_unit():
    text = matrix("a", [1.0, -0.0004], digits=2, unit="mm").data
    assert text == r"$$a = \begin{pmatrix} 1.00 \\ 0.00 \end{pmatrix}\ \mathrm{mm}$$"


def test_a_matrix_has_its_rows():
    assert r"\begin{pmatrix} 1 & 0 \\ 0 & 1 \end{pmatrix}" in matrix("E", np.eye(2), digits=0).data


# --- Planned flights: their standard deviations against simulation and against closed forms


def errors_drawn(block, rng):
    """Return a planned block with the errors that its standard deviations state."""
    seen, flown, control = block.image_points, block.trajectory, block.control
    turned = rng.normal(size=(len(flown), 3)) * flown.sigma_attitude
    moved = rng.normal(size=(len(flown), 3)) * flown.sigma_position
    T_m_b = Pose(R=flown.T_m_b.R @ exp(turned), r=flown.T_m_b.r + moved)
    noise = rng.normal(size=seen.colrow.shape) * seen.sigma_px[:, None]
    surveyed = control.x_m + rng.normal(size=control.x_m.shape) * control.sigma_m
    return replace(
        block,
        image_points=replace(seen, colrow=seen.colrow + noise),
        trajectory=replace(flown, T_m_b=T_m_b),
        control=replace(control, x_m=surveyed),
    )


@pytest.mark.slow
def test_planned_standard_deviations_are_those_of_simulated_flights():
    block = planned(lines(90, 270) + lines(90, 270, height_m=900.0))
    cov = covariance(block, free=["f"]).to_numpy()
    truth = np.array([example.F_MM, *example.LEVER_ARM_M, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(1)
    n, square = 40, 0.0
    for _ in range(n):
        camera = mounting.single_step(
            errors_drawn(block, rng), Model(free=["f"])
        ).calibration.cameras[0]
        opk = np.degrees(camera.T_b_c.opk)
        d = np.array([camera.interior.f, *camera.T_b_c.r, *opk]) - truth
        square += d @ np.linalg.solve(cov, d)
    dof = 7 * n
    assert abs(square / dof - 1) < 4 * np.sqrt(2 / dof)


def test_the_shift_of_gnss_has_a_closed_form_far_from_all_else():
    """All images shifted alike against control: sigma is that of means, in quadrature."""
    block = planned(lines(90, 270, 90, 270, 90, 270))
    cov = covariance(block, fix=["lever_arm", "boresight"], gnss=["shift"])
    height, n = 500.0, len(block.images)
    gnss = example.SIGMA_POSITION_M[0] / np.sqrt(n)
    control = example.SIGMA_CONTROL_M[0] / np.sqrt(5)
    attitude = height * np.radians(example.SIGMA_ATTITUDE_DEG[0]) / np.sqrt(n)
    least, most = np.hypot(gnss, control), np.sqrt(gnss**2 + control**2 + attitude**2)
    assert least < np.sqrt(cov.loc["GNSS east, m", "GNSS east, m"]) < 1.1 * most


def test_without_control_the_lever_arm_is_open_in_height():
    table = designs.sigmas({"none": covariance(planned(lines(90, 270), control=0))})
    assert np.isinf(table.loc["lever z, m", "none"])
    assert np.isfinite(table.drop("lever z, m").to_numpy()).all()
    assert designs.written(table).loc["lever z, m", "none"] == "open"


def test_every_fifth_of_a_footprint_there_is_an_image():
    line = designs.Line(azimuth_deg=90.0, height_m=750.0)
    footprint = example.WIDTH_PX * example.PIXEL_MM * line.height_m / example.F_MM
    assert_allclose(line.base_m, footprint / 5)
    T_m_b = planned([line]).trajectory.T_m_b
    assert_allclose(np.diff(T_m_b.r[:, 0]), line.base_m)
    assert_allclose(T_m_b.R, np.tile(np.eye(3), (5, 1, 1)), atol=1e-12)  # nose to the east


def test_correlations_have_the_names_of_their_covariance():
    cov = pd.DataFrame([[4.0, 3.0], [3.0, 9.0]], ["a", "b"], ["a", "b"])
    assert_allclose(designs.correlations(cov).loc["a", "b"], 0.5)
