"""Every way in which a flight can be wrong, and the line that says so."""

from __future__ import annotations

import pytest

from acx4files import flight
from support.flights import in_heads
from support.flights.written import (
    CAMERA,
    CONTROL,
    IMAGES,
    MOUNTS,
    POINTS,
    TOML,
    TRAJECTORY,
    change,
    replace,
    write_flight,
)
from support.helpers import flight_problems as problems

REPLACED = [
    (POINTS, "col_px", "col", ":1: col_px: missing in the header (is it 'col'?); required"),
    (IMAGES, "camera", "Camera", ":1: camera: missing in the header (is it 'Camera'?); required"),
    (
        IMAGES,
        "camera,exposure,strip",
        "camera,exposure,camera",
        ":1: camera: stands 2 times in the header; every column once",
    ),
    (
        TRAJECTORY,
        "omega_deg,phi_deg,kappa_deg",
        "roll_deg,pitch_deg,heading_deg",
        ":1: roll_deg, pitch_deg, heading_deg: beside east_m, north_m; "
        "one form of trajectory in one file",
    ),
    (
        TRAJECTORY,
        "east_m,north_m,height_m,omega_deg,phi_deg,kappa_deg",
        "E,N,height_m,o,p,k",
        ":1: position and attitude: missing in the header; must be lat_deg, lon_deg, roll_deg, "
        "pitch_deg, heading_deg or east_m, north_m, omega_deg, phi_deg, kappa_deg",
    ),
    (POINTS, "1484.28,", "nan,", ":2: col_px: 'nan'; must be a finite number, decimal point"),
    (POINTS, "1484.28,", "1_4,", ":2: col_px: '1_4'; must be a finite number, decimal point"),
    (POINTS, "1484.28,", "1e999,", ":2: col_px: '1e999'; must be a finite number, decimal point"),
    (POINTS, "1484.28,", ",", ":2: col_px: is empty; must be a finite number, decimal point"),
    (
        POINTS,
        "1484.28,",
        '"1484,28",',
        ":2: col_px: '1484,28' (a decimal comma?); must be a finite number, decimal point",
    ),
    *(
        (
            POINTS,
            "1484.28,",
            f'"{cell}",',
            f":2: col_px: '{cell}' ({form}?); must be a finite number, decimal point",
        )
        for cell, form in (
            ("1,484.28", "thousands set apart"),
            ("1 484.28", "thousands set apart"),
            ("1.484,28", "thousands set apart"),
            ("49 48 0.05", "degrees, minutes and seconds"),
            ("1484.28 px", "with a unit"),
        )
    ),
    (
        POINTS,
        "1484.28,",
        "1484,28,",
        ":2: row: has 5 cells (a decimal comma?); as many as the header: 4",
    ),
    (
        POINTS,
        "E0_CAM,G1,1444.347,2226.725",
        "",
        ":3: row: is blank; as many as the header: 4",
    ),
    (POINTS, "E0_CAM,G0", "E0_CAM,", ":2: point: is empty; must be a name"),
    (
        POINTS,
        "E0_CAM,G1,",
        "E0_CAM,G0,",
        ":3: image, point: 'E0_CAM', 'G0' stands in line 2 already; every image and point once",
    ),
    (
        POINTS,
        "E0_CAM,G0",
        "E0-CAM,G0",
        ":2: image: 'E0-CAM' is unknown (did you mean 'E0_CAM'?); must have a row in "
        "calibration/images.csv",
    ),
    (
        POINTS,
        "1484.28,",
        "3999.51,",
        ":2: col_px: 3999.51; must lie on the sensor of CAM, from -0.5 to 3999.5",
    ),
    (
        POINTS,
        "1484.28,1223.448",
        "1484.28,-1",
        ":2: row_px: -1; must lie on the sensor of CAM, from -0.5 to 2999.5",
    ),
    (
        POINTS,
        "3456.345,1295.654",
        "1295.654,3456.345",
        ":6: row_px: 3456.345 (col and row swapped?); must lie on the sensor of CAM, "
        "from -0.5 to 2999.5",
    ),
    (
        IMAGES,
        "E1_CAM,CAM",
        "E1_CAM,cam",
        ":3: camera: 'cam' is unknown; must be a camera of flight.toml",
    ),
    (
        IMAGES,
        "CAM,E1,",
        "CAM,E0,",
        ":3: camera, exposure: 'CAM', 'E0' stands in line 2 already; "
        "every camera and exposure once",
    ),
    (
        IMAGES,
        "CAM,E1,",
        "CAM,E01,",
        ":3: exposure: 'E01' is unknown (did you mean 'E1'?); must have a row in "
        "calibration/trajectory.csv",
    ),
    (
        TRAJECTORY,
        "E1,",
        "E0,0,0,0,0,0,0\nE1,",
        ":3: exposure: 'E0' stands in line 2 already; every exposure once",
    ),
    (
        TRAJECTORY,
        "0.3,-0.1",
        "0.3,-0°06'00.0\"",
        ":2: phi_deg: '-0°06\\'00.0\"' (degrees, minutes and seconds?); must be a finite number, "
        "decimal point",
    ),
    (
        TRAJECTORY,
        "0.3,-0.1",
        "0.3,-0 06 00.0",
        ":2: phi_deg: '-0 06 00.0' (degrees, minutes and seconds?); must be a finite number, "
        "decimal point",
    ),
    (TRAJECTORY, "0.3,-0.1", "0.3,-361", ":2: phi_deg: -361; must lie between -360 and 360"),
    (
        TRAJECTORY,
        "669850.0,7187900.0,1900.0",
        "669850.0,7187900.0,190.0",
        ":2: height_m: 190 is below control point 'G1' at 906; must lie above the control points "
        "of control_points.csv",
    ),
    (
        TRAJECTORY,
        "669850.0,",
        "66985000,",
        ":2: east_m: 66985000, 7187900 is nowhere; must be a position that EPSG:31982 covers, "
        "easting first",
    ),
    (CONTROL, "G1,", "G0,", ":3: point: 'G0' stands in line 2 already; every point once"),
    (TOML, 'crs = "EPSG:31982"', "", ":1: crs: missing; required"),
    (
        TOML,
        "EPSG:31982",
        "EPSG:4674",
        ":2: crs: 'EPSG:4674' (SIRGAS 2000) is not a projected CRS; "
        "must be a projected CRS in metres, or 'local'",
    ),
    (
        TOML,
        "EPSG:31982",
        "EPSG:2263",
        ":2: crs: 'EPSG:2263' (NAD83 / New York Long Island (ftUS)) is in US survey foot, not in "
        "metres; must be a projected CRS in metres, or 'local'",
    ),
    (
        TOML,
        "EPSG:31982",
        "EPSG:99999",
        ":2: crs: 'EPSG:99999' is no CRS that PROJ knows; must be a projected CRS in metres, "
        "or 'local'",
    ),
    (
        TOML,
        "ellipsoidal",
        "elipsoidal",
        ":3: heights: 'elipsoidal' cannot be used (did you mean 'ellipsoidal'?); must be "
        "'ellipsoidal', a geoid grid in the flight, a vertical CRS, or a number",
    ),
    (
        TOML,
        "ellipsoidal",
        "geoid.gtx",
        ":3: heights: 'geoid.gtx' is not there; must be 'ellipsoidal', a geoid grid in the flight, "
        "a vertical CRS, or a number",
    ),
    (
        TOML,
        '"ellipsoidal"',
        "500",
        ":3: heights: 500; must be an undulation in metres, at most 200 either way",
    ),
    (
        TOML,
        "ellipsoidal",
        "../geoid.gtx",
        ":3: heights: '../geoid.gtx' lies outside the flight; must be 'ellipsoidal', a geoid grid "
        "in the flight, a vertical CRS, or a number",
    ),
    (
        TOML,
        'name = "small"',
        'name = "small"\nrefracton = "none"',
        ":2: refracton: unknown key (did you mean 'refraction'?); must be one of name, crs, "
        "heights, refraction, simulated, cameras, synthetic, apriori, adjustment, session, "
        "stages, certificate, format",
    ),
    (
        TOML,
        'name = "small"',
        'name = "small"\nformat = 7',
        ":2: format: 7; must be a whole number up to 6; a larger one is of a later acx4",
    ),
    (
        TOML,
        'name = "small"',
        'name = "small"\nrefraction = true',
        ":2: refraction: True; must be 'none' or 'standard'",
    ),
    (
        TOML,
        'name = "small"',
        'name = "small"\nsimulated = "yes"',
        ":2: simulated: 'yes'; must be true or false",
    ),
    (TOML, 'name = "small"', "name = 1", ":1: name: 1; must be text"),
    (TOML, "width_px = 4000", "width_px =", ":6: character 11: Invalid value; must be valid TOML"),
    (
        TOML,
        "width_px = 4000",
        "width_px = 4000.5",
        ":6: cameras.CAM.width_px: 4000.5; must be a positive whole number",
    ),
    (
        TOML,
        "width_px = 4000",
        'width_px = "4000"',
        ":6: cameras.CAM.width_px: '4000'; must be a number",
    ),
    (TOML, "height_px = 3000", "", ":5: cameras.CAM.height_px: missing; required"),
    (
        TOML,
        "pixel_um = 5.0",
        "pixel_um = 0.005",
        ":8: cameras.CAM.pixel_um: 0.005 (millimetres or metres?); must lie between 0.1 and 1000",
    ),
    (
        TOML,
        "focal_mm = 25.0",
        "focal_mm = 0.025",
        ":9: cameras.CAM.focal_mm: 0.025 (metres?); must lie between 1 and 10000",
    ),
    (
        TOML,
        "k1 = 1e-5",
        "k1 = -0.1",
        ":5: cameras.CAM: distortion by k1 to p2 reaches 156 mm at a corner; must be small; "
        "k1 in mm^-2, k2 in mm^-4, k3 in mm^-6",
    ),
    (
        TOML,
        "k1 = 1e-5",
        "k1 = 2e-3",
        ":5: cameras.CAM: distortion by k1 to p2 reaches 3.12 mm at a corner; must be small; "
        "k1 in mm^-2, k2 in mm^-4, k3 in mm^-6",
    ),
    (
        TOML,
        "k1 = 1e-5",
        "xp_mm = 12",
        ":10: cameras.CAM.xp_mm: 12 (pixels?); must lie on the sensor, in mm from its middle",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "lever_z_m = nan",
        ":14: cameras.CAM.lever_z_m: nan; must lie between -100 and 100",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "lever_z_m = 0.2\nlever_sigma_m = [0.1, 0.1]",
        ":15: cameras.CAM.lever_sigma_m: [0.1, 0.1]; must be a number or a list of three",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "lever_z_m = 0.2\nlever_sigma_m = 0",
        ":15: cameras.CAM.lever_sigma_m: 0; must be positive, at most 1e6",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "lever_sigma_m = 0.1",
        ":14: cameras.CAM.lever_sigma_m: sigma of nothing; needs the values it is of: lever_x_m, "
        "lever_y_m, lever_z_m",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "lever_z_m = 0.2\nfocal_sigma_mm = 0",
        ":15: cameras.CAM.focal_sigma_mm: 0; must be positive, at most 1e6",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "lever_z_m = 0.2\nyp_sigma_mm = 0.01",
        ":15: cameras.CAM.yp_sigma_mm: sigma of nothing; needs the values it is of: yp_mm",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        "[apriori]\nheading_deg = 0",
        ":15: apriori.heading_deg: 0; must be positive, at most 1e6",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[stages.heads]\nestimate = ["f"]',
        ":15: stages.heads.estimate: 'f' (did you mean 'f_mm'?); must be of f_mm, xp_mm, yp_mm, "
        "k1, k2, k3, p1, p2, b1, b2",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[stages.mounting]\nfix = ["levers"]',
        ":15: stages.mounting.fix: 'levers' (did you mean 'lever_arm'?); must be of lever_arm, "
        "boresight",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[stages.mounting]\nweights = "estimate"',
        ":15: stages.mounting.weights: 'estimate' (did you mean 'estimated'?); must be 'given' or "
        "'estimated'",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[stages.mounting]\ngnss = ["drifts"]',
        ":15: stages.mounting.gnss: 'drifts' (did you mean 'drift'?); must be of shift, drift, "
        "delay, attitude_delay",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[stages.heads]\nweights = "given"',
        ":15: stages.heads.weights: unknown key; must be one of estimate",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[synthetic]\ncamera = "SYN"\nheads = ["CAM"]',
        ":15: synthetic.camera: 'SYN'; must be one of [cameras.…]",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[synthetic]\ncamera = "CAM"\nheads = ["CAM"]\nmeasured_in = "head"',
        ":17: synthetic.measured_in: 'head' (did you mean 'heads'?); "
        "must be 'synthetic' or 'heads'",
    ),
]


