"""The heads' files of an exposure: read, whatever their layout, or refused in a sentence."""

import contextlib

import cv2
import numpy as np
import pandas as pd
import pytest
import tifffile

from acx4files import flight as flights
from acx4files.images.head_images import (
    fingerprint,
    head_files,
    image_from_file,
    read_heads,
)
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import Camera, Interior
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


def test_heads_are_read_with_their_reduction_and_can_be_forgotten(folder):
    heads = read_heads(paths(folder), CAMERAS)
    assert heads.reduction == pictured.REDUCTION
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
        (lambda a: (a >> 8).astype(np.uint8), "8 bit, 3 bands, 1/8"),
        (lambda a: a[..., 0], "16 bit, 1 bands, 1/8"),
        (lambda a: a[: 3000 // 16, : 4000 // 16], "16 bit, 3 bands, 1/16"),
    ],
)
def test_heads_must_be_alike(folder, change, says):
    left, right = paths(folder)
    tifffile.imwrite(right, change(tifffile.imread(right)))
    assert problems([left, right]) == (
        f"{right}: has {says} of the size, the other heads have 16 bit, 3 bands, 1/8 of the size; "
        "all must be alike",
    )


# --- one file of every kind, and what is said of those that are none ---------------------------


CAMERA = Camera(name="CAM1", width_px=120, height_px=90, pixel_mm=0.006, interior=Interior(f=74.0))
GOOD = "uncompressed"
LAYOUTS = {
    GOOD: {},
    "rows a strip": {"rowsperstrip": 7},
    "tiled": {"tile": (32, 48)},
    "deflate": {"compression": "deflate", "predictor": True},
    "lzw": {"compression": "lzw", "tile": (16, 16)},
    "zstd": {"compression": "zstd"},
    "big": {"bigtiff": True},
    "big-endian": {"byteorder": ">"},
    "little-endian": {"byteorder": "<"},
}


def picture(rng, bands=3, dtype="uint16", shape=(90, 120)):
    return rng.integers(1, np.iinfo(dtype).max, (*shape, bands), dtype=dtype)


def write(path, image, **how):
    """Write bands together or, with planarconfig separate, one after the other."""
    if how.get("planarconfig") == "separate":
        image = np.moveaxis(image, -1, 0)
    colours = "rgb" if image.ndim == 3 and 3 in (image.shape[-1], image.shape[0]) else "minisblack"
    tifffile.imwrite(path, image, **{"photometric": colours, **how})
    return path


def refused(path):
    """Return the one sentence why a file is not read."""
    with pytest.raises(FlightError) as error:
        image_from_file(path, CAMERA)
    (problem,) = error.value.problems
    name, _, says = problem.partition(": ")
    assert name == str(path)
    assert "\n" not in says
    return says


