"""Campaigns side by side: levels, planted changes, and campaigns that cannot be compared."""

import datetime as dt
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.calibration.estimates import parameters, with_reported
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.least_squares.covariance import sigmas
from acx4tools.campaigns import comparison
from acx4tools.campaigns.comparison import compare, difference, differences, ground_effects


@pytest.fixture
def three(fly):
    return compare([fly(seed) for seed in (1, 2, 3)])


@pytest.mark.slow
def test_chi_squares_of_campaigns_of_the_same_camera_are_of_their_distribution(fly):
    campaigns = [fly(seed) for seed in range(1, 17)]
    whole = comparison.stability(compare(campaigns))
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
    assert_allclose(one.d, three.values[2] - three.values[0])
    assert_allclose(one.cov, three.covs[0] + three.covs[2])
    back = difference(three, 2, 0)
    assert_allclose(back.d, -one.d)
    assert_allclose(back.test().chi_square, one.test().chi_square)


def test_values_and_sigma_are_those_of_the_results(three, fly):
    listed = parameters(fly(2).calibration)
    assert_allclose(three.values[1], [p.value for p in listed])
    assert_allclose(sigmas(three.covs[1]), [p.sigma for p in listed])
    assert three.names == tuple(f"CAM/{p.name}" for p in listed)


def test_covariances_a_priori_are_without_the_variance_factor(three, fly):
    plain = compare([fly(seed) for seed in (1, 2, 3)], apriori=True)
    for scaled, unscaled, campaign in zip(three.covs, plain.covs, three.campaigns, strict=True):
        assert_allclose(scaled, unscaled * campaign.calibration.sigma0_sq)
    assert np.isinf(plain.redundancy())
    assert three.redundancy() == min(c.redundancy for c in three.campaigns)


def test_pooled_values_are_better_than_each_and_test_the_stability(three):
    found = comparison.pooled(three)
    assert np.all(sigmas(found.cov[0, :, 0]) < sigmas(three.covs).min(axis=0))
    whole = comparison.stability(three)
    assert (whole.chi_square, whole.dof) == (found.chi_square, 28)
    assert len(comparison.stable(three)) == 14


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
    assert_allclose(comparison.years(found), [0.0, 1186 / 365.25])
    undated = compare([late, fly(2, name="undated")])
    assert [c.name for c in undated.campaigns] == ["late", "undated"]
    assert comparison.years(undated) is None


def test_a_slope_over_temperature_is_recovered(fly):
    warm = {1: 5.0, 2: 15.0, 3: 25.0, 4: 35.0}
    found = compare([fly(s, f_um=0.8 * t, temperature_c=t) for s, t in warm.items()])
    line = comparison.trend(found, comparison.temperatures(found))
    i, sigma = found.names.index("CAM/f_mm"), sigmas(line.cov)
    assert abs(line.slope[i] - 0.8e-3) < 4 * sigma[i]
    assert line.sloping.p < 1e-6
    assert line.scatter.p > 1e-3
    assert (line.sloping.dof, line.scatter.dof) == (14, 28)
    constant = comparison.stability(found)  # what a constant leaves, slopes and scatter share
    parts = line.sloping.chi_square + line.scatter.chi_square
    assert_allclose(constant.chi_square, parts, rtol=1e-6)


def test_temperatures_must_be_known_and_differ(fly):
    assert comparison.temperatures(compare([fly(1, temperature_c=3.0), fly(2)])) is None
    same = [fly(seed, temperature_c=3.0) for seed in (1, 2)]
    assert comparison.temperatures(compare(same)) is None


def test_angles_do_not_jump(fly):
    a, b = with_kappa(fly(1), 179.99), with_kappa(fly(2), -179.99)
    found = compare([a, b])
    i = found.names.index("CAM/boresight_kappa_deg")
    assert_allclose(found.values[:, i], [179.99, 180.01])


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
