"""Two campaigns of one simulated camera, the same in both, each adjusted for itself."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, stats

import acx4sim
from acx4book import campaigns
from acx4book.campaigns import Campaign, compare, ground_of, joint_test, on_ground, pooled
from acx4files import flight
from acx4lib.calibration.estimates import parameters, reported_covariance, with_reported
from acx4lib.calibration.mounting import single_step
from acx4lib.design import flying_heights
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.least_squares.covariance import sigmas
from acx4lib.model import Model
from acx4sim.designs import single_head_plan
from acx4sim.files import simulate_plan
from support.changed_notebook import changed
from support.flights.simulated import read_back
from support.run_results import leave_results

TIES = {"calibration": 120}


@cache
def flown(seed, *, f_um=0.0, free=()):
    """Fly and adjust a campaign; the true focal length is longer by some micrometres."""
    plan = single_head_plan()
    camera = plan.cameras["CAM"]
    longer = {"CAM": replace(camera, f_mm=camera.f_mm + f_um / 1000)}
    options = acx4sim.Options(blocks=("calibration",), tie_points=TIES)
    flight = read_back(simulate_plan(replace(plan, cameras=longer), seed, options)).flight
    return single_step(flight.calibration, Model(free=free or flight.estimate_mounting))


def of_mounting(mounting, name):
    block = mounting.bundle.network.block
    return Campaign(
        name=name,
        method=mounting.method,
        calibration=mounting.calibration,
        redundancy=mounting.bundle.solution.redundancy,
        height_m=float(np.median(flying_heights(block))),
    )


def one(seed, **changes):
    return of_mounting(flown(seed, **changes), f"campaign {seed}")


# --- Campaigns side by side: levels, planted changes, and campaigns that cannot be compared


@pytest.fixture
def two():
    return compare(one(1), one(2))


@pytest.mark.slow
def test_chi_squares_of_campaigns_of_the_same_camera_are_of_their_distribution():
    pairs = [compare(one(seed), one(seed + 1)) for seed in range(1, 17, 2)]
    low, high = stats.chi2.ppf([0.0005, 0.9995], 8 * 14)
    assert low < sum(pair.test().chi_square for pair in pairs) < high
    t = np.concatenate([pair.d / sigmas(pair.cov) for pair in pairs])
    rejected = int(np.sum(np.abs(t) > stats.norm.isf(0.025)))
    assert stats.binom.ppf(0.0005, len(t), 0.05) <= rejected
    assert rejected <= stats.binom.ppf(0.9995, len(t), 0.05) + 8  # parameters are correlated


@pytest.mark.repeats
def test_levels_hold_over_many_pairs():
    p = np.array([compare(one(seed), one(seed + 1)).test().p for seed in range(101, 221, 2)])
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    for level in (0.05, 0.2):
        low, high = stats.binom.ppf([0.0005, 0.9995], len(p), level)
        assert low <= np.sum(p < level) <= high


def test_a_longer_focal_length_is_found():
    found = compare(one(1), one(2, f_um=15.0))
    i = [p.name for p in found.parameters].index("f_mm")
    assert abs(found.d[i] - 0.015) < 4 * sigmas(found.cov)[i]
    assert found.test().p < 1e-6
    p = campaigns.tests(found, ground_of(found)).set_index("part")["p"]
    assert p["interior orientation"] < 1e-3
    assert min(p["lever arm"], p["boresight"]) > 1e-3


def test_angles_do_not_jump():
    found = compare(with_kappa(one(1), 179.99), with_kappa(one(2), -179.99))
    i = [p.name for p in found.parameters].index("boresight_kappa_deg")
    assert_allclose(found.values[:, i], [179.99, 180.01])  # noqa: PD011 of a comparison


def with_kappa(campaign, kappa_deg):
    camera = with_reported(campaign.calibration.cameras[0], {"boresight_kappa_deg": kappa_deg})
    return replace(campaign, calibration=replace(campaign.calibration, cameras=(camera,)))


def with_camera(campaign, **changes):
    cameras = (replace(campaign.calibration.cameras[0], **changes),)
    return replace(campaign, calibration=replace(campaign.calibration, cameras=cameras))


def nothing(campaign):
    calibration = campaign.calibration
    none = np.ones(calibration.n_columns, dtype=bool)
    return replace(campaign, calibration=replace(calibration, open_columns=none))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: replace(c, flight="ab"), "are results of the same flight"),
        (lambda c: replace(c, frame_deg=(0.0, 0.0, float(c.name[-1]))), "another frame of synth"),
        (
            lambda c: with_camera(c, width_px=4000 + int(c.name[-1])),
            r"CAM is not the same camera: \(4001, 8708, 0.0046\) is not \(4002",
        ),
        (lambda c: with_camera(c, name=c.name), "no parameter of a camera of the same name"),
        (nothing, "no parameter of a camera of the same name was determined by both"),
    ],
)
def test_what_cannot_be_compared_is_refused(change, says):
    with pytest.raises(FlightError, match=f"campaign 1 and campaign 2.*{says}"):
        compare(change(one(1)), change(one(2)))


# --- What parameters move on the ground: closed forms of a camera that looks straight down


HEIGHT, F = 800.0, 50.0
NAMES = (
    *("f_mm", "xp_mm", "yp_mm", "k1", "lever_x_m", "lever_y_m", "lever_z_m"),
    *("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg"),
)
CAMERA = Camera(name="CAM", width_px=6001, height_px=4001, pixel_mm=0.005, interior=Interior(f=F))


@pytest.fixture(scope="module")
def effects():
    return on_ground(CAMERA, NAMES, np.full(len(NAMES), 1e-6), height_m=HEIGHT)


def test_nodes_lie_where_their_rays_meet_the_ground(effects):
    xy, J = effects
    assert len(xy) == len(J) == 15**2
    corner = 0.005 * np.array([3000.0, 2000.0])
    assert_allclose(xy.max(axis=0), HEIGHT / F * corner)
    assert_allclose(xy.min(axis=0), -HEIGHT / F * corner)


def test_derivatives_are_those_of_the_pinhole(effects):
    x, y = F / HEIGHT * effects[0].T
    zero, one, scale = np.zeros_like(x), np.ones_like(x), HEIGHT / F
    degree = np.radians(1) * HEIGHT
    r2 = x**2 + y**2
    expected = {
        "f_mm": (-scale * x / F, -scale * y / F),
        "xp_mm": (-scale * one, zero),
        "yp_mm": (zero, -scale * one),
        "lever_x_m": (one, zero),
        "lever_y_m": (zero, one),
        "lever_z_m": (x / F, y / F),
        "boresight_omega_deg": (degree * x * y / F**2, degree * (1 + y**2 / F**2)),
        "boresight_phi_deg": (-degree * (1 + x**2 / F**2), -degree * x * y / F**2),
        "boresight_kappa_deg": (-degree * y / F, degree * x / F),
    }
    for name, (forward, left) in expected.items():
        J = effects[1][:, :, NAMES.index(name)]
        assert_allclose(J, np.column_stack([forward, left]), rtol=1e-5, atol=1e-6, err_msg=name)
    radial = effects[1][:, :, NAMES.index("k1")]
    assert_allclose(
        np.abs(radial), scale * np.abs(np.column_stack([x, y])) * r2[:, None], rtol=1e-4, atol=1e-2
    )


def test_what_correlates_may_cancel_on_the_ground(effects):
    d = np.zeros(len(NAMES))
    d[0], d[6] = 0.1, 0.1 * HEIGHT / F  # a longer focal length, and a higher camera
    assert np.abs(effects[1] @ d).max() < 1e-6 < np.abs(effects[1] * d).max()


# --- A campaign as it is read from results, and folders that have none


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return leave_results(tmp_path_factory.mktemp("campaign"))


def test_what_is_read_is_what_was_adjusted(made):
    found, flown = campaigns.read(made[1]), flight.read(made[0])
    again = of_mounting(
        single_step(flown.calibration, Model(free=flown.estimate_mounting)), "results"
    )
    assert (found.name, found.method, found.redundancy) == (
        "results",
        "single_step",
        again.redundancy,
    )
    for own, other in zip(
        parameters(found.calibration), parameters(again.calibration), strict=True
    ):
        assert (own.name, own.unit) == (other.name, other.unit)
        assert_allclose([own.value, own.sigma], [other.value, other.sigma], rtol=1e-9)
    covs = (reported_covariance(c.calibration) for c in (found, again))
    assert_allclose(*covs, rtol=1e-6, atol=1e-30)
    assert_allclose(found.height_m, again.height_m)
    assert found.flight
    assert campaigns.read(made[1], method="two_step").method == "two_step"


# --- Vectors with known covariances: closed forms, SciPy, and dense least squares


SCALES = np.array([1e-3, 1e-8, 1e-14, 0.02])
"""Of standard deviations of a focal length, of k1, of k3, of a lever arm."""


def covariances(rng, n, k=4):
    """Strongly correlated matrices whose units differ by many powers of ten."""
    out = []
    for _ in range(n):
        A = rng.standard_normal((k, 6)) + 3 * rng.standard_normal((1, 6))
        out.append(A @ A.T * SCALES[:k, None] * SCALES[:k])
    return np.array(out)


def test_of_independent_components_chi_square_is_a_sum_of_squares():
    d, sigma = np.array([1.0, -2.0, 0.5]), np.array([1.0, 4.0, 0.5])
    found = joint_test(d, np.diag(sigma**2))
    assert_allclose(found.chi_square, 1.0 + 0.25 + 1.0)
    assert found.dof == 3
    assert_allclose(found.p, stats.chi2.sf(2.25, 3))


def test_with_an_estimated_variance_factor_it_is_fishers(rng):
    d, cov = 10 * SCALES * [1, -1, 1, 1], covariances(rng, 1)[0]
    found = joint_test(d, cov, redundancy=20)
    whitened = linalg.solve_triangular(
        linalg.cholesky(cov / SCALES[:, None] / SCALES, lower=True), d / SCALES, lower=True
    )
    assert_allclose(found.chi_square, whitened @ whitened, rtol=1e-6)
    assert_allclose(found.p, stats.f.sf(found.chi_square / 4, 4, 20))
    assert found.p > joint_test(d, cov).p


def test_the_mean_of_independent_values_is_weighted():
    values, sigma = np.array([[5.0], [8.0], [6.0]]), np.array([1.0, 2.0, 0.5])
    mean, cov = pooled(values, (sigma**2)[:, None, None])
    weight = sigma**-2
    assert_allclose(mean, [weight @ values[:, 0] / weight.sum()])
    assert_allclose(cov.ravel(), 1 / weight.sum())


def test_with_full_covariances_it_is_dense_least_squares(rng):
    n, k = 5, 4
    covs = covariances(rng, n)
    values = rng.standard_normal((n, k)) * SCALES
    mean, cov = pooled(values, covs)
    half = [np.linalg.inv(np.linalg.cholesky(C / SCALES[:, None] / SCALES)) for C in covs]
    A = np.concatenate(half)
    b = np.concatenate([H @ (v / SCALES) for H, v in zip(half, values, strict=True)])
    assert_allclose(mean, np.linalg.lstsq(A, b, rcond=None)[0] * SCALES, rtol=1e-6)
    wanted = np.linalg.inv(A.T @ A) * SCALES[:, None] * SCALES
    assert_allclose(cov, wanted, rtol=1e-5, atol=0)


def test_levels_hold_where_the_variance_factor_is_estimated_from_little(rng):
    n, r, k = 4000, 12, 3
    d = rng.standard_normal((n, k))
    s0_sq = rng.chisquare(r, n) / r
    p = [joint_test(x, s * np.eye(k), redundancy=r).p for x, s in zip(d, s0_sq, strict=True)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3


# --- the tables, whose numbers must agree with each other, and the notebook


@pytest.fixture
def tables(two):
    ground = ground_of(two, height_m=1000.0)
    return campaigns.tests(two, ground), campaigns.differences(two, ground)


def test_what_pooled_values_leave_of_both_is_the_joint_test(two, tables):
    differences = tables[1]
    assert np.all(differences["pooled_sigma"] < sigmas(two.covs).min(axis=0))
    left = 0.0
    for x, cov in zip(two.values, two.covs, strict=True):
        s = sigmas(cov)
        v = (x - differences["pooled"].to_numpy()) / s
        left += v @ np.linalg.solve(cov / np.outer(s, s), v)
    assert_allclose(left, two.test().chi_square, rtol=1e-6)


def test_what_a_focal_length_moves_on_the_ground_grows_with_the_height(two):
    low, high = (
        campaigns.differences(two, ground_of(two, height_m=h))["ground_rms_m"].to_numpy()
        for h in (500.0, 1000.0)
    )
    of_lever = np.array([p.name.startswith("lever") for p in two.parameters])
    assert_allclose(high[of_lever], low[of_lever], rtol=1e-4)
    assert_allclose(high[~of_lever], 2 * low[~of_lever], rtol=2e-3)


def test_the_notebook_compares_two_folders(made, tmp_path):
    other = leave_results(tmp_path, seed=3)[1]
    names = changed("compare", results_a=made[1], results_b=other)
    found = compare(campaigns.read(made[1]), campaigns.read(other))
    pd.testing.assert_frame_equal(names["tests"], campaigns.tests(found, ground_of(found)))
