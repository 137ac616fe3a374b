"""Campaigns of one simulated camera, the same in all of them, each adjusted for itself."""

import datetime as dt
import json
import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, stats

import acx4sim
from acx4lib import flight
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters, reported_covariance, with_reported
from acx4lib.calibration.mounting import single_step
from acx4lib.calibration.stability import FTest, Rigidity
from acx4lib.errors import FlightError
from acx4lib.flight.settings import Session
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.least_squares.covariance import sigmas
from acx4lib.least_squares.statistics import holm
from acx4lib.results.own_folder import MARK
from acx4sim.designs import single_head_plan
from acx4sim.files import simulate_plan
from acx4tools import campaigns as acx4tools_campaigns
from acx4tools.campaigns import (
    JointTest,
    compare,
    difference,
    differences,
    fit,
    ground_effects,
    ground_of,
    joint_test,
    same_values,
)
from support.flights.simulated import read_back
from support.run_results import leave_results

TIES = {"calibration": 120}


@cache
def flown(seed, *, f_um=0.0, free=()):
    """Fly and adjust a campaign; the true focal length is longer by some micrometres."""
    plan = single_head_plan()
    camera = plan.cameras["CAM"]
    changed = {"CAM": replace(camera, f_mm=camera.f_mm + f_um / 1000)}
    options = acx4sim.Options(blocks=("calibration",), tie_points=TIES)
    flight = read_back(simulate_plan(replace(plan, cameras=changed), seed, options)).flight
    return single_step(flight.calibration, free=free or flight.estimate_mounting)


def one(seed, *, name="", date=None, temperature_c=float("nan"), **changes):
    session = Session(date=date, temperature_c=temperature_c)
    return acx4tools_campaigns.of_mounting(
        flown(seed, **changes), name=name or f"campaign {seed}", session=session
    )


@pytest.fixture
def fly():
    return one


# --- Campaigns side by side: levels, planted changes, and campaigns that cannot be compared


@pytest.fixture
def three(fly):
    return compare([fly(seed) for seed in (1, 2, 3)])


@pytest.mark.slow
def test_chi_squares_of_campaigns_of_the_same_camera_are_of_their_distribution(fly):
    campaigns = [fly(seed) for seed in range(1, 17)]
    whole = acx4tools_campaigns.stability(compare(campaigns))
    assert whole.dof == 15 * 14
    low, high = stats.chi2.ppf([0.0005, 0.9995], whole.dof)
    assert low < whole.chi_square < high
    pairs = [difference(compare(campaigns[i : i + 2]), 0, 1) for i in range(0, 16, 2)]
    total = sum(one.test().chi_square for one in pairs)
    low, high = stats.chi2.ppf([0.0005, 0.9995], 8 * 14)
    assert low < total < high
    t = np.concatenate([one.d / one.sigma for one in pairs])
    rejected = int(np.sum(np.abs(t) > stats.norm.isf(0.025)))
    assert stats.binom.ppf(0.0005, len(t), 0.05) <= rejected
    assert rejected <= stats.binom.ppf(0.9995, len(t), 0.05) + 8  # parameters are correlated


@pytest.mark.repeats
def test_levels_hold_over_many_pairs(fly):
    pairs = [compare([fly(seed), fly(seed + 1)]) for seed in range(101, 221, 2)]
    p = np.array([difference(pair, 0, 1).test().p for pair in pairs])
    assert stats.kstest(p, "uniform").pvalue > 1e-3
    for level in (0.05, 0.2):
        low, high = stats.binom.ppf([0.0005, 0.9995], len(p), level)
        assert low <= np.sum(p < level) <= high


def test_a_longer_focal_length_is_found(fly):
    found = compare([fly(1), fly(2, f_um=15.0)])
    one = difference(found, 0, 1)
    i = found.names.index("CAM/f_mm")
    assert abs(one.d[i] - 0.015) < 4 * one.sigma[i]
    assert one.test().p < 1e-6
    own = {part: one.test(places).p for _, part, places in found.parts()}
    assert own["interior orientation"] < 1e-3
    assert min(own["lever arm"], own["boresight"]) > 1e-3


def test_a_difference_has_the_sum_of_both_covariances(three):
    one = difference(three, 0, 2)
    assert_allclose(one.d, three.values[2] - three.values[0])  # noqa: PD011 of a comparison
    assert_allclose(one.cov, three.covs[0] + three.covs[2])
    back = difference(three, 2, 0)
    assert_allclose(back.d, -one.d)
    assert_allclose(back.test().chi_square, one.test().chi_square)


