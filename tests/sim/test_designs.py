"""The simulator of flights, against the paper's printed numbers and computations of its own.

Nothing here uses the library's geometry: what the library and the simulator agree on is tested
where the library is.
"""

import itertools
import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from pyproj import CRS, Transformer
from scipy.stats import chi2

import acx4sim
from acx4sim import earth
from acx4sim.designs import SYNTHETIC, acx4_plan, single_head_plan
from acx4sim.optics import lens

EXACT = acx4sim.Options(image_noise=0, control_noise=0, gnss_noise=0, attitude_noise=0)


@pytest.fixture(scope="module")
def flight():
    return acx4sim.acx4(seed=1)


@pytest.fixture(scope="module")
def exact():
    return acx4sim.acx4(seed=1, options=EXACT)


@pytest.fixture(scope="module")
def exact_single_head():
    return acx4sim.single_head(seed=1, options=EXACT)


def all_bytes(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


# --- the paper's numbers ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("block", "strips"),
    [("heads", [10, 7, 7, 7]), ("calibration", [10, 10, 10, 11, 11]), ("validation", None)],
)
def test_blocks_have_the_papers_strips(flight, block, strips):
    images = flight.tables[f"{block}/images.csv"].drop_duplicates("exposure")
    sizes = images.groupby("strip", sort=False).size().tolist()
    if strips is None:
        assert len(sizes) == 20
        assert sum(sizes) == 268
    else:
        assert sizes == strips


def test_every_head_exposes_at_every_exposure(flight):
    cameras = flight.tables["heads/images.csv"].groupby("exposure")["camera"].agg(tuple)
    assert set(cameras) == {("CAM1", "CAM2", "CAM3", "CAM4")}
    assert len(cameras) == 31


def test_control_points_are_56_and_targets_36(flight):
    control = flight.tables["control_points.csv"]
    assert len(control) == 56
    assert (control[["sigma_east_m", "sigma_north_m", "sigma_height_m"]] == [0.01, 0.01, 0.02]).all(
        axis=None
    )
    assert len(flight.tables["validation/control_points.csv"]) == 36


def ground_sampling_distance(flight, block):
    """Return for every strip the median ratio of ground to image distances, m per pixel."""
    measured = flight.tables[f"{block}/image_points.csv"].merge(
        flight.tables[f"{block}/images.csv"], on="image"
    )
    control = pd.DataFrame.from_dict(flight.truth["control_points"], orient="index")
    ratios = {}
    measured = measured[measured["point"].isin(control.index)]
    for (strip, _), points in measured.groupby(["strip", "image"]):
        ground = np.diff(control.loc[points["point"], [0, 1]].to_numpy(), axis=0)
        image = np.diff(points[["col_px", "row_px"]].to_numpy(), axis=0)
        ratios.setdefault(strip, []).extend(np.hypot(*ground.T) / np.hypot(*image.T))
    return {strip: np.median(values) for strip, values in ratios.items()}


@pytest.mark.parametrize(
    ("block", "printed_m"),
    [
        ("heads", [0.22, 0.13, 0.13, 0.13]),
        ("calibration", [0.08, 0.08, 0.08, 0.11, 0.11]),
    ],
)
def test_ground_sampling_distance_is_near_the_papers(exact, block, printed_m):
    """12 %: the heads look aside by 18 degrees, and the paper's numbers are rounded."""
    found = ground_sampling_distance(exact, block)
    assert_allclose([found[str(i)] for i in range(1, len(printed_m) + 1)], printed_m, rtol=0.12)


def test_ground_sampling_distance_of_the_validation_is_10_cm(exact):
    # distances between targets of one image are few there: heights and focal length instead
    assert_allclose(1300 * 5.6e-6 / exact.truth["cameras"]["SYN"]["f_mm"] * 1e3, 0.10, atol=0.005)


@pytest.mark.parametrize("block", ["heads", "calibration", "validation"])
def test_aircraft_flies_at_the_planned_heights(exact, block):
    """Scatter is at most 10 m, mean ground is at 900 m."""
    plan = acx4_plan()
    planned = np.concatenate([[s.height_m] * s.n for s in plan.blocks[block].strips])
    flown = exact.tables[f"{block}/trajectory.csv"]["height_m"] - 900
    assert_allclose(flown, planned, atol=10.0)


def shared_fraction(flight, block, first, second, size_px):
    """Return the overlap of two images along columns and rows, from their mean parallax."""
    measured = flight.tables[f"{block}/image_points.csv"]
    a = measured[measured["image"] == first].merge(
        measured[measured["image"] == second], on="point"
    )
    shift = np.abs((a[["col_px_x", "row_px_x"]].to_numpy() - a[["col_px_y", "row_px_y"]]).mean())
    return 1 - shift.to_numpy() / size_px