@pytest.mark.parametrize(("file", "old", "new", "line"), REPLACED)
def test_one_mistake_is_one_line(tmp_path, file, old, new, line):
    replace(write_flight(tmp_path), file, old, new, 1)
    assert file + line in problems(tmp_path)
    # what follows from the mistake, such as a missing column, stands in the same file
    assert all(other.startswith(file) for other in problems(tmp_path))


def test_a_fisheye_may_be_corrected_outwards_by_more_than_a_lens_inwards(tmp_path):
    replace(write_flight(tmp_path), TOML, "k1 = 1e-5", "k1 = -2e-3", 1)
    assert flight.read(tmp_path).cameras["CAM"].interior.k1 == -2e-3


ADDED = [
    (CONTROL, "sigma_east_m", [0.1] * 8 + [-0.01], ":10: sigma_east_m: -0.01; must be zero or"),
    (
        CONTROL,
        "role",
        ["control"] * 8 + ["chek"],
        ":10: role: 'chek' is unknown (did you mean 'check'?)",
    ),
    (TRAJECTORY, "sigma_east_m", [0.0] + [0.1] * 5, ":2: sigma_east_m: 0.0; must be positive"),
    (TRAJECTORY, "sigma_roll_deg", ["x"] * 6, ":2: sigma_roll_deg: 'x'; must be a finite number"),
    (IMAGES, "file", ["a.tif"] * 6, ":2: file: 'a.tif' is not there; must be a file under"),
    (IMAGES, "file", ["../../a"] * 6, ":2: file: '../../a' lies outside the flight; must be"),
    (IMAGES, "file", ["/etc/passwd"] * 6, ":2: file: '/etc/passwd' lies outside the flight; must"),
    (
        IMAGES,
        "file",
        ["x" * 300] * 6,
        f":2: file: '{'x' * 80}'… has 300 characters; must be a name of",
    ),
]


