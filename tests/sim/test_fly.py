"""True and recorded poses of simulated flights, and what images show."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import acx4sim
from acx4sim import earth, fly
from acx4sim.plan import SlowErrors

BLOCK = ("calibration",)
EXACT = {"image_noise": 0, "control_noise": 0, "gnss_noise": 0, "attitude_noise": 0}
SHIFT = ["east_m", "north_m", "height_m"]


def acx4(**options):
    return acx4sim.acx4_ideal(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def test_the_correlation_of_slow_errors_falls_exponentially():
    """The covariance of 20 000 processes, to four of its standard deviations."""
    time_s = np.array([0.0, 3.0, 6.0, 250.0, 1000.0])
    walks = fly.gauss_markov(time_s, np.full(20_000, 300.0), np.random.default_rng(5))
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


def test_slow_errors_of_an_endless_time_constant_are_one_shift():
    forever = SlowErrors(gnss=1.0, attitude=1.0, gnss_constant_s=1e12, attitude_constant_s=1e12)
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


def test_a_delay_as_long_as_an_interval_records_the_next_exposures_pose():
    """Inside a strip the parabola goes through it; positions and attitudes by themselves."""
    true = acx4(**EXACT).tables["calibration/trajectory.csv"]
    k = 3
    step = float(true["time_s"][k + 1] - true["time_s"][k])
    angles = ["omega_deg", "phi_deg", "kappa_deg"]
    for option, late, kept in (
        ("gnss_delay_s", SHIFT, angles),
        ("attitude_delay_s", angles, SHIFT),
    ):
        found = acx4(**EXACT, **{option: step}).tables["calibration/trajectory.csv"]
        # m and degrees: times are written to 0.1 ms
        expected = true.loc[k + 1, late].to_numpy(float)
        assert_allclose(found.loc[k, late].to_numpy(float), expected, atol=0.02)
        assert_allclose(found[kept], true[kept], atol=1e-3)  # the grid turns along the way


def test_exposures_are_late_by_as_much_as_they_are_ahead():
    """Along every strip the ground speed is the plan's; times are written to 1 ms, 7 cm."""
    flight = acx4(**EXACT)
    table = flight.tables["calibration/trajectory.csv"]
    off = []
    for strip, own in table.groupby(table["exposure"].str[:2]):
        en, time = own[["east_m", "north_m"]].to_numpy(), own["time_s"].to_numpy()
        planned = flight.plan.blocks["calibration"].strips[int(strip[1]) - 1]
        course = np.radians(flight.plan.blocks["calibration"].azimuth_deg + planned.turn_deg)
        along = en @ [np.sin(course), np.cos(course)]
        passed = planned.speed_m_s * (time - time[0])
        assert_allclose(along - along[0], passed, atol=0.071)
        off.append(np.diff(time) - planned.base_m / planned.speed_m_s)
    assert np.std(np.concatenate(off)) > 0.05  # s: they are not at equal intervals


# --- Observations follow from the truth, and their noise is what the flight says


NO_NOISE = acx4sim.Options(image_noise=0, control_noise=0, gnss_noise=0, attitude_noise=0)


def pixel_by_hand(camera, body, point, crs, geocentric):
    """Compute one pixel with nothing but the paper's equations, PROJ and plain arithmetic.

    The axes of the grid are differences of PROJ's ECEF coordinates on the ellipsoid; at flying
    height they would be 3e-8 rad off, as only the map of the ellipsoid is conformal.
    """
    to_geo = Transformer.from_crs(crs, crs.geodetic_crs, always_xy=True)
    to_ecef = Transformer.from_crs(crs.geodetic_crs.to_3d(), geocentric, always_xy=True)

    def ecef(east, north, height):
        return np.array(to_ecef.transform(*to_geo.transform(east, north), height))

    east, north, height, omega, phi, kappa = body
    step = 50.0
    axes = [
        ecef(east + step * dx, north + step * dy, step * dz)
        - ecef(east - step * dx, north - step * dy, -step * dz)
        for dx, dy, dz in ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    ]
    R_e_g = np.column_stack([axis / np.linalg.norm(axis) for axis in axes])
    r_e_b = ecef(east, north, height)
    x_b = eq_6(omega, phi, kappa) @ R_e_g.T @ (ecef(*point) - r_e_b)
    angles = [camera[f"boresight_{a}_deg"] for a in ("omega", "phi", "kappa")]
    d_x, d_y, d_z = eq_6(*angles) @ (x_b - [camera[f"lever_{a}_m"] for a in "xyz"])
    ideal = np.array([-camera["f_mm"] * d_x / d_z, -camera["f_mm"] * d_y / d_z])
    x, y = ideal
    for _ in range(30):  # eqs (1), (2), (7)-(11), the last point put in again
        rr = x * x + y * y
        radial = camera["k1"] * rr + camera["k2"] * rr**2 + camera["k3"] * rr**3
        p1, p2 = camera["p1"], camera["p2"]
        x, y = (
            ideal[0] + x * radial + p1 * (rr + 2 * x * x) + 2 * p2 * x * y,
            ideal[1] + y * radial + p2 * (rr + 2 * y * y) + 2 * p1 * x * y,
        )
    p = camera["pixel_um"] / 1000
    col = (x + camera["xp_mm"]) / p + (camera["width_px"] - 1) / 2
    row = (camera["height_px"] - 1) / 2 - (y + camera["yp_mm"]) / p
    return col, row


