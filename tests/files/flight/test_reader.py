"""Reading a flight: one that has nothing wrong with it, and what is said of others."""

from __future__ import annotations

# ruff: noqa: E501 a message stands on one line
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import acx4sim
from acx4files import flight
from acx4files.flight import reader
from acx4files.flight.reader import from_tables
from acx4files.flight.settings import Apriori, Synthetic, camera_of, camera_table, camera_toml
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior, correct, xy_from_colrow
from acx4lib.geometry.collinearity import pinhole, refraction_lift, to_camera
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem
from acx4lib.geometry.parameters import Prior
from support import blocks
from support.flights import written
from support.flights.simulated import fly
from support.flights.written import control_points, exposures, write_flight


def residuals_px(block: Block) -> np.ndarray:
    """Return how far surveyed points project from where they were measured."""
    x_m = np.full((len(block.points), 3), np.nan)
    x_m[block.control.point_idx] = block.control.x_m
    x_m[block.check.point_idx] = block.check.x_m
    points = block.image_points
    points = points[np.isfinite(x_m[points.point_idx, 0])]
    out = np.empty((len(points), 2))
    for i, camera in enumerate(block.cameras):
        mine = block.images.camera_idx[points.image_idx] == i
        T_m_c = block.T_m_b_images[points.image_idx[mine]] @ camera.T_b_c
        ideal = pinhole(camera.interior.f, to_camera(T_m_c, x_m[points.point_idx[mine]]))
        measured = correct(camera.interior, xy_from_colrow(camera, points.colrow[mine]))
        out[mine] = (ideal - measured) / camera.pixel_mm
    return out


def append(path: Path, text: str) -> None:
    path.write_text(path.read_text() + text)


def change(path: Path, **columns: object) -> None:
    pd.read_csv(path).assign(**columns).to_csv(path, index=False)


@pytest.mark.parametrize("form", ["grid", "geographic"])
def test_either_form_of_trajectory_puts_control_points_where_they_were_measured(tmp_path, form):
    read = flight.read(write_flight(tmp_path, form=form))
    # written with three decimals of a pixel and 1e-15 of a degree
    assert_allclose(residuals_px(read.calibration), 0.0, atol=2e-3)


def test_a_flight_has_the_blocks_whose_folders_are_there(tmp_path):
    read = flight.read(write_flight(tmp_path, blocks=("heads", "validation")))
    assert read.heads is not None
    assert read.calibration is None
    assert read.validation is not None
    assert [camera.name for camera in read.heads.cameras] == ["LEFT", "RIGHT"]
    assert [camera.name for camera in read.validation.cameras] == ["CAM"]
    assert len(read.heads.images) == 12
    assert len(read.heads.trajectory) == 6
    assert read.synthetic == Synthetic(camera="CAM", heads=("LEFT", "RIGHT"))


def test_stages_estimate_what_the_paper_estimates_by_default(tmp_path):
    read = flight.read(write_flight(tmp_path))
    assert read.estimate_heads == ("xp", "yp", "k1", "p1", "p2")
    assert read.estimate_mounting == ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")
    assert read.fix == ()
    assert read.weights == "given"
    assert read.gnss == ()
    assert read.refraction == "none"
    assert read.apriori == Apriori()


def of_refraction(folder, line=""):
    toml = folder / "flight.toml"
    toml.write_text(line + toml.read_text())
    return [note for note in flight.read(folder).notes if "refraction" in note]


def test_what_it_costs_to_say_nothing_of_refraction_is_a_note(tmp_path):
    (note,) = of_refraction(write_flight(tmp_path))
    camera = flight.read(tmp_path).cameras["CAM"]
    r, nadir = np.array([[0.0, 0.0, 1900.0]]), np.array([[0.0, 0.0, 900.0]])
    at_nadir_um = 1000 * camera.interior.f * refraction_lift(r, nadir)[0] / 1000.0
    said = re.search(r"from 1000 m this makes f (\S+) µm too large", note)
    assert float(said[1]) == pytest.approx(at_nadir_um, rel=0.1)