def test_values_and_sigma_are_those_of_the_results(three, fly):
    listed = parameters(fly(2).calibration)
    assert_allclose(three.values[1], [p.value for p in listed])  # noqa: PD011 of a comparison
    assert_allclose(sigmas(three.covs[1]), [p.sigma for p in listed])
    assert three.names == tuple(f"CAM/{p.name}" for p in listed)


def test_covariances_a_priori_are_without_the_variance_factor(three, fly):
    plain = compare([fly(seed) for seed in (1, 2, 3)], apriori=True)
    for scaled, unscaled, campaign in zip(three.covs, plain.covs, three.campaigns, strict=True):
        assert_allclose(scaled, unscaled * campaign.calibration.sigma0_sq)
    assert np.isinf(plain.redundancy())
    assert three.redundancy() == min(c.redundancy for c in three.campaigns)


def test_pooled_values_are_better_than_each_and_test_the_stability(three):
    found = acx4tools_campaigns.pooled(three)
    assert np.all(sigmas(found.cov[0, :, 0]) < sigmas(three.covs).min(axis=0))
    whole = acx4tools_campaigns.stability(three)
    assert (whole.chi_square, whole.dof) == (found.chi_square, 28)
    assert len(acx4tools_campaigns.stable(three)) == 14


def test_differences_are_to_the_previous_or_to_the_first(three):
    pairs = {
        against: [(one.earlier, one.later) for one in differences(three, against=against)]
        for against in ("previous", "first")
    }
    assert pairs == {"previous": [(0, 1), (1, 2)], "first": [(0, 1), (0, 2)]}


def test_campaigns_with_dates_are_in_the_order_of_time(fly):
    late = fly(1, name="late", date=dt.date(2024, 5, 1))
    early = fly(2, name="early", date=dt.date(2021, 1, 31))
    found = compare([late, early])
    assert [c.name for c in found.campaigns] == ["early", "late"]
    assert_allclose(acx4tools_campaigns.years(found), [0.0, 1186 / 365.25])
    undated = compare([late, fly(2, name="undated")])
    assert [c.name for c in undated.campaigns] == ["late", "undated"]
    assert acx4tools_campaigns.years(undated) is None


def test_a_slope_over_temperature_is_recovered(fly):
    warm = {1: 5.0, 2: 15.0, 3: 25.0, 4: 35.0}
    found = compare([fly(s, f_um=0.8 * t, temperature_c=t) for s, t in warm.items()])
    line = acx4tools_campaigns.trend(found, acx4tools_campaigns.temperatures(found))
    i, sigma = found.names.index("CAM/f_mm"), sigmas(line.cov)
    assert abs(line.slope[i] - 0.8e-3) < 4 * sigma[i]
    assert line.sloping.p < 1e-6
    assert line.scatter.p > 1e-3
    assert (line.sloping.dof, line.scatter.dof) == (14, 28)
    constant = acx4tools_campaigns.stability(
        found
    )  # what a constant leaves, slopes and scatter share
    parts = line.sloping.chi_square + line.scatter.chi_square
    assert_allclose(constant.chi_square, parts, rtol=1e-6)


def test_temperatures_must_be_known_and_differ(fly):
    assert acx4tools_campaigns.temperatures(compare([fly(1, temperature_c=3.0), fly(2)])) is None
    same = [fly(seed, temperature_c=3.0) for seed in (1, 2)]
    assert acx4tools_campaigns.temperatures(compare(same)) is None


def test_angles_do_not_jump(fly):
    a, b = with_kappa(fly(1), 179.99), with_kappa(fly(2), -179.99)
    found = compare([a, b])
    i = found.names.index("CAM/boresight_kappa_deg")
    assert_allclose(found.values[:, i], [179.99, 180.01])  # noqa: PD011 of a comparison


def with_kappa(campaign, kappa_deg):
    camera = with_reported(campaign.calibration.cameras[0], {"boresight_kappa_deg": kappa_deg})
    return replace(campaign, calibration=replace(campaign.calibration, cameras=(camera,)))


def test_parameters_that_one_campaign_lacks_are_left_out_and_named(fly):
    few = tuple(name for name in INTERIOR if name not in {"b1", "b2", "k3"})
    found = compare([fly(1), fly(2, free=few)])
    assert "CAM/k3" not in found.names
    assert len(found.names) == 13
    assert found.notes == ("campaign 2 does not determine CAM/k3: not compared",)


