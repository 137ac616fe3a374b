"""Every way in which a flight can be wrong, and the line that says so."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
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

WRONG = tomllib.loads((Path(__file__).parent / "wrong_flights.toml").read_text("utf-8"))
ROWS = [(file, *row) for file, rows in WRONG.items() for row in rows]


@pytest.mark.parametrize(("file", "line", "old", "new", "says"), ROWS)
def test_one_mistake_is_one_line_with_its_place(tmp_path, file, line, old, new, says):
    replace(write_flight(tmp_path), file, old, new, 1)
    found = problems(tmp_path)
    assert any(one.startswith(f"{file}:{line}: {says}") for one in found), found
    # what follows from the mistake, such as a missing column, stands in the same file
    assert all(one.startswith(file) for one in found)


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


# --- files and folders -------------------------------------------------------------------------


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


def other_separator(separator):
    return lambda data: data.replace(b",", separator)


NO_COMMAS = "must be separated by commas, numbers with decimal points"
FILES = [
    (lambda data: data[: data.rindex(b",")], ":43: row: has 3 cells (cut off?); as many"),
    (lambda data: data.replace(b"G4", b"G\xe4"), ":5: file: byte 0xe4 is not UTF-8; must be"),
    (lambda data: data.decode().encode("utf-16"), ":1: file: byte 0xff is not UTF-8 (UTF-16?)"),
    (lambda data: data.decode().encode("utf-16-le"), ":1: file: holds a null character; must be"),
    (lambda data: b"\n" + data, ":1: file: begins with a blank line; needs a header"),
    (lambda data: data.replace(b"E1_CAM,G1", b'"E1_CAM,G1', 1), ":9: file: cannot be read as a"),
    (other_separator(b";"), f":1: header: is separated by semicolons; {NO_COMMAS}"),
    (other_separator(b"\t"), f":1: header: is separated by tabs; {NO_COMMAS}"),
    (other_separator(b" "), f":1: header: is separated by spaces; {NO_COMMAS}"),
    # pandas would take the first column for an index, in silence
    (
        lambda data: re.sub(rb"(?m)^E", rb"1,E", data),
        ":2: row: has 5 cells (a decimal comma?); as many as the header: 4",
    ),
]


@pytest.mark.parametrize(("spoil", "says"), FILES, ids=[says for _, says in FILES])
def test_a_file_that_is_no_table_of_commas(tmp_path, spoil, says):
    data = (write_flight(tmp_path) / POINTS).read_bytes()
    (tmp_path / POINTS).write_bytes(spoil(data))
    found = problems(tmp_path)
    assert found[0].startswith(POINTS + says)
    assert len(found) == 1 or "has 5 cells" in says


def test_a_last_line_without_an_end_is_noted(tmp_path):
    """Cut inside its last number, a row still has all its cells."""
    text = (write_flight(tmp_path) / POINTS).read_text()
    (tmp_path / POINTS).write_text(text[:-3])
    expected = f"{tmp_path / POINTS}: the last line has no line end; was the file cut off?"
    assert flight.read(tmp_path).notes[0] == expected


def test_a_folder_in_the_place_of_a_table(tmp_path):
    write_flight(tmp_path)
    (tmp_path / IMAGES).unlink()
    (tmp_path / IMAGES).mkdir()
    (line,) = problems(tmp_path)
    assert line.startswith(f"{IMAGES}:1: file: cannot be read (Is a directory); must be")


def test_a_folder_without_a_flight_and_a_flight_without_a_block(tmp_path):
    (line,) = problems(tmp_path / "none")
    expected = "is no folder; must be the folder of a flight, with a flight.toml"
    assert line == f"{tmp_path}/none:1: folder: {expected}"
    write_flight(tmp_path / "flight", blocks=())
    (tmp_path / "flight/calibration").write_text("")
    none, other = problems(tmp_path / "flight")
    assert none == (
        f"{tmp_path}/flight:1: folder: no block at all; needs at least one of the folders "
        "heads/, calibration/, validation/"
    )
    assert other.endswith("calibration:1: folder: is no folder; must be the folder of a block")


def test_a_block_of_another_name_is_named(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    (tmp_path / "calibration").rename(tmp_path / "calibraton")
    assert "calibraton/images.csv is in no block and is not read" in flight.read(tmp_path).notes
    (tmp_path / "validation").rename(tmp_path / "Validation")
    (line,) = problems(tmp_path)
    found = "no block at all (Validation/images.csv is in none) (calibraton/images.csv is in none)"
    assert line.startswith(f"{tmp_path}:1: folder: {found}; needs at least one of the folders")


@pytest.mark.parametrize("name", ["images\\E0.tif", "images/E0.TIF", "E0.tif", "./images/e0.tif"])
def test_a_picture_with_other_slashes_case_or_folder_is_named(tmp_path, name):
    write_flight(tmp_path)
    (tmp_path / "calibration/images").mkdir()
    (tmp_path / "calibration/images/E0.tif").write_bytes(b"")
    change(tmp_path, IMAGES, lambda t: t.assign(file=name))
    fault = f"file: {name!r} is not there (did you mean 'images/E0.tif'?); must be a file under"
    assert problems(tmp_path)[0].startswith(f"{IMAGES}:2: {fault}")


def test_a_link_does_not_leave_the_flight_nor_is_a_picture_looked_for_outside(tmp_path):
    write_flight(tmp_path / "flight")
    (tmp_path / "E0.tif").write_bytes(b"")
    (tmp_path / "flight/calibration/a.tif").symlink_to(tmp_path / "E0.tif")
    (tmp_path / "flight/calibration/images").symlink_to(tmp_path)
    change(tmp_path / "flight", IMAGES, lambda t: t.assign(file=["a.tif", "e0.tif", *[""] * 4]))
    outside, absent = problems(tmp_path / "flight")
    assert outside.startswith(f"{IMAGES}:2: file: 'a.tif' lies outside the flight; must be a file")
    assert absent.startswith(f"{IMAGES}:3: file: 'e0.tif' is not there; must be")


def test_a_geoid_grid_that_is_none_is_named_without_a_pipeline(tmp_path):
    (write_flight(tmp_path) / "geoid.gtx").write_bytes(b"hello")
    replace(tmp_path, TOML, "ellipsoidal", "geoid.gtx")
    assert problems(tmp_path) == [
        f"{TOML}:3: heights: 'geoid.gtx' cannot be used (PROJ cannot read it as a geoid grid); "
        "must be 'ellipsoidal', a geoid grid in the flight, a vertical CRS, or a number"
    ]


def test_a_block_of_pictures_without_points_names_the_command_that_measures_them(tmp_path):
    write_flight(tmp_path)
    header = (tmp_path / POINTS).read_text().splitlines()[0]
    (tmp_path / POINTS).write_text(f"{header}\n")
    (tmp_path / "calibration/a.tif").write_bytes(b"")
    change(tmp_path, IMAGES, lambda t: t.assign(file="a.tif"))
    fault = f"{POINTS}:1: file: has no rows; at least one row under the header"
    assert problems(tmp_path) == [f"{fault}; acx4 measure finds points in its pictures"]


# --- what contradicts what ---------------------------------------------------------------------


def test_latitude_beyond_90_looks_swapped(tmp_path):
    write_flight(tmp_path, form="geographic")
    change(tmp_path, TRAJECTORY, lambda t: t.assign(lat_deg=-149.3))
    expected = (
        f"{TRAJECTORY}:2: lat_deg: -149.3 (latitude and longitude swapped?); must lie between"
    )
    assert problems(tmp_path)[0].startswith(expected)


def test_a_trajectory_in_degrees_is_a_problem_of_its_first_row(tmp_path):
    change(
        write_flight(tmp_path),
        TRAJECTORY,
        lambda t: t.assign(east_m=-49.31 + 0.001 * t.index, north_m=-25.41),
    )
    says = f"{TRAJECTORY}:2: east_m: -49.31, -25.41 (longitude, latitude in degrees?); must be"
    assert any(line.startswith(says) for line in problems(tmp_path))


@pytest.mark.parametrize("name", ["drift", "delay"])
def test_drifts_and_delays_need_strips_and_delays_need_times(tmp_path, name):
    write_flight(tmp_path)
    replace(tmp_path, TOML, "lever_z_m = 0.2", f'[stages.mounting]\ngnss = ["{name}"]')
    change(tmp_path, TRAJECTORY, lambda t: t.assign(time_s=range(len(t))))
    assert flight.read(tmp_path).gnss == (name,)
    change(tmp_path, IMAGES, lambda t: t.drop(columns="strip"))
    says = f"{TOML}:15: stages.mounting.gnss: '{name}'; needs strips in {IMAGES}, column strip"
    assert problems(tmp_path) == [says]


def test_a_camera_that_is_validated_must_be_calibrated(tmp_path):
    write_flight(tmp_path, blocks=("calibration", "validation"))
    toml = (tmp_path / TOML).read_text()
    (tmp_path / TOML).write_text(toml + CAMERA.format(*MOUNTS["CAM"], name="SPARE"))
    replace(tmp_path, "validation/images.csv", ",CAM,", ",SPARE,")
    expected = f"must be a camera with images in {IMAGES}"
    assert problems(tmp_path) == [
        f"validation/images.csv:2: camera: 'SPARE' is not calibrated; {expected}"
    ]


def test_a_block_that_is_measured_in_heads_has_no_other_cameras(tmp_path):
    in_heads.write(tmp_path)
    assert flight.read(tmp_path).transferred == ("calibration", "validation")
    replace(tmp_path, IMAGES, "LEFT,E", "CAM,E")
    assert problems(tmp_path)[0] == (
        f"{IMAGES}:2: camera: 'CAM' is no head; must be one of synthetic.heads in flight.toml, "
        "since measured_in is 'heads'"
    )


def test_heads_of_a_validation_need_not_be_in_a_calibration_that_is_carried(tmp_path):
    """The synthetic camera is what is calibrated; a rig without one of its heads is left out."""
    in_heads.write(tmp_path)
    for file in (IMAGES, POINTS):
        change(tmp_path, file, lambda t: t[~t["image"].str.contains("RIGHT")])
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


def test_distances_of_earlier_flights_are_said_not_to_be_read(tmp_path):
    write_flight(tmp_path)
    (tmp_path / "calibration/distances.csv").write_text("point_a,point_b,distance_m,sigma_m\n")
    said = "calibration/distances.csv is not read: distances are no observations any more"
    assert said in flight.read(tmp_path).notes


def test_a_fisheye_may_be_corrected_outwards_by_more_than_a_lens_inwards(tmp_path):
    replace(write_flight(tmp_path), TOML, "k1 = 1e-5", "k1 = -2e-3", 1)
    assert flight.read(tmp_path).cameras["CAM"].interior.k1 == -2e-3


def test_a_flight_of_the_version_before_is_read(tmp_path):
    """flight.toml with every key that format 5 had."""
    write_flight(tmp_path, blocks=("calibration", "validation"))
    change(tmp_path, TRAJECTORY, lambda t: t.assign(time_s=range(len(t))))
    change(tmp_path, "validation/trajectory.csv", lambda t: t.assign(time_s=range(len(t))))
    shutil.copyfile(Path(__file__).parent / "format_5.toml", tmp_path / TOML)
    read = flight.read(tmp_path)
    assert (read.refraction, read.simulated, read.gnss) == ("standard", True, ("shift", "drift"))
    assert read.estimate_mounting == ("f", "xp", "yp", "k1", "b1")
    assert (read.estimate_heads, read.fix, read.weights) == (("xp", "yp"), ("lever_arm",), "given")
    assert (str(read.session.date), read.session.temperature_c) == ("2026-05-02", 12.5)
    assert np.degrees(read.calibration.smallest_angle) == pytest.approx(1.0)
    assert read.calibration.trajectory.time_s.tolist() == [*range(6)]
    assert read.calibration.trajectory.slow_positions.share == 0.9
    assert read.cameras["CAM"].prior.interior[0] == 0.02
    assert read.certificate.cameras["CAM"].serial == "4711"