@pytest.mark.parametrize(
    "line", ["simulated = true\n", 'refraction = "none"\n', 'refraction = "standard"\n']
)
def test_a_flight_that_speaks_of_refraction_or_is_simulated_gets_no_note(tmp_path, line):
    assert of_refraction(write_flight(tmp_path), line) == []


def test_a_camera_has_the_units_of_the_library(tmp_path):
    camera = flight.read(write_flight(tmp_path)).cameras["CAM"]
    assert camera.pixel_mm == 0.005
    assert camera.interior.k1 == 1e-5
    assert_allclose(camera.T_b_c.r, [0.0, 0.0, 0.2])
    # kappa = 90 degrees: image x points along body y, left
    assert_allclose(camera.T_b_c.R @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)


def test_sigma_columns_go_before_the_defaults(tmp_path):
    write_flight(tmp_path)
    append(tmp_path / "flight.toml", "[apriori]\nimage_point_px = 0.3\nheading_deg = 0.02\n")
    change(tmp_path / "calibration/trajectory.csv", sigma_height_m=0.07, sigma_roll_deg=0.01)
    change(tmp_path / "control_points.csv", sigma_north_m=0.0)
    block = flight.read(tmp_path).calibration
    assert_allclose(block.image_points.sigma_px, 0.3)
    assert_allclose(block.trajectory.sigma_position[0], [0.05, 0.05, 0.07])
    assert_allclose(np.degrees(block.trajectory.sigma_attitude[0]), [0.01, 0.005, 0.02])
    assert_allclose(block.control.sigma_m[0], [0.01, 0.0, 0.02])
    change(tmp_path / "calibration/image_points.csv", sigma_px=0.7)
    assert_allclose(flight.read(tmp_path).calibration.image_points.sigma_px, 0.7)


def test_the_smallest_angle_of_tie_points_is_that_of_the_file_or_two_degrees(tmp_path):
    write_flight(tmp_path)
    assert flight.read(tmp_path).calibration.smallest_angle == np.radians(2.0)
    append(tmp_path / "flight.toml", "[adjustment]\nsmallest_angle_deg = 0.5\n")
    assert_allclose(np.degrees(flight.read(tmp_path).calibration.smallest_angle), 0.5)


