"""The flights that can be simulated, and their folders."""

import itertools
import json
import tomllib

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4sim import earth
from acx4sim.designs import acx4_plan
from acx4sim.plan import GrossErrors

ANGLES = ("omega", "phi", "kappa")


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
    measured = acx4sim.acx4_ideal(seed=seed, options=options).tables["validation/image_points.csv"]
    rays = measured.groupby("point").size()
    assert len(rays) == 36
    assert rays.min() >= 2
    assert 230 <= (rays * (rays - 1) // 2).sum() <= 295
    assert measured["sigma_px"].between(1, 2).all()


def test_the_ideal_cameras_mount_is_table_3_rounded_and_turns_the_heads_with_it(flight):
    cameras = tomllib.loads(flight.toml)["cameras"]
    declared = {key: value for key, value in cameras["SYN"].items() if "mount" in key}
    assert declared == {"mount_omega_deg": 0.5, "mount_phi_deg": -1.6, "mount_kappa_deg": 0.1}
    R_b_s = earth.rotation_from_opk_deg(tuple(declared.values()))
    for name, angles in flight.truth["heads_in_synthetic_frame"].items():
        true = flight.truth["cameras"][name]
        boresight = [true[f"boresight_{angle}_deg"] for angle in ANGLES]
        R_s_h = R_b_s.inv() * earth.rotation_from_opk_deg(tuple(boresight))
        assert_allclose(R_s_h.as_euler("XYZ", degrees=True), list(angles.values()), atol=1e-9)
        mount = [cameras[name][f"mount_{angle}_deg"] for angle in ANGLES]
        assert_allclose(mount, boresight, atol=0.051)


def test_the_ideal_design_has_the_trajectories_and_targets_of_the_other(flight, in_heads):
    for path, table in flight.tables.items():
        if path.endswith(("trajectory.csv", "control_points.csv")):
            pd.testing.assert_frame_equal(table, in_heads.tables[path])


@pytest.mark.parametrize("block", ["calibration", "validation"])
def test_heads_measure_what_the_frame_of_the_ideal_camera_shows(flight, in_heads, block):
    """Nothing else, and hardly less: points near the border of every head that sees them."""
    shown, measured = (seen_at(flown, block) for flown in (flight, in_heads))
    assert set(measured.index) <= set(shown.index)
    assert len(measured) > 0.97 * len(shown)
    assert set(measured) <= {1, 2, 3, 4}
    assert (measured > 1).mean() > 0.1  # where heads overlap, all of them measure


def seen_at(flown, block):
    """Return in how many images of an exposure every point of it is measured."""
    points, images = (flown.tables[f"{block}/{name}.csv"] for name in ("image_points", "images"))
    return points.merge(images, on="image").groupby(["exposure", "point"]).size()


def test_a_flight_measured_in_heads_says_so_and_has_no_true_synthetic_camera(in_heads):
    toml = tomllib.loads(in_heads.toml)
    assert toml["synthetic"]["measured_in"] == "heads"
    mount = [toml["cameras"]["SYN"][f"mount_{angle}_deg"] for angle in ANGLES]
    assert mount == [0.49665, -1.59457, 0.07984]  # Table 3
    assert set(in_heads.truth["cameras"]) == {"CAM1", "CAM2", "CAM3", "CAM4"}
    images = in_heads.tables["calibration/images.csv"]
    assert images["image"].iloc[0] == "C1-01_CAM1"


def test_noise_of_the_other_sign_is_the_same_noise():
    """Errors of both flights add to zero, but for the order of small rotations; sigmas agree."""
    kinds = ("image_noise", "control_noise", "gnss_noise", "attitude_noise")
    plus, exact, minus = (
        acx4sim.DESIGNS["single-head"](
            seed=1,
            options=acx4sim.Options(
                blocks=("calibration",),
                tie_points={"calibration": 50},
                **dict.fromkeys(kinds, factor),
            ),
        )
        for factor in (1.0, 0.0, -1.0)
    )
    assert plus.toml == minus.toml
    for path, table in exact.tables.items():
        numbers = table.select_dtypes("number")
        error, other = (f.tables[path][numbers.columns] - numbers for f in (plus, minus))
        assert path.endswith("images.csv") or np.abs(error.to_numpy()).max() > 1e-3
        np.testing.assert_allclose(error + other, 0.0, atol=1e-5)  # files have six decimals


# --- Mistakes in measurements are those that the truth lists, and no others


BLOCK = ("calibration",)


SHIFT = ["east_m", "north_m", "height_m"]


def acx4(**options):
    return acx4sim.acx4_ideal(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def single_head(**options):
    return acx4sim.DESIGNS["single-head"](seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


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
