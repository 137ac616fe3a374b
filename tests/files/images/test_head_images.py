"""The heads' files of an exposure, and whether they are alike."""

import numpy as np
import pandas as pd
import pytest
import tifffile

from acx4files import flight as flights
from acx4files.images.head_images import flight_files, head_files, read_heads
from acx4lib.errors import FlightError
from acx4lib.synthetic_image.head_map import mapped_file
from support.flights import pictured

CAMERAS = pictured.orientation().heads


@pytest.fixture
def folder(tmp_path):
    return pictured.write_flight(tmp_path / "flight")


def edit(folder, **new):
    """Replace the images' file names: by image, an empty one for no file."""
    path = folder / "heads" / "images.csv"
    table = pd.read_csv(path, dtype=str, keep_default_na=False)
    table["file"] = [
        new.get(name, file) for name, file in zip(table["image"], table["file"], strict=True)
    ]
    table.to_csv(path, index=False)


def paths(folder, exposure="E0"):
    return [pictured.head_path(folder, exposure, name) for name in pictured.HEADS]


def problems(files):
    with pytest.raises(FlightError) as error:
        read_heads(files, CAMERAS)
    return error.value.problems


def test_exposures_with_all_files_are_found_in_the_order_of_the_heads(folder):
    complete, incomplete = head_files(flights.read(folder), ["RIGHT", "LEFT"])
    assert list(complete) == ["E0", "E1"]
    assert list(complete["E1"].paths) == paths(folder, "E1")[::-1]
    assert incomplete == {}


def test_files_reached_by_a_link_are_named_within_the_flight(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder)
    complete, _ = head_files(flights.read(tmp_path / "link"), pictured.HEADS)
    assert complete["E0"].paths[0] == paths(tmp_path / "link")[0]


def test_a_missing_head_is_named(folder):
    edit(folder, E1_RIGHT="")
    complete, incomplete = head_files(flights.read(folder), pictured.HEADS)
    assert list(complete) == ["E0"]
    assert incomplete == {
        "E1": f"{folder}/heads/images.csv: exposure E1: no file for RIGHT; an exposure is "
        "rendered from all of LEFT, RIGHT"
    }


def test_a_flight_without_any_file_says_how_to_name_them(folder):
    edit(folder, E0_LEFT="", E0_RIGHT="", E1_LEFT="", E1_RIGHT="")
    with pytest.raises(FlightError) as error:
        head_files(flights.read(folder), pictured.HEADS)
    assert error.value.problems == (
        f"{folder}/heads/images.csv: names no files of head images; give heads/images.csv a "
        "column 'file' with the TIFF of every head's image, relative to heads/",
    )


@pytest.fixture
def twice(tmp_path):
    """Return a flight with E0, E1 in block heads and E1 in a calibration block of heads."""
    folder = pictured.write_flight(
        tmp_path / "twice", blocks=("heads", "calibration"), mounted=pictured.HEADS
    )
    toml = (folder / "flight.toml").read_text()
    (folder / "flight.toml").write_text(
        toml.replace("[synthetic]", '[synthetic]\nmeasured_in = "heads"')
    )
    (folder / "heads" / "images").rename(folder / "calibration" / "images")
    (folder / "heads" / "images").symlink_to("../calibration/images")
    table = pd.read_csv(folder / "heads" / "images.csv", dtype=str, keep_default_na=False)
    table["file"] = table["file"].where(table["exposure"] == "E1", "")
    table.to_csv(folder / "calibration" / "images.csv", index=False)
    return folder


def test_every_block_that_is_measured_in_heads_has_files(twice):
    files = flight_files(flights.read(twice), pictured.HEADS)
    assert list(files.complete) == ["E0", "heads/E1", "calibration/E1"]
    assert files.complete["calibration/E1"].exposure == "calibration/E1"
    assert files.chosen(None) == list(files.complete)
    assert files.chosen(["calibration/E1", "heads/E0", "E0"]) == ["calibration/E1", "E0"]


def test_an_exposure_that_two_blocks_have_is_asked_for_by_its_block(twice):
    files = flight_files(flights.read(twice), pictured.HEADS)
    with pytest.raises(FlightError) as error:
        files.chosen(["E1", "E7"])
    tables = ", ".join(f"{twice}/{name}/images.csv" for name in ("heads", "calibration"))
    assert error.value.problems == (
        "exposure E1: there are 2 of this name; say heads/E1 or calibration/E1",
        f"{tables}: no files of an exposure E7; complete are E0, heads/E1, calibration/E1",
    )


def test_pictures_in_the_calibration_block_alone_are_enough(twice):
    edit(twice, E0_LEFT="", E0_RIGHT="", E1_LEFT="", E1_RIGHT="")
    files = flight_files(flights.read(twice), pictured.HEADS)
    assert list(files.complete) == ["E1"]
    assert files.chosen(["calibration/E1"]) == ["E1"]


def test_blocks_measured_in_synthetic_images_have_no_pictures_of_heads(twice):
    toml = twice / "flight.toml"
    toml.write_text(toml.read_text().replace('measured_in = "heads"', ""))
    assert list(flight_files(flights.read(twice), pictured.HEADS).complete) == ["E0", "E1"]


def test_heads_are_read_with_their_reduction_and_can_be_forgotten(folder):
    heads = read_heads(paths(folder), CAMERAS)
    assert heads.reduction == pictured.REDUCTION
    assert all(mapped_file(image) is not None for image in heads.images)
    before = heads.images[0].copy()
    heads.forget()
    np.testing.assert_array_equal(heads.images[0], before)
    expected = pictured.head_images(pictured.scene(1))["RIGHT"]
    np.testing.assert_array_equal(heads.images[1], expected)


def test_every_bad_file_of_an_exposure_is_said(folder):
    files = paths(folder)
    files[0].write_bytes(b"")
    files[1].unlink()
    assert [problem.partition(": ")[0] for problem in problems(files)] == [*map(str, files)]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda a: (a >> 8).astype(np.uint8), "has pixels of 8 bit, the other heads have 16"),
        (lambda a: a[..., 0], "has 1 bands, the other heads have 3"),
        (
            lambda a: a[: 3000 // 16, : 4000 // 16],
            "is at 1/16 of the size, the other heads have 1/8",
        ),
    ],
)
def test_heads_must_be_alike(folder, change, says):
    left, right = paths(folder)
    tifffile.imwrite(right, change(tifffile.imread(right)))
    assert problems([left, right]) == (f"{right}: {says}; all must be alike",)