def test_check_points_are_no_control_and_in_validation_all_are_check_points(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    change(tmp_path / "control_points.csv", role=["check", "control", ""] * 3)
    read = flight.read(tmp_path)
    names = read.calibration.points
    assert {names[i] for i in read.calibration.check.point_idx} == {"G0", "G3", "G6"}
    assert len(read.calibration.control) == 6
    assert len(read.validation.control) == 0
    assert len(read.validation.check) == 9


def test_control_stands_at_its_coordinates_with_sigma_along_the_grid(tmp_path):
    block = flight.read(write_flight(tmp_path)).calibration
    table = (
        control_points().set_index("point").loc[[block.points[i] for i in block.control.point_idx]]
    )
    enh = table[["east_m", "north_m", "height_m"]].to_numpy()
    assert_allclose(block.frame.to_grid(block.control.x_m), enh, atol=1e-6)  # m
    # a step of 1 m to grid north moves a point along the second row of R_g_m, but for the
    # grid's scale and the curvature of the ground
    step = block.frame.from_grid(enh + np.array([0.0, 1.0, 0.0])) - block.control.x_m
    assert_allclose(np.einsum("kij,kj->ki", block.control.R_g_m, step), [[0, 1, 0]] * 9, atol=1e-3)


def test_a_block_takes_its_own_control_points(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    own = control_points().iloc[:4]
    own.to_csv(tmp_path / "validation/control_points.csv", index=False)
    read = flight.read(tmp_path)
    assert len(read.validation.check) == 4
    assert len(read.calibration.control) == 9


def test_the_mapping_frame_has_its_origin_amid_the_exposures_that_are_used(tmp_path):
    write_flight(tmp_path)
    append(tmp_path / "calibration/trajectory.csv", "STRAY,500000,7000000,1900,0,0,0\n")
    block = flight.read(tmp_path).calibration
    table = exposures()[["east_m", "north_m"]].to_numpy().mean(axis=0)
    east_north = GridSystem(crs="EPSG:31982").grid_from_lonlat(block.frame.origin[None])[0]
    assert_allclose(east_north, table, atol=0.01)  # m; the grid is not quite flat
    assert len(block.trajectory) == 6


@pytest.mark.parametrize(
    ("measured", "surveyed"),
    [
        ("G1", "g1"),
        ("G1", "G1.0"),
        ("G1", "G1 "),
        ("G1", "G 1"),
        ("G1", "G-01"),
        ("G\u00e91", "Ge\u03011"),
    ],
)
def test_a_control_point_that_is_measured_under_another_writing_is_said(
    tmp_path, measured, surveyed
):
    write_flight(tmp_path)
    points, control = tmp_path / "calibration/image_points.csv", tmp_path / "control_points.csv"
    points.write_text(points.read_text().replace(",G1,", f",{measured},"), encoding="utf-8")
    control.write_text(control.read_text().replace("G1,", f"{surveyed},"), encoding="utf-8")
    assert (
        "calibration: 1 of 9 control points seem to be measured as tie points, under names that "
        f"are written otherwise: {surveyed!r} as {measured!r}"
    ) in flight.read(tmp_path).notes


def test_a_crs_with_heights_that_are_not_the_flights_is_said(tmp_path):
    write_flight(tmp_path)
    toml = tmp_path / "flight.toml"
    toml.write_text(toml.read_text().replace("EPSG:31982", "EPSG:31982+5773"))
    assert (
        "heights are ellipsoidal, as heights in flight.toml says, and not those of "
        "EPSG:31982+5773, EGM96 height"
    ) in flight.read(tmp_path).notes


def test_what_is_odd_but_allowed_is_a_note(tmp_path):
    write_flight(tmp_path)
    block = tmp_path / "calibration"
    append(block / "image_points.csv", "E0_CAM,T1,10,10\n\n \n,,,\n")
    append(
        block / "trajectory.csv", "E6,669850.0,7188100.0,1900.0,0,0,0\nE7,669850,7188100,1,0,0,0\n"
    )
    append(block / "images.csv", "E6_CAM,CAM,E6,2\n")
    append(tmp_path / "control_points.csv", "FAR,900000,7188000,900\n")
    change(block / "trajectory.csv", sigma_eats_m=1.0, sensor="x")
    assert flight.read(tmp_path).notes[:-1] == (
        f"{block}/image_points.csv: 3 blank lines at the end",
        f"{block}/trajectory.csv: column 'sigma_eats_m' is not read (did you mean 'sigma_east_m'?)",
        f"{block}/trajectory.csv: column 'sensor' is not read",
        "calibration: 1 of 1 tie points are measured only once",
        "calibration: 1 of 7 images have no measurements: E6_CAM",
        "calibration: 1 of 8 trajectory rows belong to no image",
        "calibration: 1 of 10 control points are not measured",
    )


def test_a_laboratory_sigma_of_what_is_held_is_noted(tmp_path):
    write_flight(tmp_path)
    toml = tmp_path / "flight.toml"
    lines = toml.read_text().replace("lever_z_m", "focal_sigma_mm = 0.02\nlever_z_m")
    assert "focal_sigma_mm = 0.02" in lines
    toml.write_text(lines)
    assert not any("focal_sigma_mm" in note for note in flight.read(tmp_path).notes)
    toml.write_text(f'{lines}\n[stages.mounting]\nestimate = ["xp_mm", "yp_mm"]\n')
    note = "CAM: stage mounting holds focal_mm, focal_sigma_mm takes no part in it"
    assert note in flight.read(tmp_path).notes


def test_images_with_too_few_points_to_orient_them_are_named(tmp_path):
    """One point leaves an image's orientation open: conditions of 1e17 came from it."""
    write_flight(tmp_path)
    table = tmp_path / "calibration" / "image_points.csv"
    rows = pd.read_csv(table)
    assert not [note for note in flight.read(tmp_path).notes if "orient no image" in note]
    of = rows["image"] == "E0_CAM"
    rows[~of | (rows.index == rows.index[of][0])].to_csv(table, index=False)
    (note,) = [note for note in flight.read(tmp_path).notes if "orient no image" in note]
    assert note == (
        "calibration: 1 of 6 images have fewer than 3 measurements, which orient no image by "
        "themselves: E0_CAM"
    )


def test_byte_order_mark_crlf_spaces_and_column_order_change_nothing(tmp_path):
    plain = flight.read(write_flight(tmp_path / "a")).calibration
    write_flight(tmp_path / "b")
    for path in (tmp_path / "b").rglob("*.*"):
        if path.suffix == ".csv":
            table = pd.read_csv(path)
            table[table.columns[::-1]].rename(columns=" {} ".format).to_csv(path, index=False)
        data = path.read_bytes().replace(b"\n", b"\r\n")
        path.write_bytes(b"\xef\xbb\xbf" + data)
    block = flight.read(tmp_path / "b").calibration
    assert block.points == plain.points
    assert_allclose(block.image_points.colrow, plain.image_points.colrow)
    assert_allclose(block.trajectory.T_m_b.R, plain.trajectory.T_m_b.R)


def test_names_are_text_compared_exactly(tmp_path):
    write_flight(tmp_path)
    for name in ("control_points.csv", "calibration/image_points.csv"):
        path = tmp_path / name
        path.write_text(path.read_text().replace("G0,", "007,").replace("G1,", "7.0,"))
    append(tmp_path / "control_points.csv", "7,670000,7188000,900\n")
    read = flight.read(tmp_path)
    assert {"007", "7.0"} <= set(read.calibration.points)
    assert "7" not in read.calibration.points


def test_pixels_are_found_where_images_csv_names_them(tmp_path):
    write_flight(tmp_path)
    (tmp_path / "calibration/images").mkdir()
    pixels = tmp_path / "calibration/images/a.tif"
    pixels.write_bytes(b"")
    change(tmp_path / "calibration/images.csv", file=["images/a.tif", *[""] * 5])
    files = flight.read(tmp_path).image_files["calibration"]
    assert files == (pixels.resolve(), *[None] * 5)


@pytest.mark.parametrize("heights", ['"geoid.gtx"', "12.5"])
def test_a_geoid_grid_or_an_undulation_raises_all_heights(tmp_path, heights):
    write_flight(tmp_path)
    (tmp_path / "geoid.gtx").write_bytes(constant_gtx(12.5))
    plain = flight.read(tmp_path).calibration
    toml = tmp_path / "flight.toml"
    toml.write_text(toml.read_text().replace('"ellipsoidal"', heights))
    raised = flight.read(tmp_path).calibration
    assert_allclose(raised.control.x_m - plain.control.x_m, [[0, 0, 12.5]] * 9, atol=1e-3)
    assert_allclose(
        raised.trajectory.T_m_b.r[0, 2] - plain.trajectory.T_m_b.r[0, 2], 12.5, atol=1e-3
    )


def constant_gtx(height: float) -> bytes:
    """Return a geoid grid of one height around the small flight."""
    header = np.array([-27.0, -51.0, 0.5, 0.5], dtype=">f8").tobytes()
    size = np.array([7, 7], dtype=">i4").tobytes()
    return header + size + np.full(49, height, dtype=">f4").tobytes()


def test_the_summary_says_what_was_flown(tmp_path):
    read = flight.read(write_flight(tmp_path, blocks=("heads", "calibration")))
    lines = flight.summary(read).splitlines()
    for line in (
        "  CRS            EPSG:31982, SIRGAS 2000 / UTM zone 22S",
        "  heights        ellipsoidal",
        "block calibration",
        "  images         6 at 6 exposures in 2 strips",
        "  measurements   42 of 9 points, 4.7 per point",
        "  surveyed       9 control points, 0 check points",
        "  flying height  1000 to 1000 m above the surveyed points, median 1000",
        "  GSD CAM        20.0 to 20.0 cm, median 20.0",  # 1000 m x 5 um / 25 mm
        # 150 m of 600 m across the image that lies along the flight
        "  overlap        74 to 75 % along the strips, median 74",
    ):
        assert line in lines


EXACT = acx4sim.Options(image_noise=0, control_noise=0, gnss_noise=0, attitude_noise=0)


@pytest.mark.parametrize("design", acx4sim.DESIGNS)
def test_an_exact_simulated_flight_fits_with_its_true_cameras(tmp_path, design):
    """Reader and simulator share no formula: axes, convergence, lens and lever arm agree."""
    flown = acx4sim.DESIGNS[design](seed=1, options=EXACT)
    acx4sim.write(flown, tmp_path / design)
    read = flight.read(tmp_path / design)
    for block in read.blocks.values():
        true = tuple(true_camera(c, flown.truth["cameras"][c.name]) for c in block.cameras)
        # files round to 0.001 px, 1e-6 m (0.1 mm on the ground is 0.001 px) and 1e-7 degrees
        assert_allclose(residuals_px(replace(block, cameras=true)), 0.0, atol=0.01)


def true_camera(camera: Camera, truth: dict[str, float]) -> Camera:
    """Return a camera with the simulator's true parameters."""
    interior = {name: truth[name] for name in ("k1", "k2", "k3", "p1", "p2")}
    opk = np.radians([truth[f"boresight_{name}_deg"] for name in ("omega", "phi", "kappa")])
    return replace(
        camera,
        interior=Interior(f=truth["f_mm"], xp=truth["xp_mm"], yp=truth["yp_mm"], **interior),
        T_b_c=Pose(
            R=rotation_from_opk(opk), r=np.array([truth[f"lever_{name}_m"] for name in "xyz"])
        ),
    )


# --- Flights from tables in memory: the same as from files, and told as clearly when wrong


TEXT = dict.fromkeys(("image", "camera", "exposure", "strip", "point"), str)
CONTROL = written.control_points()
SETTINGS = tomllib.loads(written.HEAD + written.CAMERA.format(*written.MOUNTS["CAM"], name="CAM"))
TABLES = {
    "images": written.images(written.exposures(), ["CAM"]),
    "image_points": written.measure(written.exposures(), CONTROL, ["CAM"]),
    "trajectory": written.exposures(),
}
N = len(TABLES["image_points"])


def changed(table, **columns):
    """The good tables with some columns of one of them replaced, as a dict of arrays."""
    kept = {name: cells.to_numpy() for name, cells in TABLES[table].items()}
    return {**TABLES, table: {**kept, **columns}}


def told(settings=SETTINGS, control=CONTROL, **tables):
    with pytest.raises(FlightError) as caught:
        from_tables(settings, control_points=control, **tables)
    return list(caught.value.problems)


def arrays(value):
    """Every array of a frozen value, with the names of its fields."""
    return {name: one for name, one in vars(value).items() if isinstance(one, np.ndarray)}


# --- what is right ---------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["grid", "geographic"])
@pytest.mark.parametrize("table", [pd.DataFrame, lambda frame: dict(frame.items())])
def test_tables_give_the_flight_that_their_files_give(tmp_path, form, table):
    folder = written.write_flight(tmp_path / "f", blocks=("calibration", "validation"), form=form)
    given = {
        block: {
            name: table(pd.read_csv(folder / block / f"{name}.csv", dtype=TEXT))
            for name in ("images", "image_points", "trajectory")
        }
        for block in ("calibration", "validation")
    }
    control = pd.read_csv(folder / "control_points.csv", dtype=TEXT)
    settings = tomllib.loads((folder / "flight.toml").read_text())
    found = from_tables(settings, control_points=control, **given)
    expected = reader.read(folder)
    assert found.notes == expected.notes
    assert found.sha256.keys() < expected.sha256.keys()
    for name, block in expected.blocks.items():
        mine = found.blocks[name]
        assert (mine.points, mine.images.names) == (block.points, block.images.names)
        for part in ("images", "image_points", "control", "check", "trajectory"):
            for field, values in arrays(getattr(block, part)).items():
                assert_array_equal(getattr(getattr(mine, part), field), values)
        assert_array_equal(mine.trajectory.T_m_b.R, block.trajectory.T_m_b.R)
        assert_array_equal(mine.trajectory.T_m_b.r, block.trajectory.T_m_b.r)


def test_names_may_be_numbers_and_unused_columns_may_stand_there():
    number = {name: i for i, name in enumerate(CONTROL["point"])}
    points = TABLES["image_points"]["point"].map(number)
    found = from_tables(
        SETTINGS,
        control_points=CONTROL.assign(point=CONTROL["point"].map(number), remark="x"),
        calibration=changed("image_points", point=points, file=["a.tif"] * N),
    )
    assert found.calibration.points[0] == "0"
    assert found.notes[:2] == (
        "calibration.image_points: column 'file' is not read",
        "control_points: column 'remark' is not read",
    )


def test_a_standard_deviation_may_be_infinite():
    sigma = np.where(np.arange(N) == 3, np.inf, 0.4)
    found = from_tables(
        SETTINGS, control_points=CONTROL, calibration=changed("image_points", sigma_px=sigma)
    )
    assert_array_equal(found.calibration.image_points.sigma_px, sigma)


def test_numbers_of_numpy_are_good_settings():
    camera = {**SETTINGS["cameras"]["CAM"], "width_px": np.int32(4000), "k1": np.float32(1e-5)}
    settings = {**SETTINGS, "cameras": {"CAM": camera}, "stages": {"mounting": {"fix": ()}}}
    found = from_tables(settings, control_points=CONTROL, calibration=TABLES)
    assert found.cameras["CAM"].width_px == 4000


def test_without_control_points_there_are_none():
    found = from_tables(SETTINGS, calibration=TABLES)
    assert len(found.calibration.control) == 0


def test_a_checksum_tells_tables_apart():
    one, other = (
        from_tables(SETTINGS, calibration=changed("image_points", sigma_px=np.full(N, sigma)))
        for sigma in (0.3, 0.4)
    )
    differ = {name for name in one.sha256 if one.sha256[name] != other.sha256[name]}
    assert differ == {"calibration/image_points.csv"}


# --- what is wrong ---------------------------------------------------------------------------

POINTS = "calibration.image_points"
COL = TABLES["image_points"]["col_px"].to_numpy()
WRONG = [
    ({"sigma_px": 0.5}, f": sigma_px: has shape (); must be one value for each row, shape ({N},)"),
    ({"sigma_px": [0.0] + [0.5] * (N - 1)}, ", row 0: sigma_px: 0.0; must be positive, at most 1e6"),
    ({"sigma_px": np.ones((N, 2))}, f": sigma_px: has shape ({N}, 2); must be one value for each row, shape ({N},)"),
    ({"col_px": COL[:-1]}, f": col_px: has shape ({N - 1},); must be one value for each row, shape ({N},)"),
    ({"col_px": [np.nan, *COL[1:]]}, ", row 0: col_px: is empty; must be a finite number"),
    ({"col_px": [None, *COL[1:]]}, ", row 0: col_px: is empty; must be a finite number"),
    ({"col_px": [10**400, *COL[1:]]}, ", row 0: col_px: '1000"),
    ({"col_px": ["7,5", *COL[1:]]}, ", row 0: col_px: '7,5' (a decimal comma?); must be a finite number"),
    ({"col_px": [True, *COL[1:].tolist()]}, ", row 0: col_px: 'True'; must be a finite number"),
    ({"col_px": [4000.0, *COL[1:]]}, ", row 0: col_px: 4000; must lie on the sensor of CAM, from -0.5 to 3999.5"),
    ({"image": ["E9_CAM", *TABLES["image_points"]["image"][1:]]}, ", row 0: image: 'E9_CAM' is unknown"),
    ({"point": [pd.NA, *TABLES["image_points"]["point"][1:]]}, ", row 0: point: is empty; must be a name"),
    ({"point": ["G1", *TABLES["image_points"]["point"][1:]]}, ", row 1: image, point: 'E0_CAM', 'G1' stands in row 0 already; every image and point once"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "says"), WRONG, ids=[says for _, says in WRONG])
def test_a_wrong_column_is_told_with_table_row_and_cure(columns, says):
    found = told(calibration=changed("image_points", **columns))
    assert len(found) == 1
    assert found[0].startswith(POINTS + says)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (None, "settings: settings: is None; must be a dict"),
        ({**SETTINGS, "crs": None}, "settings: crs: missing; required"),
        ({**SETTINGS, "cameras": {}}, "settings: cameras: no cameras; must hold one table per camera"),
        ({**SETTINGS, "crs": "EPSG:4326"}, "settings: crs: 'EPSG:4326' (WGS 84) is not a projected CRS; must be a projected CRS in metres, or 'local'"),
        ({**SETTINGS, "hights": 1}, "settings: hights: unknown key (did you mean 'heights'?)"),
        ({**SETTINGS, "cameras": {"CAN": SETTINGS["cameras"]["CAM"]}}, "calibration.images, row 0: camera: 'CAM' is unknown (did you mean 'CAN'?); must be a camera of settings"),
    ],
)  # fmt: skip
def test_wrong_settings_are_told_by_their_keys(settings, says):
    assert told(settings, calibration=TABLES)[0].startswith(says)