def eq_6(omega_deg, phi_deg, kappa_deg):
    """The paper's matrix, element by element."""
    o, f, k = map(math.radians, (omega_deg, phi_deg, kappa_deg))
    so, co, sf, cf, sk, ck = (
        math.sin(o),
        math.cos(o),
        math.sin(f),
        math.cos(f),
        math.sin(k),
        math.cos(k),
    )
    return np.array(
        [
            [cf * ck, co * sk + so * sf * ck, so * sk - co * sf * ck],
            [-cf * sk, co * ck - so * sf * sk, so * ck + co * sf * sk],
            [sf, -so * cf, co * cf],
        ]
    )


@pytest.mark.parametrize("name", acx4sim.DESIGNS)
def test_pixels_follow_from_the_truth_by_hand(name):
    """Every fortieth surveyed point; truth is rounded to 1 um, the axes are good to 1e-8."""
    flight = acx4sim.DESIGNS[name](seed=1, options=NO_NOISE)
    toml = tomllib.loads(flight.toml)
    crs = CRS.from_user_input(toml["crs"])
    geocentric = "EPSG:4978" if name == "single-head" else "EPSG:4988"
    for block, exposures in flight.truth["exposures"].items():
        measured = flight.tables[f"{block}/image_points.csv"].merge(
            flight.tables[f"{block}/images.csv"], on="image"
        )
        measured = measured[measured["point"].isin(list(flight.truth["control_points"]))]
        for row in measured.iloc[::40].itertuples():
            camera = flight.truth["cameras"][row.camera] | toml["cameras"][row.camera]
            body, point = exposures[row.exposure], flight.truth["control_points"][row.point]
            expected = pixel_by_hand(camera, body, point, crs, geocentric)
            assert_allclose((row.col_px, row.row_px), expected, atol=1e-4)


def test_lat_lon_roll_pitch_heading_say_the_same_as_the_truth(exact_single_head):
    """Heading minus convergence is 90 degrees minus kappa, up to products of small angles."""
    for block, exposures in exact_single_head.truth["exposures"].items():
        table = exact_single_head.tables[f"{block}/trajectory.csv"]
        true = np.array([exposures[name] for name in table["exposure"]])
        grid = earth.Grid(crs="EPSG:32633")
        llh = np.column_stack(
            [np.radians(table[["lat_deg", "lon_deg"]].to_numpy()), table["height_m"]]
        )
        assert_allclose(grid.grid_from_geodetic(llh), true[:, :3], atol=5e-6)
        azimuth = table["heading_deg"] - np.degrees(grid.convergence(llh))
        difference = (azimuth - 90 + true[:, 5] + 180) % 360 - 180
        assert_allclose(difference, 0.0, atol=0.15)
        assert table["heading_deg"].between(0, 360).all()


def test_a_camera_turned_by_90_degrees_has_its_rows_along_the_flight(exact_single_head):
    """Its x points left and its y backwards: flying on moves the ground up in the image."""
    images = exact_single_head.tables["calibration/images.csv"]
    measured = exact_single_head.tables["calibration/image_points.csv"]
    first, second = images.loc[images["strip"] == "1", "image"].iloc[:2]
    both = measured[measured["image"] == first].merge(
        measured[measured["image"] == second], on="point"
    )
    shift = both[["col_px_y", "row_px_y"]].to_numpy() - both[["col_px_x", "row_px_x"]].to_numpy()
    col, row = np.median(shift, axis=0)
    assert row < -1000
    assert abs(col) < 0.5 * abs(row)


