"""Every way in which a flight can be wrong, and the line that says so."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyproj
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acx4lib import flight
from acx4lib.errors import FlightError
from support.flights.written import CAMERA, MOUNTS, write_flight
from support.helpers import LINE
from support.helpers import flight_problems as problems

IMAGES = "calibration/images.csv"
POINTS = "calibration/image_points.csv"
TRAJECTORY = "calibration/trajectory.csv"
CONTROL = "control_points.csv"
TOML = "flight.toml"


def replace(folder: Path, file: str, old: str, new: str, count: int = -1) -> None:
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new, count))


def append(folder: Path, file: str, text: str) -> None:
    (folder / file).write_text((folder / file).read_text() + text)


def change(folder: Path, file: str, by: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    by(pd.read_csv(folder / file)).to_csv(folder / file, index=False)


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
    (TRAJECTORY, "0.3,-0.1", "0.3,-361", ":2: phi_deg: -361; must lie between -360 and 360"),
    (
        TRAJECTORY,
        "669850.0,7187900.0,1900.0",
        "669850.0,7187900.0,190.0",
        ":2: height_m: 190.0 is below control point 'G1' at 906; must lie above the control points "
        "of control_points.csv",
    ),
    (
        TRAJECTORY,
        "669850.0,",
        "66985000,",
        ":2: east_m: 66985000, 7187900.0 is nowhere; must be a position that EPSG:31982 covers, "
        "easting first",
    ),
    (CONTROL, "G1,", "G0,", ":3: point: 'G0' stands in line 2 already; every point once"),
    (TOML, 'crs = "EPSG:31982"', "", ":1: crs: missing; required"),
    (
        TOML,
        "EPSG:31982",
        "EPSG:4674",
        ":2: crs: 'EPSG:4674' (SIRGAS 2000) is not a projected CRS; "
        "must be a projected CRS in metres",
    ),
    (
        TOML,
        "EPSG:31982",
        "EPSG:2263",
        ":2: crs: 'EPSG:2263' (NAD83 / New York Long Island (ftUS)) is in US survey foot, not in "
        "metres; must be a projected CRS in metres",
    ),
    (
        TOML,
        "EPSG:31982",
        "EPSG:99999",
        ":2: crs: 'EPSG:99999' is no CRS that PROJ knows; must be a projected CRS in metres",
    ),
    (
        TOML,
        "ellipsoidal",
        "elipsoidal",
        ":3: heights: 'elipsoidal' cannot be used (did you mean 'ellipsoidal'?); must be "
        "'ellipsoidal', a geoid grid in the flight, or a vertical CRS",
    ),
    (
        TOML,
        "ellipsoidal",
        "geoid.gtx",
        ":3: heights: 'geoid.gtx' is not there; must be 'ellipsoidal', a geoid grid in the flight, "
        "or a vertical CRS",
    ),
    (
        TOML,
        "ellipsoidal",
        "../geoid.gtx",
        ":3: heights: '../geoid.gtx' lies outside the flight; must be 'ellipsoidal', a geoid grid "
        "in the flight, or a vertical CRS",
    ),
    (
        TOML,
        'name = "small"',
        'name = "small"\nrefracton = "none"',
        ":2: refracton: unknown key (did you mean 'refraction'?); must be one of name, crs, "
        "heights, refraction, cameras, synthetic, apriori, stages",
    ),
    (
        TOML,
        'name = "small"',
        'name = "small"\nrefraction = true',
        ":2: refraction: True; must be 'none' or 'standard'",
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
        "[apriori]\nheading_deg = 0",
        ":15: apriori.heading_deg: 0; must be positive, at most 1e6",
    ),
    (
        TOML,
        "lever_z_m = 0.2",
        '[stages.heads]\nestimate = ["f"]',
        ":15: stages.heads.estimate: 'f' (did you mean 'f_mm'?); must be of f_mm, xp_mm, yp_mm, "
        "k1, k2, k3, p1, p2, b1",
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
        ":15: stages.mounting.gnss: 'drifts' (did you mean 'drift'?); must be of shift, drift",
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
]


@pytest.mark.parametrize(("file", "old", "new", "line"), REPLACED)
def test_one_mistake_is_one_line(tmp_path, file, old, new, line):
    replace(write_flight(tmp_path), file, old, new, 1)
    assert file + line in problems(tmp_path)
    # what follows from the mistake, such as a missing column, stands in the same file
    assert all(other.startswith(file) for other in problems(tmp_path))


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


def test_drifts_along_strips_need_strips(tmp_path):
    write_flight(tmp_path)
    replace(tmp_path, TOML, "lever_z_m = 0.2", '[stages.mounting]\ngnss = ["drift"]')
    assert flight.read(tmp_path).gnss == ("drift",)
    change(tmp_path, IMAGES, lambda t: t.drop(columns="strip"))
    assert problems(tmp_path) == [
        f"{TOML}:15: stages.mounting.gnss: 'drift'; needs strips in {IMAGES}, column strip"
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


def test_files_that_are_not_there_or_empty(tmp_path):
    write_flight(tmp_path)
    (tmp_path / CONTROL).unlink()
    (tmp_path / TOML).unlink()
    (tmp_path / IMAGES).write_text("")
    (tmp_path / POINTS).write_text("image,point,col_px,row_px\n\n")
    assert problems(tmp_path) == [
        "flight.toml:1: file: is not there; a flight needs it",
        f"{IMAGES}:1: file: is empty; needs a header",
        f"{POINTS}:1: file: has no rows; at least one row under the header",
        f"{CONTROL}:1: file: is not there; block calibration without its own needs it",
    ]


def test_a_file_that_was_cut_off(tmp_path):
    data = (write_flight(tmp_path) / POINTS).read_bytes()
    (tmp_path / POINTS).write_bytes(data[: data.rindex(b",")])
    assert problems(tmp_path) == [
        f"{POINTS}:43: row: has 3 cells (cut off?); as many as the header: 4"
    ]


def test_a_file_that_is_not_utf8(tmp_path):
    text = (write_flight(tmp_path) / POINTS).read_text()
    (tmp_path / POINTS).write_bytes(text.replace("G4", "Gä").encode("latin-1"))
    assert problems(tmp_path) == [f"{POINTS}:5: file: byte 0xe4 is not UTF-8; must be UTF-8 text"]
    (tmp_path / POINTS).write_bytes(text.encode("utf-16-le"))
    assert problems(tmp_path) == [f"{POINTS}:1: file: holds a null character; must be UTF-8 text"]


def test_a_quote_that_is_not_closed(tmp_path):
    replace(write_flight(tmp_path), POINTS, "E1_CAM,G1", '"E1_CAM,G1')
    (line,) = problems(tmp_path)
    assert line.startswith(f"{POINTS}:9: file: cannot be read as a table (unexpected end of data)")


@pytest.mark.parametrize(
    ("separator", "called"), [(";", "semicolons"), ("\t", "tabs"), (" ", "spaces")]
)
def test_other_separators_are_one_line(tmp_path, separator, called):
    replace(write_flight(tmp_path), TRAJECTORY, ",", separator)
    assert problems(tmp_path) == [
        f"{TRAJECTORY}:1: header: is separated by {called}; "
        "must be separated by commas, numbers with decimal points"
    ]


def test_a_blank_first_line_is_no_header(tmp_path):
    write_flight(tmp_path)
    (tmp_path / CONTROL).write_text("\n\n")
    assert problems(tmp_path) == [f"{CONTROL}:1: file: is empty; needs a header"]
    (tmp_path / CONTROL).write_text("\npoint,east_m,north_m,height_m\n")
    assert problems(tmp_path) == [f"{CONTROL}:1: file: begins with a blank line; needs a header"]


def test_a_last_line_without_an_end_is_noted(tmp_path):
    """Cut inside its last number, a row still has all its cells."""
    text = (write_flight(tmp_path) / POINTS).read_text()
    (tmp_path / POINTS).write_text(text[:-3])
    expected = f"{tmp_path / POINTS}: the last line has no line end; was the file cut off?"
    assert flight.read(tmp_path).notes == (expected,)


def test_a_pipe_is_not_waited_for(tmp_path):
    (write_flight(tmp_path) / POINTS).unlink()
    os.mkfifo(tmp_path / POINTS)
    expected = "cannot be read (no regular file); must be a readable file"
    assert problems(tmp_path) == [f"{POINTS}:1: file: {expected}"]


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
    assert flight.read(tmp_path).notes == ("calibraton/images.csv is in no block and is not read",)
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
        "must be 'ellipsoidal', a geoid grid in the flight, or a vertical CRS"
    ]


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


def to_other_zone(table: pd.DataFrame) -> pd.DataFrame:
    other = pyproj.Transformer.from_crs("EPSG:31982", "EPSG:31981", always_xy=True)
    east, north = other.transform(table["east_m"], table["north_m"])
    return table.assign(east_m=east, north_m=north)


def swapped(a: str, b: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.rename(columns={a: b, b: a})


def in_radians(*columns: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{c: np.radians(table[c]) for c in columns})


def z_down(table: pd.DataFrame) -> pd.DataFrame:
    opk = table[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy() * [1, -1, -1] + [180, 0, 0]
    return table.assign(omega_deg=opk[:, 0], phi_deg=opk[:, 1], kappa_deg=opk[:, 2])


MISFITS = [
    ("grid", CONTROL, swapped("east_m", "north_m"), "east_m", "east_m and north_m were swapped"),
    (
        "geographic",
        CONTROL,
        swapped("east_m", "north_m"),
        "east_m",
        "east_m and north_m were swapped",
    ),
    ("grid", TRAJECTORY, swapped("east_m", "north_m"), "east_m", "east_m and north_m were swapped"),
    ("grid", CONTROL, to_other_zone, "east_m", "east_m and north_m were of UTM zone 21S"),
    ("grid", TRAJECTORY, to_other_zone, "east_m", "east_m and north_m were of UTM zone 21S"),
    (
        "geographic",
        TRAJECTORY,
        swapped("lat_deg", "lon_deg"),
        "lat_deg",
        "latitude and longitude were swapped",
    ),
    (
        "geographic",
        TRAJECTORY,
        in_radians("lat_deg", "lon_deg"),
        "lat_deg",
        "latitude and longitude were in radians",
    ),
    (
        "geographic",
        TRAJECTORY,
        in_radians("roll_deg", "pitch_deg", "heading_deg"),
        "heading_deg",
        "roll_deg, pitch_deg, heading_deg were in radians",
    ),
    (  # one strip still fits, since its kappa is nearly zero
        "grid",
        TRAJECTORY,
        in_radians("omega_deg", "phi_deg", "kappa_deg"),
        "kappa_deg",
        "omega_deg, phi_deg, kappa_deg were in radians",
    ),
    (
        "grid",
        TRAJECTORY,
        lambda t: t.assign(kappa_deg=90.0 - t["kappa_deg"]),
        "kappa_deg",
        "kappa_deg were a heading from north",
    ),
    (
        "geographic",
        TRAJECTORY,
        lambda t: t.assign(heading_deg=90.0 - t["heading_deg"]),
        "heading_deg",
        "heading_deg were an angle from east",
    ),
    (
        "grid",
        TRAJECTORY,
        z_down,
        "omega_deg",
        "omega_deg, phi_deg, kappa_deg were of a body with z down",
    ),
    (
        "grid",
        POINTS,
        lambda t: t.assign(row_px=2999.0 - t["row_px"]),
        "row_px",
        "row_px were counted from the bottom",
    ),
]


@pytest.mark.parametrize(("form", "file", "mistake", "column", "says"), MISFITS)
def test_control_that_does_not_fit_is_explained(tmp_path, form, file, mistake, column, says):
    write_flight(tmp_path, form=form)
    change(tmp_path, file, mistake)
    (line,) = problems(tmp_path)
    assert line.startswith(f"{file}:1: {column}: control points lie ")
    assert f"with the trajectory of {TRAJECTORY} and the points of {CONTROL}" in line
    assert f"it looks as if {says} in {file} (then " in line
    assert line.endswith("; must be below 1250 px, a quarter of the image diagonal")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ((0, 0, 0), "turned by 90 degrees about z"),
        ((0, 0, -90), "turned by 180 degrees about z"),
        ((0, 0, 180), "turned by -90 degrees about z"),
        ((180, 0, -90), "with z forward"),
    ],
)
def test_a_wrong_mounting_is_named_with_the_angles_that_fit(tmp_path, given, says):
    write_flight(tmp_path)
    for name, angle in zip(("omega", "phi", "kappa"), given, strict=True):
        text = (tmp_path / TOML).read_text()
        (tmp_path / TOML).write_text(
            re.sub(rf"mount_{name}_deg = .*", f"mount_{name}_deg = {angle}", text)
        )
    (line,) = problems(tmp_path)
    assert line.startswith(f"{TOML}:13: cameras.CAM.mount_kappa_deg: control points lie ")
    angles = "mount_omega_deg, mount_phi_deg, mount_kappa_deg of CAM 0, 0, 90 would fit"
    assert f"it looks as if the camera axes were {says}: {angles}" in line


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("mount_omega_deg = 15", "mount_omega_deg = -15", "of other signs"),
        ("mount_kappa_deg = -90", "mount_kappa_deg = 90", "turned by 180 degrees about z"),
    ],
)
def test_one_wrong_head_is_named_alone(tmp_path, old, new, says):
    replace(write_flight(tmp_path, blocks=("heads",)), TOML, old, new)
    (line,) = problems(tmp_path)
    assert "cameras.RIGHT.mount_kappa_deg: control points in images of RIGHT lie " in line
    angles = "mount_omega_deg, mount_phi_deg, mount_kappa_deg of RIGHT 15, 0, -90 would fit"
    assert f"the camera axes were {says}: {angles}" in line


def test_a_misfit_without_explanation_says_how_far_apart_everything_is(tmp_path):
    change(write_flight(tmp_path), CONTROL, lambda t: t.assign(east_m=t["east_m"] + 3000.0))
    (line,) = problems(tmp_path)
    assert line.startswith(f"{CONTROL}:1: east_m: control points lie ")
    assert (
        "no usual mistake explains it; the control points' middle lies 3000 m east, 38 m north and "
        "-1001 m up of the exposures'; must be"
    ) in line
    change(tmp_path, CONTROL, lambda t: t.assign(north_m=t["north_m"] - 1e6))
    (line,) = problems(tmp_path)
    assert "of the exposures' (is EPSG:31982 the right CRS?); must be" in line


def test_a_few_gross_errors_are_left_to_the_adjustment(tmp_path):
    """Two of nine control points 500 m off: no error here, whatever the adjustment says."""
    write_flight(tmp_path)
    change(
        tmp_path,
        CONTROL,
        lambda t: t.assign(east_m=t["east_m"] + np.array([500.0] * 2 + [0.0] * 7)),
    )
    assert len(flight.read(tmp_path).calibration.control) == 9


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return write_flight(tmp_path_factory.mktemp("good") / "flight", blocks=("heads", "validation"))


FILES = [TOML, CONTROL, *(f"heads/{n}.csv" for n in ("images", "image_points", "trajectory"))]


def read_or_flight_error(folder: Path) -> None:
    lines: tuple[str, ...] = ()
    try:
        flight.read(folder)
    except FlightError as error:
        lines = error.problems
    assert all(LINE.match(line) for line in lines)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    file=st.sampled_from(FILES),
    at=st.floats(0, 1),
    junk=st.binary(max_size=8),
    cut=st.integers(0, 40),
)
def test_changed_bytes_never_raise_anything_else(good, file, at, junk, cut):
    with_changed(good, file, lambda data: splice(data, int(at * len(data)), cut, junk))


CELLS = st.one_of(
    st.text(max_size=6),
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(["", "nan", "inf", "1e308", "-1e308", "0", "\0", '"', "\n", "G0", "E0", "CAM"]),
)


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(file=st.sampled_from(FILES), cell=CELLS, data=st.data())
def test_changed_cells_never_raise_anything_else(good, file, cell, data):
    text = (good / file).read_bytes().decode()
    parts = re.split(r"([,\n=])", text)
    where = data.draw(st.integers(0, len(parts) - 1))
    parts[where] = cell
    with_changed(good, file, lambda _: "".join(parts).encode(errors="surrogatepass"))


def splice(data: bytes, at: int, cut: int, junk: bytes) -> bytes:
    return data[:at] + junk + data[at + cut :]


def with_changed(good: Path, file: str, by: Callable[[bytes], bytes]) -> None:
    """Read a flight with one file changed, then put it back."""
    before = (good / file).read_bytes()
    try:
        (good / file).write_bytes(by(before))
        read_or_flight_error(good)
    finally:
        (good / file).write_bytes(before)


def test_a_folder_where_a_file_should_be(tmp_path):
    write_flight(tmp_path)
    (tmp_path / IMAGES).unlink()
    (tmp_path / IMAGES).mkdir()
    assert problems(tmp_path)[0].startswith(f"{IMAGES}:1: file: cannot be read (Is a directory)")
    shutil.rmtree(tmp_path / "calibration")
    (tmp_path / "calibration").write_text("")
    assert problems(tmp_path)[0].startswith(f"{tmp_path}:1: folder: no block at all")