def test_missing_tables_and_misspelt_ones_are_told():
    assert told() == ["flight: blocks: no block at all; must have one at least: heads, calibration or validation"]  # fmt: skip
    tables = {"images": TABLES["images"], "image_point": 0, "trajectory": TABLES["trajectory"]}
    assert told(calibration=tables) == [
        "calibration: image_point: unknown table (did you mean 'image_points'?); must be one of "
        "images, image_points, trajectory, control_points",
        "calibration: image_points: missing; required",
    ]
    assert told(calibration=TABLES["images"]) == [
        "calibration: tables: is a DataFrame; must be a dict of the tables images, image_points, "
        "trajectory"
    ]
    assert told(calibration={**TABLES, "trajectory": [1, 2]}) == [
        "calibration.trajectory: table: is a list; must be a DataFrame, or a dict of arrays"
    ]


@pytest.mark.parametrize("value", [None, "", "=1", b"x", [1, 2], pd.NA, 1j, pd.Timestamp(0)])
def test_no_cell_however_odd_is_answered_with_an_error_of_python(value):
    cells = np.empty(N, dtype=object)
    cells[:] = COL
    cells[5] = value
    (line,) = told(calibration=changed("image_points", col_px=cells))
    assert line.startswith(f"{POINTS}, row 5: col_px: ")