@pytest.mark.parametrize(("file", "column", "values", "line"), ADDED)
def test_an_optional_column_must_be_right_too(tmp_path, file, column, values, line):
    change(write_flight(tmp_path), file, lambda t: t.assign(**{column: values}))
    assert problems(tmp_path)[0].startswith(file + line)


@pytest.mark.parametrize("name", ["images\\E0.tif", "images/E0.TIF", "E0.tif", "./images/e0.tif"])
def test_a_picture_with_other_slashes_case_or_folder_is_named(tmp_path, name):
    write_flight(tmp_path)
    (tmp_path / "calibration/images").mkdir()
    (tmp_path / "calibration/images/E0.tif").write_bytes(b"")
    change(tmp_path, IMAGES, lambda t: t.assign(file=name))
    fault = f"file: {name!r} is not there (did you mean 'images/E0.tif'?); must be a file under"
    assert problems(tmp_path)[0].startswith(f"{IMAGES}:2: {fault}")


def test_no_picture_is_looked_for_outside_the_flight(tmp_path):
    write_flight(tmp_path / "flight")
    (tmp_path / "E0.tif").write_bytes(b"")
    (tmp_path / "flight/calibration/images").symlink_to(tmp_path)
    change(tmp_path / "flight", IMAGES, lambda t: t.assign(file="e0.tif"))
    (first, *_) = problems(tmp_path / "flight")
    assert first.startswith(f"{IMAGES}:2: file: 'e0.tif' is not there; must be")