def test_synthetic_images_overlap_by_80_percent(exact):
    """From the mean parallax; 5 % for turbulence and relief."""
    images = exact.tables["calibration/images.csv"]
    strip = images.loc[images["strip"] == "1", "image"].tolist()
    overlap = [
        shared_fraction(exact, "calibration", a, b, [12000, 16200])[0]
        for a, b in itertools.pairwise(strip)
    ]
    assert_allclose(np.mean(overlap), 0.80, atol=0.05)


def test_every_head_overlaps_by_80_percent_along_the_strip(exact):
    """The heads are turned by 90 degrees, so that rows run along the flight."""
    images = exact.tables["heads/images.csv"]
    for camera in ("CAM1", "CAM2", "CAM3", "CAM4"):
        mine = images[images["camera"] == camera]
        strip = mine.loc[mine["strip"] == "3", "image"].tolist()
        overlap = [
            shared_fraction(exact, "heads", a, b, [8984, 6732])[1]
            for a, b in itertools.pairwise(strip)
        ]
        assert_allclose(np.mean(overlap), 0.80, atol=0.05)


@pytest.mark.parametrize(
    ("block", "spacing", "width_mm", "f", "lateral"),
    [
        ("heads", 638.0, 59.8, 74.0, 0.50),
        ("calibration", 609.0, 90.72, 74.4404, 0.50),
        ("validation", 1109.0, 90.72, 74.4404, 0.30),
    ],
)
def test_lateral_overlap_is_the_papers(exact, block, spacing, width_mm, f, lateral):
    """Mean width of a head in the synthetic frame: 59.8 mm, from its footprint there."""
    plan = acx4_plan().blocks[block]
    images = exact.tables[f"{block}/images.csv"].drop_duplicates("exposure")
    place = exact.tables[f"{block}/trajectory.csv"].merge(images, on="exposure")
    azimuth = np.radians(plan.azimuth_deg)
    left = -place["east_m"] * np.cos(azimuth) + place["north_m"] * np.sin(azimuth)
    middle = left.groupby(place["strip"].astype(int)).mean()
    height = place.groupby(place["strip"].astype(int))["height_m"].mean() - 900
    gaps = np.abs(np.diff(middle))[height.diff().abs().to_numpy()[1:] < 50]
    gaps = gaps[gaps > 100]
    assert_allclose(gaps, spacing, atol=12.0)
    low = height.min()
    assert_allclose(1 - gaps.mean() / (width_mm / f * low), lateral, atol=0.02)


def test_strips_are_flown_in_the_papers_directions(exact):
    def directions(block):
        table = exact.tables[f"{block}/trajectory.csv"].merge(
            exact.tables[f"{block}/images.csv"].drop_duplicates("exposure"), on="exposure"
        )
        way = table.groupby("strip", sort=False)[["east_m", "north_m"]].agg(
            lambda x: x.iloc[-1] - x.iloc[0]
        )
        return np.sign(way["north_m"]).astype(int).tolist()

    assert len(set(directions("heads"))) == 1
    low_and_high = directions("calibration")
    assert low_and_high[0] == -low_and_high[1] == low_and_high[2]
    assert low_and_high[3] == -low_and_high[4]


def test_relief_is_100_to_150_m_over_the_calibration_field():
    grid = earth.Grid(crs="EPSG:31982")
    east, north = np.meshgrid(
        671_000 + np.linspace(-2000, 2000, 80), 7_189_500 + np.linspace(-2000, 2000, 80)
    )
    x_g = np.column_stack([east.ravel(), north.ravel(), np.zeros(east.size)])
    height = earth.terrain_height(grid.geodetic_from_grid(x_g), 900.0)
    assert 100 < np.ptp(height) < 155


def test_tie_points_are_as_many_as_asked_for(flight):
    for block, wanted in (("heads", 500), ("calibration", 700)):
        measured = flight.tables[f"{block}/image_points.csv"].merge(
            flight.tables[f"{block}/images.csv"], on="image"
        )
        ties = measured[measured["point"].str.startswith("T")]
        rays = ties.groupby(["camera", "point"]).size()
        enough = (rays >= 3).groupby("camera").sum()
        assert enough.min() >= wanted
        assert enough.max() < 1.35 * wanted