def test_what_differs_besides_the_camera_is_said(fly):
    other = replace(fly(2), refraction="standard", method="two_step")
    method, refraction = compare([fly(1), other]).notes
    assert method == "method is not the same: single_step in campaign 1, two_step in campaign 2"
    assert refraction.startswith("refraction is not the same: none in campaign 1")


def test_common_control_points_are_said(fly):
    control = frozenset({"P01,1,2,3", "P02,4,5,6"})
    a = replace(fly(1), control=control)
    (note,) = compare([a, replace(fly(2), control=control | {"P03,7,8,9"})]).notes
    assert note.startswith("campaign 1 and campaign 2 have 2 control points with the same")


def refused(*campaigns):
    with pytest.raises(FlightError) as error:
        compare(campaigns)
    return error.value.problems


def test_one_campaign_is_not_compared(fly):
    (line,) = refused(fly(1))
    assert line.startswith("one campaign alone")


def test_the_same_flight_is_not_compared_with_itself(fly):
    (line,) = refused(*(replace(fly(1), name=name, flight="ab") for name in ("a", "b")))
    assert line.startswith("a and b are results of the same flight: their errors are the same")


def with_camera(campaign, **changes):
    cameras = (replace(campaign.calibration.cameras[0], **changes),)
    return replace(campaign, calibration=replace(campaign.calibration, cameras=cameras))


def test_other_cameras_are_refused(fly):
    (names,) = refused(fly(1), with_camera(fly(2), name="NEW"))
    assert names.startswith("campaign 1 has the cameras CAM, campaign 2 has NEW: none is the same")
    (size,) = refused(fly(1), with_camera(fly(2), width_px=4000))
    assert "not the same camera: 11608 x 8708 pixels of 4.6 µm in campaign 1, 4000 x" in size


def test_synthetic_images_in_another_frame_are_refused(fly):
    a, b = (replace(fly(1), frame_deg=(0.5, -1.6, k)) for k in (0.1, 0.2))
    (line,) = refused(a, b)
    assert line.startswith("mount_* of the synthetic camera define another frame")
    assert line.endswith("--method rig")


def test_where_nothing_is_determined_there_is_nothing_to_compare(fly):
    calibration = fly(1).calibration
    nothing = replace(calibration, open_columns=np.ones(calibration.n_columns, dtype=bool))
    (line,) = refused(replace(fly(1), calibration=nothing), fly(2))
    assert line == "no parameter was determined by all campaigns: nothing to compare"


# --- What parameters move on the ground: closed forms of a camera that looks straight down


HEIGHT, F = 800.0, 50.0
NAMES = (
    *("f_mm", "xp_mm", "yp_mm", "k1", "lever_x_m", "lever_y_m", "lever_z_m"),
    *("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg"),
)
CAMERA = Camera(name="CAM", width_px=6001, height_px=4001, pixel_mm=0.005, interior=Interior(f=F))


@pytest.fixture(scope="module")
def effects():
    return ground_effects(CAMERA, NAMES, np.full(len(NAMES), 1e-6), height_m=HEIGHT)


def xy_mm(effects):
    middle = np.array([3000.0, 2000.0])
    return (effects.colrow - middle) * CAMERA.pixel_mm * [1, -1]


def test_nodes_lie_where_their_rays_meet_the_ground(effects):
    assert_allclose(effects.xy, HEIGHT / F * xy_mm(effects), atol=1e-9)


def test_derivatives_are_those_of_the_pinhole(effects):
    x, y = xy_mm(effects).T
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
        J = effects.J[:, :, NAMES.index(name)]
        assert_allclose(J, np.column_stack([forward, left]), rtol=1e-5, atol=1e-6, err_msg=name)
    radial = effects.J[:, :, NAMES.index("k1")]
    assert_allclose(
        np.abs(radial), scale * np.abs(np.column_stack([x, y])) * r2[:, None], rtol=1e-4, atol=1e-2
    )


def test_sizes_are_those_of_the_vectors(effects):
    d = np.zeros(len(NAMES))
    d[4] = 0.3
    assert_allclose(effects.rms(d)[4], 0.3, rtol=1e-6)
    assert_allclose(np.hypot(*effects.moved(d).T), 0.3, rtol=1e-6)
    cov = np.zeros((len(NAMES),) * 2)
    cov[4, 4], cov[5, 5] = 0.3**2, 0.4**2
    assert_allclose(effects.sigma(cov), 0.5, rtol=1e-6)
    part = effects.of(np.array([4]))
    assert_allclose(part.moved(d[[4]]), effects.moved(d))