def test_drifts_along_strips_need_strips(tmp_path):
    write_flight(tmp_path)
    replace(tmp_path, TOML, "lever_z_m = 0.2", '[stages.mounting]\ngnss = ["drift"]')
    assert flight.read(tmp_path).gnss == ("drift",)
    change(tmp_path, IMAGES, lambda t: t.drop(columns="strip"))
    assert problems(tmp_path) == [
        f"{TOML}:15: stages.mounting.gnss: 'drift'; needs strips in {IMAGES}, column strip"
    ]


@pytest.mark.parametrize("name", ["delay", "attitude_delay"])
def test_delays_need_strips_and_times(tmp_path, name):
    write_flight(tmp_path)
    replace(tmp_path, TOML, "lever_z_m = 0.2", f'[stages.mounting]\ngnss = ["{name}"]')
    change(tmp_path, TRAJECTORY, lambda t: t.assign(time_s=range(len(t))))
    assert flight.read(tmp_path).gnss == (name,)
    change(tmp_path, TRAJECTORY, lambda t: t.drop(columns="time_s"))
    where = f"{TOML}:15: stages.mounting.gnss: '{name}'; needs "
    assert problems(tmp_path) == [f"{where}times in {TRAJECTORY}, column time_s"]
    change(tmp_path, IMAGES, lambda t: t.drop(columns="strip"))
    assert problems(tmp_path)[0] == f"{where}strips in {IMAGES}, column strip"


