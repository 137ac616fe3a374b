"""What a simulated flight can have beyond white noise: gross and slow errors, bent rays.

Nothing here uses the library's geometry; the air is compared with the tabulated standard
atmosphere.
"""

import json
import tomllib

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import acx4sim
from acx4sim import air, fly
from acx4sim.plan import GrossErrors, SlowErrors

BLOCK = ("calibration",)
EXACT = {"image_noise": 0, "control_noise": 0, "gnss_noise": 0, "attitude_noise": 0}
SHIFT = ["east_m", "north_m", "height_m"]


def acx4(**options):
    return acx4sim.acx4(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def single_head(**options):
    return acx4sim.single_head(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


@pytest.fixture(scope="module")
def plain():
    return acx4()


@pytest.fixture(scope="module")
def spoiled():
    return acx4(gross_errors=GrossErrors())


def changed(flight, other, name):
    """Return the differences of the number columns, rows without any left out."""
    a, b = flight.tables[name], other.tables[name]
    numbers = a.select_dtypes("number").columns
    difference = (b[numbers] - a[numbers]).set_index(pd.MultiIndex.from_frame(a.iloc[:, :2]))
    return difference[(difference != 0).any(axis=1)]


def mistakes(flight, kind):
    return [m for m in flight.truth["gross_errors"] if m["kind"] == kind]


# --- gross errors ----------------------------------------------------------------------------


def test_exactly_the_listed_image_points_are_wrong_by_what_is_listed(plain, spoiled):
    found = changed(plain, spoiled, "calibration/image_points.csv")
    listed = {(m["image_or_exposure"], m["point"]): m for m in mistakes(spoiled, "image_point")}
    assert set(found.index) == set(listed)
    for where, row in found.iterrows():
        told = [listed[where]["col_px"], listed[where]["row_px"]]
        assert_allclose(row[["col_px", "row_px"]].to_numpy(float), told, atol=2e-6)


def test_two_percent_of_the_image_points_are_wrong_by_5_to_200_px(plain, spoiled):
    size = [np.hypot(m["col_px"], m["row_px"]) for m in mistakes(spoiled, "image_point")]
    n = len(plain.tables["calibration/image_points.csv"])
    assert abs(len(size) - 0.02 * n) < 3.3 * np.sqrt(0.02 * n)  # binomial, 0.1 %
    assert min(size) >= 5 - 1e-6
    assert max(size) <= 200 + 1e-6
    assert abs(np.median(size) - np.sqrt(5 * 200)) < 10  # logarithmic: as many below 32 px


def test_spoiled_measurements_stay_on_the_sensor(plain, spoiled):
    measured = spoiled.tables["calibration/image_points.csv"]
    assert measured["col_px"].between(0, 11999).all()
    assert measured["row_px"].between(0, 16199).all()


def test_one_position_is_3_m_off_and_no_other(plain, spoiled):
    (told,) = mistakes(spoiled, "gnss")
    found = changed(plain, spoiled, "calibration/trajectory.csv")[SHIFT]
    found = found[(found.abs() > 1e-5).any(axis=1)]
    assert found.index.get_level_values("exposure").tolist() == [told["image_or_exposure"]]
    assert_allclose(found.to_numpy()[0], [told[name] for name in SHIFT], atol=2e-6)
    assert np.linalg.norm(found.to_numpy()) == pytest.approx(3.0, abs=1e-5)


def test_another_exposures_heading_is_wrong_by_what_is_listed():
    """Where the tables have headings; body and horizon are a degree apart, hence the tolerance."""
    flights = single_head(), single_head(gross_errors=GrossErrors())
    (told,) = mistakes(flights[1], "attitude")
    found = changed(*flights, "calibration/trajectory.csv")["heading_deg"]
    found = found[found.abs() > 1e-5]
    assert found.index.get_level_values("exposure").tolist() == [told["image_or_exposure"]]
    assert abs(told["heading_deg"]) == 0.3
    assert found.iloc[0] == pytest.approx(told["heading_deg"], rel=2e-3)
    assert told["image_or_exposure"] != mistakes(flights[1], "gnss")[0]["image_or_exposure"]


def test_one_coordinate_of_a_control_point_in_images_is_a_metre_off(plain, spoiled):
    (told,) = mistakes(spoiled, "control_point")
    (name,) = set(told) & set(SHIFT)
    a, b = (f.tables["control_points.csv"].set_index("point")[SHIFT] for f in (plain, spoiled))
    difference = b - a
    assert difference.loc[told["point"], name] == pytest.approx(told[name], abs=2e-6)
    assert (difference != 0).to_numpy().sum() == 1
    assert abs(told[name]) == 1.0
    measured = plain.tables["calibration/image_points.csv"]["point"]
    assert (measured == told["point"]).sum() >= 4


def test_the_truth_with_its_mistakes_is_json_and_the_flight_hides_them(spoiled, plain):
    assert json.loads(json.dumps(spoiled.truth))["gross_errors"] == spoiled.truth["gross_errors"]
    assert spoiled.truth["exposures"] == plain.truth["exposures"]
    assert spoiled.toml == plain.toml


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GrossErrors(image_points=1.2), "must be a share"),
        (lambda: GrossErrors(image_px=(9.0, 5.0)), "the lower first"),
        (lambda: acx4(gross_errors=GrossErrors(block="heads")), "'heads' is not simul"),
        (lambda: SlowErrors(gnss=-0.1), "gnss must be a share"),
        (lambda: SlowErrors(time_constant_s=0.0), "time_constant_s must be positive"),
        (lambda: acx4sim.Options(refraction="some"), "refraction is 'none' or 'standard'"),
    ],
)
def test_misuse_is_a_value_error(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# --- slow errors -----------------------------------------------------------------------------


def test_the_correlation_of_slow_errors_falls_exponentially():
    """The covariance of 20 000 processes, to four of its standard deviations."""
    time_s = np.array([0.0, 3.0, 6.0, 250.0, 1000.0])
    walks = fly.gauss_markov(time_s, 300.0, 20_000, np.random.default_rng(5))
    expected = np.exp(-np.abs(time_s[:, None] - time_s) / 300.0)
    assert_allclose(walks @ walks.T / 20_000, expected, atol=4 * np.sqrt(2 / 20_000))


def errors(**options):
    """Return the errors of positions (m) and attitudes (body axes, deg) of the paper's block."""
    true, recorded = (acx4(**EXACT), acx4(**options))
    tables = [f.tables["calibration/trajectory.csv"] for f in (true, recorded)]
    R = [
        Rotation.from_euler("XYZ", t[["omega_deg", "phi_deg", "kappa_deg"]], degrees=True)
        for t in tables
    ]
    turn = (R[0].inv() * R[1]).as_rotvec(degrees=True)
    return (tables[1][SHIFT] - tables[0][SHIFT]).to_numpy(), turn


def test_a_share_of_the_noise_stays_white_and_keeps_its_values():
    white = errors()
    slow = errors(slow_errors=SlowErrors(gnss=1.0, attitude=0.0))
    both = errors(slow_errors=SlowErrors(gnss=0.8, attitude=0.0))
    assert_allclose(both[0], 0.8 * slow[0] + 0.6 * white[0], atol=3e-6)
    # attitudes refer to the grid's north at the recorded position, 1e-7 deg elsewhere
    assert_allclose(slow[1], white[1], atol=1e-6)


def test_slow_errors_of_an_endless_time_constant_are_one_shift():
    forever = SlowErrors(gnss=1.0, attitude=1.0, time_constant_s=1e12)
    position, attitude = errors(slow_errors=forever)
    assert_allclose(position - position[0], 0.0, atol=5e-6)
    assert_allclose(attitude - attitude[0], 0.0, atol=1e-6)
    assert np.all(np.abs(position[0]) > 1e-4)
    assert np.all(np.abs(attitude[0]) < 4 * np.array([0.005, 0.005, 0.008]))


def test_a_strips_drift_is_linear_in_time_and_zero_at_its_middle():
    position, attitude = errors(**EXACT, gnss_strip_drift_m_per_min=(0.1, 0.0, 0.2))
    table = acx4().tables["calibration/trajectory.csv"]
    strip, minutes = table["exposure"].str[:2].to_numpy(), table["time_s"].to_numpy() / 60
    rates = []
    for name in np.unique(strip):
        here = strip == name
        line = np.polyfit(minutes[here] - minutes[here].mean(), position[here], 1)
        assert_allclose(line[1], 0.0, atol=2e-6)
        assert_allclose(
            position[here], np.outer(minutes[here] - minutes[here].mean(), line[0]), atol=2e-6
        )
        rates.append(line[0])
    assert_allclose(np.array(rates)[:, 1], 0.0, atol=1e-5)
    assert np.ptp(np.array(rates)[:, [0, 2]], axis=0).min() > 0.05
    assert_allclose(attitude, 0.0, atol=1e-6)


# --- refraction ------------------------------------------------------------------------------


def test_a_ray_is_bent_as_the_tabulated_atmosphere_bends_it():
    """The mean density of a layer is the difference of its pressures over g times its height.

    Pressures and density are the ICAO table's at 1000 m and 5000 m, geopotential.
    """
    mean = (89874.6 - 54019.9) / (9.80665 * 4000.0)
    expected = 2.7769e-4 * (mean - 0.736116) / 1.2250  # rad per tangent, n - 1 of 0.56 um
    for tangent in (0.1, 1.0, 3.0):
        ray = np.array([[4000.0 * tangent, 0.0, -4000.0]])
        bent = air.bent(ray, np.array([[0.0, 0.0, 1.0]]), np.array([1000.0]))
        turned = np.arctan2(bent[0, 0], 4000.0) - np.arctan(tangent)
        # the table has six digits; the bend is not quite proportional to the tangent
        assert turned == pytest.approx(expected * tangent, rel=5e-4)


def test_rays_straight_down_and_upward_are_not_bent():
    rays = np.array([[0.0, 0.0, -1000.0], [500.0, 0.0, 800.0], [90_000.0, 0.0, -100.0]])
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    assert_allclose(air.bent(rays, up, np.zeros(3)), rays, rtol=1e-15)


def test_refraction_moves_image_points_outward_by_k_tan_of_the_angle():
    """K is 12e-6 and 17e-6 at 1000 m and 1500 m over ground at 900 m, and images are tilted."""
    straight = acx4(**EXACT)
    bent = acx4(**EXACT, refraction="standard")
    names = ["image", "point"]
    a, b = (f.tables["calibration/image_points.csv"] for f in (straight, bent))
    both = a.merge(b, on=names, suffixes=("", "_bent"))
    xy = both[["col_px", "row_px"]].to_numpy() - [5999.5, 8099.5]
    moved = both[["col_px_bent", "row_px_bent"]].to_numpy() - both[["col_px", "row_px"]].to_numpy()
    r = np.hypot(*xy.T)
    outward = np.sum(moved * xy, axis=1) / r
    tangent = r * 0.0056 / 74.44
    K = outward * 0.0056 / 74.44 / (tangent * (1 + tangent**2))
    far = r > 4000  # px: near the middle a tilted image hides which way is outward
    assert np.all(outward[far] > 0)
    assert 12e-6 < np.median(K[far]) < 17e-6
    assert tomllib.loads(bent.toml)["refraction"] == "standard"
    assert "refraction" not in tomllib.loads(straight.toml)
    assert bent.truth["cameras"] == straight.truth["cameras"]