def test_a_control_point_that_lies_elsewhere_is_noted_with_its_row():
    far = CONTROL.assign(east_m=CONTROL["east_m"] + 3000.0 * (np.arange(9) == 4))
    found = from_tables(SETTINGS, control_points=far, calibration=TABLES)
    assert any("'G4' (row 4)" in note for note in found.notes)


# --- what is said of a CRS far from where it is meant for ------------------------------------


def area_notes(design, crs):
    """Return what is said of a CRS for a flight of the simulator."""
    read = fly(design, seed=1).flight
    grid = GridSystem(crs=crs)
    return list(reader.crs_notes(grid, read.blocks))


def test_a_crs_of_another_country_is_a_note_with_both_places():
    said = area_notes("acx4-ideal", "EPSG:2193")
    assert said[0] == (
        "calibration: the exposures are at 25.4 S 49.3 W, but EPSG:2193 (NZGD2000 / New Zealand "
        "Transverse Mercator 2000) is meant for 47.3 S 166.4 E to 34.1 S 178.6 E, New Zealand - "
        "North Island, South Island, Stewart Island - onshore: is it the right CRS?"
    )
    assert len(said) == 2


@pytest.mark.parametrize(
    "crs",
    [
        "EPSG:31982",  # its own
        "EPSG:31983",  # the next zone to the east begins 1.3 degrees from here
        "EPSG:3857",  # the world
        "+proj=utm +zone=22 +south +ellps=GRS80 +units=m",  # says no area
    ],
)
def test_a_crs_that_fits_or_says_nothing_is_no_note(crs):
    assert not area_notes("acx4-ideal", crs)