def test_correlated_errors_need_times_and_both_their_keys(tmp_path):
    write_flight(tmp_path)
    both = "[apriori]\ngnss_correlation_s = 600\ngnss_correlated_share = 0.9"
    replace(tmp_path, TOML, "lever_z_m = 0.2", both)
    assert problems(tmp_path) == [
        f"{TOML}:15: apriori.gnss_correlation_s: 600; needs times in {TRAJECTORY}, column time_s"
    ]
    change(tmp_path, TRAJECTORY, lambda t: t.assign(time_s=range(len(t))))
    process = flight.read(tmp_path).calibration.trajectory.slow_positions
    assert (process.share, process.time_constant_s) == (0.9, 600.0)
    assert flight.read(tmp_path).calibration.trajectory.slow_attitudes.share == 0
    replace(tmp_path, TOML, "gnss_correlation_s = 600\n", "")
    assert problems(tmp_path) == [
        f"{TOML}:15: apriori.gnss_correlated_share: stands alone; needs gnss_correlation_s as well"
    ]


def test_a_link_does_not_leave_the_flight(tmp_path):
    write_flight(tmp_path / "flight")
    (tmp_path / "outside.tif").write_bytes(b"")
    (tmp_path / "flight/calibration/a.tif").symlink_to(tmp_path / "outside.tif")
    change(tmp_path / "flight", IMAGES, lambda t: t.assign(file=["a.tif", *[""] * 5]))
    (line,) = problems(tmp_path / "flight")
    assert line.startswith(
        f"{IMAGES}:2: file: 'a.tif' lies outside the flight; must be a file under"
    )


def test_latitude_beyond_90_looks_swapped(tmp_path):
    write_flight(tmp_path, form="geographic")
    change(tmp_path, TRAJECTORY, lambda t: t.assign(lat_deg=-149.3))
    expected = (
        f"{TRAJECTORY}:2: lat_deg: -149.3 (latitude and longitude swapped?); must lie between"
    )
    assert problems(tmp_path)[0].startswith(expected)