def test_heads_share_tie_points_at_one_exposure(flight):
    """What the refinement of the relative orientation lives on."""
    measured = flight.tables["heads/image_points.csv"].merge(
        flight.tables["heads/images.csv"], on="image"
    )
    heads = measured.groupby(["exposure", "point"])["camera"].agg(tuple)
    pairs = heads[heads.map(len) >= 2].value_counts()
    for pair in [("CAM1", "CAM2"), ("CAM3", "CAM4"), ("CAM1", "CAM4"), ("CAM2", "CAM3")]:
        assert pairs[pair] > 200


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_validation_gives_about_the_papers_262_pairs(seed):
    options = acx4sim.Options(blocks=("validation",))
    measured = acx4sim.acx4(seed=seed, options=options).tables["validation/image_points.csv"]
    rays = measured.groupby("point").size()
    assert len(rays) == 36
    assert rays.min() >= 2
    assert 230 <= (rays * (rays - 1) // 2).sum() <= 295
    assert measured["sigma_px"].between(1, 2).all()


# --- geometry --------------------------------------------------------------------------------


def test_published_vector_of_a_grid_attitude():
    """A worked example on GRS80 near Curitiba, computed in two other ways.

    Its body is forward-right-down and its angles are the camera's, its lever arm of
    (0.223, -0.399, -0.201) therefore (0.223, 0.399, 0.201) in the contract's axes.
    """
    grid = earth.Grid(crs="EPSG:31982")
    llh = np.array([[np.radians(-25.45), np.radians(-49.25), 2250.0]])
    gamma = grid.convergence(llh)
    assert_allclose(np.degrees(gamma), -0.7522096122, atol=1e-9)
    R_enu_b = earth.attitude_from_rph(np.radians([[1.25, -2.5, 37.0]]))
    R_b_c = earth.rotation_from_opk_deg((0.49665, -1.59457, 0.07984))
    opk = np.degrees(earth.opk_from_attitude(R_enu_b * R_b_c, gamma))
    assert_allclose(opk, [[0.354061763548, 1.934249251200, 52.259248857567]], atol=2e-9)
    x_g = grid.grid_from_geodetic(llh)
    assert_allclose(x_g, [[675960.7544160, 7184067.8846027, 2250.0]], atol=1e-6)
    lever = R_enu_b.apply([0.223, 0.399, 0.201])
    assert_allclose(lever[0, 2], 0.1997297, atol=1e-6)


def test_ecef_is_projs():
    grid = earth.Grid(crs="EPSG:31982")
    llh = np.array([[-0.44, -0.86, 1234.5], [0.1, 0.2, 0.0]])
    geocentric = Transformer.from_crs("EPSG:4989", "EPSG:4988", always_xy=True)
    expected = geocentric.transform(np.degrees(llh[:, 1]), np.degrees(llh[:, 0]), llh[:, 2])
    assert_allclose(grid.ecef_from_geodetic(llh), np.column_stack(expected), atol=1e-8)


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


@pytest.mark.parametrize("name", ["acx4", "single-head"])
def test_pixels_follow_from_the_truth_by_hand(name, exact, exact_single_head):
    """Every fortieth surveyed point; truth is rounded to 1 um, the axes are good to 1e-8."""
    flight = exact if name == "acx4" else exact_single_head
    toml = tomllib.loads(flight.toml)
    crs = CRS.from_user_input(toml["crs"])
    geocentric = "EPSG:4988" if name == "acx4" else "EPSG:4978"
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


# --- lens ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "camera", [*acx4_plan().cameras.values(), single_head_plan().cameras["CAM"]]
)
def test_distortion_is_inverted_to_1e_12_mm(camera):
    half = camera.pixel_um / 2000 * np.array([camera.width_px, camera.height_px])
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    ideal = half * np.column_stack([x.ravel(), y.ravel()])
    xy = lens.measured_from_ideal(camera, ideal)
    dxy, _ = lens.correction(camera, xy)
    assert_allclose(xy - dxy, ideal, atol=1e-12, rtol=0)


def test_a_lens_that_folds_is_refused():
    fold = replace(SYNTHETIC, k1=1e-3)
    with pytest.raises(ValueError, match="cannot be inverted"):
        lens.measured_from_ideal(fold, np.array([[30.0, 40.0]]))


def test_a_point_behind_the_camera_is_nan():
    assert np.isnan(lens.project(SYNTHETIC, np.array([[0.0, 0.0, 10.0]]))).all()


# --- measurements ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["acx4", "single-head"])
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


def test_apriori_states_the_true_sigma():
    options = acx4sim.Options(image_noise=2.0, gnss_noise=0.0, blocks=("calibration",))
    apriori = tomllib.loads(acx4sim.acx4(options=options).toml)["apriori"]
    assert apriori == {
        "image_point_px": 1.0,
        "gnss_horizontal_m": 0.02,
        "gnss_vertical_m": 0.015,
        "roll_pitch_deg": 0.005,
        "heading_deg": 0.008,
    }


def test_noise_of_one_kind_leaves_the_others_alone(flight):
    options = acx4sim.Options(control_noise=0.0)
    other = acx4sim.acx4(seed=1, options=options)
    for path, table in flight.tables.items():
        same = table.equals(other.tables[path])
        assert same == (not path.endswith("control_points.csv"))