def test_what_correlates_may_cancel_on_the_ground(effects):
    d = np.zeros(len(NAMES))
    d[0], d[6] = 0.1, 0.1 * HEIGHT / F  # a longer focal length, and a higher camera
    assert np.abs(effects.moved(d)).max() < 1e-6 < effects.rms(d)[0]


@pytest.mark.parametrize(("steps", "height"), [(np.zeros(1), 10.0), (np.ones(1), 0.0)])
def test_steps_and_height_are_positive(steps, height):
    with pytest.raises(ValueError, match=r"must|expected"):
        ground_effects(CAMERA, ["f_mm"], steps, height_m=height)


# --- Tables of campaigns, and one campaign


# --- campaign --------------------------------------------------------------------------------
#
# A campaign as it is read from results, and as it was made; and folders that have none.


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return leave_results(tmp_path_factory.mktemp("campaign"))


@pytest.fixture
def spoilt(made, tmp_path):
    shutil.copytree(made[1], tmp_path / "results")
    (tmp_path / "results" / MARK).unlink()  # else any change would be refused
    return tmp_path / "results"


def test_what_is_read_is_what_was_adjusted(made):
    found = acx4tools_campaigns.read(made[1])
    flown = flight.read(made[0])
    again = acx4tools_campaigns.of_mounting(
        mounting.single_step(flown.calibration, free=flown.estimate_mounting), name="again"
    )
    assert (found.name, found.method, found.redundancy) == (
        "results",
        "single_step",
        again.redundancy,
    )
    for one, other in zip(
        parameters(found.calibration), parameters(again.calibration), strict=True
    ):
        assert (one.name, one.unit) == (other.name, other.unit)
        assert_allclose([one.value, one.sigma], [other.value, other.sigma], rtol=1e-9)
    covs = (reported_covariance(c.calibration) for c in (found, again))
    assert_allclose(*covs, rtol=1e-6, atol=1e-30)
    assert_allclose(found.height_m, again.height_m)
    assert_allclose(found.chi_square_p, again.chi_square_p)
    assert found.session == again.session == Session() or np.isnan(found.session.temperature_c)
    assert len(found.control) == 20
    assert found.flight
    assert acx4tools_campaigns.sensors(found) == {"CAM": (11608, 8708, 0.0046)}


def test_another_method_is_read_by_its_name(made):
    assert acx4tools_campaigns.read(made[1], method="two_step", name="B").method == "two_step"
    with pytest.raises(ValueError, match="one of single_step"):
        acx4tools_campaigns.read(made[1], method="three_step")


def problems(folder, **chosen):
    with pytest.raises(FlightError) as error:
        acx4tools_campaigns.read(folder, **chosen)
    return error.value.problems