def test_all_problems_are_said_at_once_and_many_alike_are_counted(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    replace(tmp_path, TOML, "width_px = 4000", "width = 4000")
    replace(tmp_path, "validation/image_points.csv", "_CAM,", "_KAM,")
    (tmp_path / TRAJECTORY).unlink()
    lines = problems(tmp_path)
    assert lines[0] == f"{TOML}:5: cameras.CAM.width_px: missing; required"
    assert lines[1].startswith(
        f"{TOML}:6: cameras.CAM.width: unknown key (did you mean 'width_px'?)"
    )
    assert lines[2] == f"{TRAJECTORY}:1: file: is not there; block calibration needs it"
    assert len(lines[3:]) == 11
    expected = "must have a row in validation/images.csv"
    assert (
        lines[-1] == f"validation/image_points.csv:12: image: and 32 more from here on; {expected}"
    )


def test_a_folder_without_a_flight_and_a_flight_without_a_block(tmp_path):
    (line,) = problems(tmp_path / "none")
    expected = "is no folder; must be the folder of a flight, with a flight.toml"
    assert line == f"{tmp_path}/none:1: folder: {expected}"
    write_flight(tmp_path / "flight", blocks=())
    (line,) = problems(tmp_path / "flight")
    assert line == (
        f"{tmp_path}/flight:1: folder: no block at all; needs at least one of the folders "
        "heads/, calibration/, validation/"
    )


def test_a_camera_that_is_validated_must_be_calibrated(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    (tmp_path / TOML).write_text(
        (tmp_path / TOML).read_text() + CAMERA.format(*MOUNTS["CAM"], name="SPARE")
    )
    replace(tmp_path, "validation/images.csv", ",CAM,", ",SPARE,")
    expected = f"must be a camera with images in {IMAGES}"
    assert problems(tmp_path) == [
        f"validation/images.csv:2: camera: 'SPARE' is not calibrated; {expected}"
    ]


def test_a_block_of_another_name_is_named(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    (tmp_path / "calibration").rename(tmp_path / "calibraton")
    assert "calibraton/images.csv is in no block and is not read" in flight.read(tmp_path).notes
    (tmp_path / "validation").rename(tmp_path / "Validation")
    (line,) = problems(tmp_path)
    found = "no block at all (Validation/images.csv is in none) (calibraton/images.csv is in none)"
    assert line.startswith(f"{tmp_path}:1: folder: {found}; needs at least one of the folders")


def test_a_table_of_flight_toml_has_the_line_of_its_first_key(tmp_path):
    """There may be no line of its own: [camera.X] begins `camera`."""
    replace(write_flight(tmp_path), TOML, "lever_z_m = 0.2", "[camera.SPARE]\nwidth_px = 4000")
    assert problems(tmp_path)[0].startswith(f"{TOML}:14: camera: unknown key (did you mean 'cam")


def test_a_geoid_grid_that_is_none_is_named_without_a_pipeline(tmp_path):
    (write_flight(tmp_path) / "geoid.gtx").write_bytes(b"hello")
    replace(tmp_path, TOML, "ellipsoidal", "geoid.gtx")
    assert problems(tmp_path) == [
        f"{TOML}:3: heights: 'geoid.gtx' cannot be used (PROJ cannot read it as a geoid grid); "
        "must be 'ellipsoidal', a geoid grid in the flight, a vertical CRS, or a number"
    ]


def test_a_block_that_is_measured_in_heads_has_no_other_cameras(tmp_path):
    in_heads.write(tmp_path / "a")
    assert flight.read(tmp_path / "a").transferred == ("calibration", "validation")
    replace(tmp_path / "a", IMAGES, "LEFT,E", "CAM,E")
    table = (tmp_path / "a" / IMAGES).read_text().splitlines()
    assert table[1].split(",")[1] == "CAM"
    (first, *_) = problems(tmp_path / "a")
    assert first == (
        f"{IMAGES}:2: camera: 'CAM' is no head; must be one of synthetic.heads in flight.toml, "
        "since measured_in is 'heads'"
    )


def test_heads_of_a_validation_need_not_be_in_a_calibration_that_is_carried(tmp_path):
    """The synthetic camera is what is calibrated; a rig without one of its heads is left out."""
    in_heads.write(tmp_path)
    for file in (IMAGES, POINTS):
        table = (tmp_path / file).read_text().splitlines()
        (tmp_path / file).write_text("\n".join(r for r in table if "RIGHT" not in r) + "\n")
    read = flight.read(tmp_path)
    assert [camera.name for camera in read.calibration.cameras] == ["LEFT"]
    assert [camera.name for camera in read.validation.cameras] == ["LEFT", "RIGHT"]


def test_heads_need_the_synthetic_camera_and_images_of_every_head(tmp_path):
    write_flight(tmp_path / "a", blocks=("heads",))
    replace(tmp_path / "a", TOML, '[synthetic]\ncamera = "CAM"\nheads = ["LEFT", "RIGHT"]', "")
    expected = "missing; required, since there is a block heads"
    assert problems(tmp_path / "a") == [f"{TOML}:1: synthetic: {expected}"]
    write_flight(tmp_path / "b", blocks=("heads",))
    replace(tmp_path / "b", "heads/images.csv", "LEFT,E", "CAM,E")
    assert {
        f"{TOML}:40: synthetic.heads: 'LEFT' took no image; "
        "every head needs images in heads/images.csv",
        "heads/images.csv:2: camera: 'CAM' is no head; "
        "must be one of synthetic.heads in flight.toml",
    } <= set(problems(tmp_path / "b"))