@pytest.mark.parametrize(
    ("west", "east", "lon", "inside"),
    [
        (160, -171, 175, True),
        (160, -171, -175, True),
        (160, -171, 150, False),
        (160, -171, 0, False),
    ],
)
def test_places_beside_the_date_line(west, east, lon, inside):
    assert reader.holds((west, -50.0, east, -30.0), lon, -40.0) is inside


def test_degrees_in_the_place_of_metres_are_known():
    at = np.array([13.39, 13.41]), np.array([49.79, 49.81])
    assert reader.of_degrees(GridSystem(crs="EPSG:32633"), *at)
    assert not reader.of_degrees(GridSystem(crs="EPSG:32633"), 1e5 + at[0], 1e5 + at[1])
    assert not reader.of_degrees(GridSystem(crs="EPSG:3857"), *at)  # means Africa's coast, too
    assert not reader.of_degrees(GridSystem(crs="+proj=utm +zone=33 +units=m"), *at)


# --- cameras as flight.toml has them, there and back -----------------------------------------


SIGMA = (0.01, 0.02, 0.03, 1e-4, 2e-4, 3e-4)
LABORATORY = (0.02, np.inf, 0.01)
KNOWN = replace(blocks.SECOND, prior=Prior(declared=(True,) * 6, sigma=SIGMA, interior=LABORATORY))
QUOTED = replace(blocks.CAMERA, name='Phase "One" / 150')


@pytest.mark.parametrize("camera", [blocks.CAMERA, KNOWN, QUOTED], ids=lambda camera: camera.name)
def test_a_camera_comes_back_from_its_lines_in_flight_toml(camera):
    written = tomllib.loads(camera_toml(camera))["cameras"]
    assert written == {camera.name: camera_table(camera)}
    back = camera_of(camera.name, written[camera.name])
    assert (back.width_px, back.height_px) == (camera.width_px, camera.height_px)
    assert_allclose(back.pixel_mm, camera.pixel_mm, rtol=1e-15)
    assert back.interior == camera.interior
    assert_allclose(back.T_b_c.R, camera.T_b_c.R, atol=1e-15)
    assert_allclose(back.T_b_c.r, camera.T_b_c.r, atol=0)
    assert_allclose(back.prior.sigma, camera.prior.sigma, rtol=1e-14)
    assert back.prior.interior == camera.prior.interior
    assert np.all(back.prior.declared)
