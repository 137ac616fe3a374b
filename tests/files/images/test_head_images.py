"""The heads' files of an exposure, and whether they are alike."""

import numpy as np
import pandas as pd
import pytest
import tifffile

from acx4files import flight as flights
from acx4files.images.head_images import FlightFiles, HeadFiles, head_files, read_heads
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


def test_a_missing_head_is_named(folder):
    edit(folder, E1_RIGHT="")
    complete, incomplete = head_files(flights.read(folder), pictured.HEADS)
    assert list(complete) == ["E0"]
    assert incomplete == {
        "E1": f"{folder}/heads/images.csv: exposure E1: no file for RIGHT; an exposure is "
        "rendered from all of LEFT, RIGHT"
    }


def test_exposures_are_chosen_by_name_and_by_block_where_two_have_it():
    files = {name: HeadFiles(exposure=name, paths=()) for name in ("E0", "heads/E1", "other/E1")}
    known = FlightFiles(complete=files, incomplete={"E2": "no file"}, tables=("images.csv",))
    assert known.chosen(None) == list(files)
    assert known.chosen(["other/E1", "E2", "E0", "E0"]) == ["other/E1", "E2", "E0"]
    with pytest.raises(FlightError) as error:
        known.chosen(["E1", "E7"])
    assert error.value.problems == (
        "exposure E1: there are 2 of this name; say heads/E1 or other/E1",
        "images.csv: no files of an exposure E7; complete are E0, heads/E1, other/E1",
    )


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