def test_gnss_shift_and_drift_reach_the_trajectory_only(exact):
    options = replace(EXACT, gnss_shift_m=(0.1, -0.2, 0.3), gnss_drift_m_per_min=(0.0, 0.01, 0.0))
    shifted = acx4sim.acx4(seed=1, options=options)
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


# --- files -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["acx4", "single-head"])
def test_same_seed_gives_the_same_bytes(name, tmp_path):
    for folder in ("a", "b"):
        acx4sim.write(acx4sim.DESIGNS[name](seed=7), tmp_path / folder / "flight")
    assert all_bytes(tmp_path / "a") == all_bytes(tmp_path / "b")
    acx4sim.write(acx4sim.DESIGNS[name](seed=8), tmp_path / "c" / "flight")
    a, c = all_bytes(tmp_path / "a"), all_bytes(tmp_path / "c")
    differing = {name for name in a if a[name] != c[name]}
    assert all(name in differing for name in a if "image_points" in name or "trajectory" in name)


def test_truth_lies_beside_the_flight_and_never_inside(flight, tmp_path):
    acx4sim.write(flight, tmp_path / "my_flight")
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["my_flight", "my_flight.truth.json"]
    assert not [path for path in all_bytes(tmp_path / "my_flight") if "truth" in path]
    truth = json.loads((tmp_path / "my_flight.truth.json").read_text())
    assert truth["seed"] == 1
    assert truth["cameras"]["SYN"]["lever_y_m"] == -0.399
    assert truth["heads_in_synthetic_frame"]["CAM2"]["kappa_deg"] == -93.408507
    assert truth["rendered_boresight"]["boresight_phi_deg"] == 0.0
    assert len(truth["exposures"]["validation"]) == 268
    assert len(truth["control_points"]) == 56 + 36


def test_tables_read_back_as_they_were(flight, tmp_path):
    acx4sim.write(flight, tmp_path / "f")
    for path, table in flight.tables.items():
        back = pd.read_csv(tmp_path / "f" / path, dtype={"strip": str})
        pd.testing.assert_frame_equal(back, table, check_dtype=False, check_exact=True)


@pytest.mark.parametrize("content", ["file", "folder"])
def test_an_existing_flight_is_not_touched(flight, tmp_path, content):
    target = tmp_path / "f"
    if content == "file":
        target.write_text("mine")
    else:
        target.mkdir()
        (target / "mine.txt").write_text("mine")
    before = all_bytes(tmp_path)
    with pytest.raises(FileExistsError, match="exists already and is not an empty folder"):
        acx4sim.write(flight, target)
    assert all_bytes(tmp_path) == before


def test_an_empty_folder_is_filled(flight, tmp_path):
    (tmp_path / "f").mkdir()
    acx4sim.write(flight, tmp_path / "f")
    assert (tmp_path / "f" / "flight.toml").exists()


def test_a_failure_while_writing_leaves_nothing(flight, tmp_path):
    broken = replace(flight, truth={"not JSON": object()})
    with pytest.raises(TypeError):
        acx4sim.write(broken, tmp_path / "f")
    assert list(tmp_path.iterdir()) == []


def test_head_mounts_are_table_1_rounded(flight):
    cameras = tomllib.loads(flight.toml)["cameras"]
    assert cameras["CAM1"] == {
        "width_px": 8984,
        "height_px": 6732,
        "pixel_um": 6.0,
        "focal_mm": 74.0,
        "mount_omega_deg": -14.8,
        "mount_phi_deg": 12.8,
        "mount_kappa_deg": 93.0,
    }
    assert "mount_omega_deg" not in cameras["SYN"]


def test_blocks_can_be_simulated_alone(flight):
    options = acx4sim.Options(blocks=("calibration",))
    alone = acx4sim.acx4(seed=1, options=options)
    assert set(alone.tables) == {
        "control_points.csv",
        "calibration/images.csv",
        "calibration/image_points.csv",
        "calibration/trajectory.csv",
    }
    for path, table in alone.tables.items():
        pd.testing.assert_frame_equal(table, flight.tables[path])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: acx4sim.acx4(seed=-1), "seed must be zero or positive"),
        (lambda: acx4sim.Options(image_noise=-1.0), "image_noise must be"),
        (lambda: acx4sim.Options(tie_points={"head": 5}), "tie_points: block 'head'"),
        (
            lambda: acx4sim.single_head(options=acx4sim.Options(blocks=("heads",))),
            r"blocks \['heads'\] asked for",
        ),
    ],
)
def test_misuse_is_a_value_error(make, message):
    with pytest.raises(ValueError, match=message):
        make()