@pytest.mark.parametrize("name", acx4sim.DESIGNS)
def test_measurements_lie_on_their_sensor(name):
    flight = acx4sim.DESIGNS[name](seed=4)
    sensors = tomllib.loads(flight.toml)["cameras"]
    for path in [path for path in flight.tables if path.endswith("image_points.csv")]:
        images = flight.tables[path.replace("image_points", "images")]
        measured = flight.tables[path].merge(images, on="image")
        width = measured["camera"].map(
            {name: sensor["width_px"] for name, sensor in sensors.items()}
        )
        height = measured["camera"].map(
            {name: sensor["height_px"] for name, sensor in sensors.items()}
        )
        assert measured["col_px"].between(-0.5, width - 0.5).all()
        assert measured["row_px"].between(-0.5, height - 0.5).all()
        assert not measured.duplicated(["image", "point"]).any()


def assert_standard_normal(values):
    """Sum of squares and mean inside their 0.1 % quantiles."""
    n = values.size
    low, high = chi2.ppf([0.0005, 0.9995], n)
    assert low < np.sum(values**2) < high
    assert abs(values.mean()) < 3.5 / math.sqrt(n)


def test_image_noise_is_what_the_flight_says(flight, exact):
    for block in ("heads", "calibration", "validation"):
        noisy, true = (f.tables[f"{block}/image_points.csv"] for f in (flight, exact))
        assert (noisy[["image", "point"]] == true[["image", "point"]]).all(axis=None)
        sigma = noisy["sigma_px"].to_numpy()[:, None] if block == "validation" else 0.5
        error = noisy[["col_px", "row_px"]].to_numpy() - true[["col_px", "row_px"]].to_numpy()
        assert_standard_normal(error / sigma)


def test_control_noise_is_what_the_flight_says(flight, exact):
    names = ["east_m", "north_m", "height_m"]
    error = flight.tables["control_points.csv"][names] - exact.tables["control_points.csv"][names]
    assert_standard_normal(error.to_numpy() / [0.01, 0.01, 0.02])


def test_trajectory_noise_is_what_the_flight_says(flight, exact):
    """Attitude errors are small rotations about the body's axes."""
    position, attitude = [], []
    for block in ("heads", "calibration", "validation"):
        noisy, true = (f.tables[f"{block}/trajectory.csv"] for f in (flight, exact))
        names = ["east_m", "north_m", "height_m"]
        position.append((noisy[names] - true[names]).to_numpy() / [0.02, 0.02, 0.015])
        for a, b in zip(noisy.itertuples(), true.itertuples(), strict=True):
            turn = eq_6(b.omega_deg, b.phi_deg, b.kappa_deg) @ (
                eq_6(a.omega_deg, a.phi_deg, a.kappa_deg).T
            )
            vector = np.degrees([turn[2, 1], turn[0, 2], turn[1, 0]])
            attitude.append(vector / [0.005, 0.005, 0.008])
    assert_standard_normal(np.concatenate(position))
    assert_standard_normal(np.array(attitude))


def test_gnss_shift_and_drift_reach_the_trajectory_only(exact):
    options = replace(
        NO_NOISE, gnss_shift_m=(0.1, -0.2, 0.3), gnss_drift_m_per_min=(0.0, 0.01, 0.0)
    )
    shifted = acx4sim.acx4_ideal(seed=1, options=options)
    for path, table in exact.tables.items():
        if not path.endswith("trajectory.csv"):
            pd.testing.assert_frame_equal(table, shifted.tables[path])
            continue
        names = ["east_m", "north_m", "height_m"]
        error = (shifted.tables[path][names] - table[names]).to_numpy()
        minutes = ((table["time_s"] - table["time_s"].iloc[0]) / 60).to_numpy()
        expected = np.array([0.1, -0.2, 0.3]) + np.outer(minutes, [0.0, 0.01, 0.0])
        assert_allclose(error, expected, atol=5e-6)
    assert shifted.truth["exposures"] == exact.truth["exposures"]