@pytest.mark.parametrize("how", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_every_layout_gives_the_same_pixels(tmp_path, rng, how, dtype):
    image = picture(rng, dtype=dtype)
    found = image_from_file(write(tmp_path / "x.tif", image, **how), CAMERA)
    np.testing.assert_array_equal(found.image, image)
    assert found.image.dtype == dtype
    assert found.image.dtype.isnative
    assert found.image.flags.c_contiguous
    assert not found.image.flags.writeable
    assert found.reduction == 1


@pytest.mark.parametrize("bands", [1, 2, 3, 4])
@pytest.mark.parametrize("compression", [None, "deflate"])
def test_separate_bands_are_put_together(tmp_path, rng, bands, compression):
    image = picture(rng, bands=bands)
    how = {"planarconfig": "separate", "compression": compression} if bands > 1 else {}
    extra = {} if bands in (1, 3) else {"extrasamples": ["unspecified"] * (bands - 1)}
    path = write(
        tmp_path / "x.tif", image, **{**how, **extra, "photometric": "minisblack"} if extra else how
    )
    np.testing.assert_array_equal(image_from_file(path, CAMERA).image, image)


def test_jpeg_within_a_tiff_is_decoded_to_rgb(tmp_path):
    image = np.full((90, 120, 3), (200, 100, 50), np.uint8)
    path = write(tmp_path / "x.tif", image, compression="jpeg", rowsperstrip=30)
    np.testing.assert_allclose(image_from_file(path, CAMERA).image, image, atol=2)


def test_overviews_are_no_images_of_their_own(tmp_path, rng):
    image = picture(rng)
    with tifffile.TiffWriter(tmp_path / "x.tif") as tiff:
        tiff.write(image, photometric="rgb", metadata=None)
        tiff.write(image[::2, ::2], photometric="rgb", subfiletype=1, metadata=None)
    np.testing.assert_array_equal(image_from_file(tmp_path / "x.tif", CAMERA).image, image)


@pytest.mark.parametrize("k", [1, 2, 7])
def test_an_image_at_a_whole_part_of_the_size_says_which(tmp_path, rng, k):
    path = write(tmp_path / "x.tif", picture(rng, shape=(90 // k, 120 // k)))
    assert image_from_file(path, CAMERA).reduction == k


SIZE = "CAM1 has 120 x 90, and its images that or 1/K of it, K a whole number"
GREY = np.ones((90, 120), np.uint8)
RGB = np.ones((90, 120, 3), np.uint16)
TURNED = {"extratags": [(274, "H", 1, 3, True)], "metadata": None}
CMAP = np.zeros((3, 256), "u2")


@pytest.mark.parametrize(
    ("image", "how", "says"),
    [
        (RGB[:, :-1], {}, f"has 119 x 90 px; {SIZE}"),
        (RGB[:46, :60], {}, f"has 60 x 46 px; {SIZE}"),
        (np.repeat(RGB, 2, axis=1), {}, f"has 240 x 90 px; {SIZE}"),
        (RGB.astype("f4"), {}, "has pixels of type float32; unsigned whole numbers of 8 or 16 bit"),
        (RGB.astype("i2"), {}, "has pixels of type int16; unsigned whole numbers of 8 or 16 bit"),
        (GREY.astype(bool), {}, "has pixels of type bool; unsigned whole numbers of 8 or 16 bit"),
        (GREY, {"photometric": "palette", "colormap": CMAP}, "is stored as PALETTE; grey"),
        (GREY, {"photometric": "miniswhite"}, "is stored as MINISWHITE; grey values or RGB"),
        (RGB, TURNED, "is to be shown turned (orientation 3); store the pixels as shown"),
        (
            np.ones((90, 120, 4), np.uint8),
            {"photometric": "rgb", "extrasamples": ["unassalpha"]},
            "has a band of transparency (alpha); write it without",
        ),
        (
            np.ones((90, 120, 5), np.uint8),
            {"photometric": "minisblack", "planarconfig": "contig"},
            "has 5 bands; one to 4 are read",
        ),
        (
            np.ones((3, 90, 120), np.uint8),
            {"photometric": "minisblack"},
            "holds 3 images; all bands must be in one",
        ),
    ],
)
def test_what_is_not_read_is_one_sentence(tmp_path, image, how, says):
    assert refused(write(tmp_path / "x.tif", image, **how)).startswith(says)


def test_parts_that_were_never_written_are_found(tmp_path):
    path = write(tmp_path / "x.tif", RGB, metadata=None, compression="deflate", tile=(32, 32))
    with tifffile.TiffFile(path, mode="r+b") as tiff:
        tag = tiff.pages.first.tags["TileByteCounts"]
        tag.overwrite((0, *tag.value[1:]))
    assert refused(path) == "has parts without pixels; was the writing interrupted?"


def test_what_is_no_tiff_is_said(tmp_path, rng):
    path = tmp_path / "x.tif"
    assert refused(path) == "cannot be read (No such file or directory)"
    assert refused(tmp_path) == "cannot be read (Is a directory)"
    for text in (b"", b"no image at all, but a long text"):
        path.write_bytes(text)
        assert refused(path).startswith("is no TIFF, or a damaged one (")
    path.write_bytes(cv2.imencode(".jpg", picture(rng, dtype="uint8"))[1].tobytes())
    assert refused(path).startswith("is no TIFF")


@pytest.mark.parametrize("how", LAYOUTS.values(), ids=LAYOUTS)
def test_a_file_cut_off_anywhere_is_one_sentence(tmp_path, rng, how, capfd):
    """The reader's own messages are kept from standard error, too."""
    path = write(tmp_path / "x.tif", picture(rng), metadata=None, **how)
    whole = path.read_bytes()
    for share in (0.001, 0.01, 0.1, 0.5, 0.9, 0.999):
        path.write_bytes(whole[: int(share * len(whole))])
        assert refused(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("how", [LAYOUTS["deflate"], {}])
def test_wrong_bytes_give_pixels_or_a_sentence(tmp_path, rng, how, capfd):
    """Nothing else, wherever they are: no other exception, no message, no image of other size."""
    path = write(tmp_path / "x.tif", picture(rng), **how)
    whole = path.read_bytes()
    places = [*range(200), *rng.integers(200, len(whole), 100).tolist()]
    for at in places:
        damaged = bytearray(whole)
        damaged[at] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        with contextlib.suppress(FlightError):
            found = image_from_file(path, CAMERA)
            assert found.image.shape[:2] == (90 // found.reduction, 120 // found.reduction)
            assert found.image.shape[2] <= 4
    assert capfd.readouterr() == ("", "")


def test_a_fingerprint_is_of_the_content_alone(tmp_path, rng):
    image = picture(rng, shape=(900, 1200))
    one, two = (write(tmp_path / name, image) for name in ("a.tif", "b.tif"))
    assert fingerprint(one) == fingerprint(two)
    write(two, image[::-1])
    assert fingerprint(one) != fingerprint(two)
    (tmp_path / "empty").write_bytes(b"")
    assert fingerprint(tmp_path / "empty") != fingerprint(one)