def test_a_covariance_that_lost_a_row_is_refused(spoilt):
    rows = (spoilt / "covariance.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    lost = next(k for k, row in enumerate(rows) if row.startswith("mounting,single_step")) + 1
    (spoilt / "covariance.csv").write_text("".join(rows[:lost] + rows[lost + 1 :]))
    (line,) = problems(spoilt)
    assert line.endswith("row: 'CAM/xp_mm'; must have a row with row and column exchanged")


def test_results_without_the_method_say_so(made, tmp_path):
    (line,) = problems(made[1], method="rig")
    assert line.endswith("no results of mounting/rig; acx4 run makes them")
    (line,) = problems(tmp_path)
    assert "no results of a run" in line


def test_results_that_contradict_themselves_are_no_campaign(spoilt):
    summary = json.loads((spoilt / "summary.json").read_text())
    summary["mounting/single_step"]["stopped"] = ["GNSS positions contradict"]
    (spoilt / "summary.json").write_text(json.dumps(summary))
    (line,) = problems(spoilt)
    assert line.endswith("no calibration to compare: GNSS positions contradict")


def test_changed_results_are_refused(made, tmp_path):
    folder = tmp_path / "changed"
    shutil.copytree(made[1], folder)
    with (folder / "covariance.csv").open("a") as file:
        file.write("mounting,single_step,a,b,1\n")
    assert any("covariance.csv" in line for line in problems(folder))


def test_a_changed_flight_is_refused(made, tmp_path):
    folder = tmp_path / "changed"
    shutil.copytree(made[1], folder)
    points = folder / "flight" / "calibration" / "image_points.csv"
    points.write_text(points.read_text(encoding="utf-8").replace(",", ",x", 1), encoding="utf-8")
    (line,) = problems(folder)
    assert line.endswith("calibration/image_points.csv changed since the run; run all stages again")


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


def test_nothing_is_no_test():
    assert np.isnan(joint_test(np.zeros(0), np.zeros((0, 0))).p)


def test_the_constant_of_independent_values_is_their_weighted_mean():
    values, sigma = np.array([[5.0], [8.0], [6.0]]), np.array([1.0, 2.0, 0.5])
    found = fit(values, (sigma**2)[:, None, None], np.ones((3, 1)))
    weight = sigma**-2
    mean = weight @ values[:, 0] / weight.sum()
    assert_allclose(found.coefficients, [[mean]])
    assert_allclose(found.cov.ravel(), 1 / weight.sum())
    assert_allclose(found.chi_square, np.sum(weight * (values[:, 0] - mean) ** 2))
    assert found.dof == 2


def test_a_line_of_independent_values_is_that_of_numpy():
    t, y, sigma = np.array([3.0, 8.0, 20.0, 31.0]), np.array([1.0, 2.5, 2.0, 6.0]), 0.3
    found = fit(y[:, None], np.full((4, 1, 1), sigma**2), np.column_stack([np.ones(4), t]))
    line, cov = np.polyfit(t, y, 1, w=np.full(4, 1 / sigma), cov="unscaled")
    assert_allclose(found.coefficients[::-1, 0], line)
    assert_allclose(found.cov[:, 0, :, 0][::-1, ::-1], cov)


def test_with_full_covariances_it_is_dense_least_squares(rng):
    n, k = 5, 4
    covs = covariances(rng, n)
    values = rng.standard_normal((n, k)) * SCALES
    X = np.column_stack([np.ones(n), rng.uniform(-10, 10, n)])
    found = fit(values, covs, X)
    half = [np.linalg.inv(np.linalg.cholesky(C / SCALES[:, None] / SCALES)) for C in covs]
    A = np.concatenate([H @ np.kron(x, np.eye(k)) for H, x in zip(half, X, strict=True)])
    b = np.concatenate([H @ (v / SCALES) for H, v in zip(half, values, strict=True)])
    solved = np.linalg.lstsq(A, b, rcond=None)[0]
    assert_allclose(found.coefficients, solved.reshape(2, k) * SCALES, rtol=1e-6)
    assert_allclose(found.chi_square, np.sum((A @ solved - b) ** 2), rtol=1e-6)
    assert_allclose(found.residuals, X @ found.coefficients - values)
    cov = np.linalg.inv(A.T @ A).reshape(2, k, 2, k) * SCALES[:, None, None] * SCALES
    assert_allclose(found.cov, cov, rtol=1e-5, atol=0)


def test_of_two_vectors_the_constant_tests_their_difference(rng):
    covs = covariances(rng, 2)
    values = rng.standard_normal((2, 4)) * SCALES
    d = joint_test(values[1] - values[0], covs.sum(axis=0))
    assert_allclose(fit(values, covs, np.ones((2, 1))).chi_square, d.chi_square, rtol=1e-6)
    alone = same_values(values, covs)
    t = (values[1] - values[0]) / np.sqrt(np.diagonal(covs.sum(axis=0)))
    assert_allclose([one.chi_square for one in alone], t**2)
    assert {one.dof for one in alone} == {1}


def test_levels_hold_where_the_variance_factor_is_estimated_from_little(rng):
    n, r, k = 4000, 12, 3
    d = rng.standard_normal((n, k))
    s0_sq = rng.chisquare(r, n) / r
    p = [joint_test(x, s * np.eye(k), redundancy=r).p for x, s in zip(d, s0_sq, strict=True)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3


@pytest.mark.parametrize("dof", [1, 14])
def test_probabilities_are_those_of_the_distribution(dof):
    assert_allclose(JointTest(chi_square=7.0, dof=dof).p, stats.chi2.sf(7.0, dof))


# --- tables of a comparison: their rows, and numbers that must agree with each other ---------


@pytest.fixture
def compared(fly):
    warm = {1: 5.0, 2: 15.0, 3: 30.0}
    return compare([fly(s, f_um=1.5 * t, temperature_c=t) for s, t in warm.items()])


@pytest.fixture
def every(compared):
    found = differences(compared)
    return acx4tools_campaigns.every(compared, found, ground_of(compared, height_m=1000.0))


def test_every_table_has_its_rows(every):
    assert {name: len(table) for name, table in every.items()} == {
        "campaigns": 3,
        "tests": 1 + 2 + 2 * 3 + 2,
        "differences": 2 * 14,
        "pooled": 14,
        "trends": 14,
        "covariance": 3 * 14 * 14,
    }
    assert set(every["campaigns"]["sigma"]) == {"a posteriori"}


def test_probabilities_are_at_a_joint_level_over_their_rows(every):
    for name in ("differences", "pooled", "trends"):
        assert_allclose(every[name]["p_joint"], holm(every[name]["p"].to_numpy()))
    tests = every["tests"]
    parts = tests[(tests["part"] != "all")]
    assert_allclose(parts["p_joint"], holm(parts["p"].to_numpy()))


def test_differences_tests_and_covariances_agree(every):
    listed, cov = every["differences"], every["covariance"]
    later = listed[listed["later"] == "campaign 2"]
    own = cov[cov["of"] == "campaign 2 - campaign 1"].pivot_table(
        index="row", columns="column", values="value"
    )
    names = "CAM/" + later["parameter"]
    C = own.loc[names, names].to_numpy()
    assert_allclose(np.sqrt(np.diag(C)), later["sigma"])
    d = later["difference"].to_numpy()
    z = d / later["sigma"].to_numpy()
    s = later["sigma"].to_numpy()
    whole = every["tests"].set_index(["test", "part"]).loc[("campaign 2 - campaign 1", "all")]
    assert_allclose(z @ np.linalg.solve(C / s[:, None] / s, z), whole["chi_square"], rtol=1e-6)
    assert whole["dof"] == 14


def test_what_a_focal_length_moves_on_the_ground_grows_with_the_height(compared):
    found = differences(compared)
    by_height = [
        acx4tools_campaigns.every(compared, found, ground_of(compared, height_m=h))["differences"]
        for h in (500.0, 1000.0)
    ]
    low, high = (table["ground_rms_m"].to_numpy() for table in by_height)
    of_lever = by_height[0]["parameter"].str.startswith("lever").to_numpy()
    assert_allclose(high[of_lever], low[of_lever], rtol=1e-4)
    assert_allclose(high[~of_lever], 2 * low[~of_lever], rtol=2e-3)
    assert ground_of(compared).height_m == 610.0


def test_the_slope_of_the_focal_length_is_significant(every):
    slopes = every["trends"].set_index("parameter")
    assert slopes.loc["f_mm", "unit"] == "mm per °C"
    assert abs(slopes.loc["f_mm", "slope"] - 1.5e-3) < 4 * slopes.loc["f_mm", "sigma"]
    assert slopes.loc["f_mm", "p_joint"] < 1e-3


def test_two_campaigns_have_no_trend(fly):
    two = compare([fly(1, temperature_c=1.0), fly(2, temperature_c=9.0)])
    assert acx4tools_campaigns.trends_of(two) == {}
    trends = acx4tools_campaigns.every(two, differences(two), ground_of(two))["trends"]
    assert list(trends.columns) == list(acx4tools_campaigns.SLOPES)


def test_the_rig_has_a_row_for_each_exposure_and_one_for_all():
    turns = np.radians([[[0, 0, 0], [1, -8, 2]], [[0, 0, 0], [1, 1, 1]]]) / 3600
    sigma = np.radians([[[0, 0, 0], [2, 2, 2]]] * 2) / 3600
    test = FTest(explained=12.0, left=97.0, dof=3, redundancy=97)
    small = FTest(explained=3.0, left=97.0, dof=3, redundancy=97)
    found = acx4tools_campaigns.rigidity(
        Rigidity(
            heads=("A", "B"),
            exposures=("E1", "E2"),
            turns=turns,
            sigma=sigma,
            tests=(test, small),
            whole=test,
        )
    )
    assert found["exposure"].tolist() == ["E1", "E2", ""]
    assert_allclose(found["f"], [4.0, 1.0, 4.0])
    first = found.iloc[0]
    assert first["head"] == "B"
    assert_allclose([first["turn_arcsec"], first["sigma_arcsec"]], [-8, 2])
    assert_allclose(found["p_joint"][:2], holm(found["p"].to_numpy()[:2]))
    assert isinstance(found, pd.DataFrame)
