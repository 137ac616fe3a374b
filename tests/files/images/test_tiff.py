"""The image's file as other programs read it, and what is left where it cannot be written."""

import json
import re
import subprocess
import sys
import warnings

import cv2
import numpy as np
import pytest
import rasterio
import tifffile

from acx4files.images.tiff import (
    COMPRESSIONS,
    GAMMA,
    PREVIEW_PX,
    TILE,
    Format,
    halved,
    level_sizes,
    read_about,
    write,
    write_preview,
)

HEIGHT, WIDTH = 1301, 1100
ABOUT = {"exposure": "H3-04", "name": "Jaguariaíva", "f_mm": 74.0, "heads": [{"camera": "CAM1"}]}


def form(bands=3, dtype="uint16", compression="none", shape=(HEIGHT, WIDTH)):
    return Format(
        height=shape[0],
        width=shape[1],
        bands=bands,
        dtype=dtype,
        pixel_mm=0.0056,
        compression=compression,
    )


def picture(rng, bands=3, dtype="uint16", shape=(HEIGHT, WIDTH)):
    """Return noise with a black corner: no head saw it."""
    image = rng.integers(1, np.iinfo(dtype).max, (*shape, bands), dtype=dtype, endpoint=True)
    image[:300, :200] = 0
    return image


def stripes(image, height=333):
    return (image[i : i + height] for i in range(0, len(image), height))


@pytest.fixture
def geo():
    """Open with GDAL, which says that an image is not georeferenced; it is not."""

    def opened(path, **how):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
            return rasterio.open(path, **how)

    return opened


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize(
    ("bands", "dtype"), [(1, "uint16"), (2, "uint8"), (3, "uint16"), (4, "uint8")]
)
def test_gdal_reads_what_was_written(tmp_path, rng, geo, compression, bands, dtype):
    image, path = picture(rng, bands, dtype), tmp_path / "x.tif"
    write(path, stripes(image), form(bands, dtype, compression), ABOUT)
    with geo(path) as found:
        np.testing.assert_array_equal(np.moveaxis(found.read(), 0, -1), image)
        assert found.dtypes == (dtype,) * bands
        assert found.nodatavals == (0.0,) * bands
        assert found.block_shapes == [(TILE, TILE)] * bands
        assert [found.overviews(band) for band in found.indexes] == [[2, 4]] * bands
        window = rasterio.windows.Window(500, 600, 30, 40)
        part = np.moveaxis(found.read(window=window), 0, -1)
        np.testing.assert_array_equal(part, image[600:640, 500:530])
        tags = found.tags()
        says = found.tags(ns="IMAGE_STRUCTURE").get("COMPRESSION", "none").lower()
        assert says == compression
    assert json.loads(tags["TIFFTAG_IMAGEDESCRIPTION"]) == ABOUT
    assert float(tags["TIFFTAG_XRESOLUTION"]) == pytest.approx(10 / 0.0056, rel=1e-6)  # 32 bit
    assert tags["TIFFTAG_RESOLUTIONUNIT"] == "3 (pixels/cm)"
    assert {path.name for path in tmp_path.iterdir()} == {"x.tif"}


def test_gdals_overviews_are_means_of_what_was_seen(tmp_path, rng, geo):
    image = picture(rng)
    write(tmp_path / "x.tif", stripes(image, 77), form(), ABOUT)
    expected = image
    for level in range(2):
        expected = means(expected)
        with geo(tmp_path / "x.tif", overview_level=level) as found:
            np.testing.assert_array_equal(np.moveaxis(found.read(), 0, -1), expected)


def means(image):
    """Return means of 2 x 2 pixels, half up, an odd border counted twice, zeros not at all."""
    rows, cols, bands = image.shape
    image = np.pad(image, ((0, rows % 2), (0, cols % 2), (0, 0)), mode="edge")
    four = image.reshape(image.shape[0] // 2, 2, image.shape[1] // 2, 2, bands).astype(float)
    seen = np.where(four > 0, four, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of what nobody saw
        mean = np.nanmean(seen, axis=(1, 3))
    return np.floor(np.nan_to_num(mean) + 0.5).astype(image.dtype)


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
@pytest.mark.parametrize("bands", [1, 2, 3, 4])
@pytest.mark.parametrize("shape", [(2, 2), (7, 5), (1, 1), (64, 33)])
def test_halved_is_the_rounded_mean(rng, dtype, bands, shape):
    image = rng.integers(0, 9, (*shape, bands), dtype=dtype)
    np.testing.assert_array_equal(halved(image), means(image))
    bright = np.iinfo(dtype).max - image
    np.testing.assert_array_equal(halved(bright), means(bright))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("compression", ["none", "deflate", "lzw"])
@pytest.mark.parametrize(("bands", "dtype"), [(1, "uint16"), (3, "uint16"), (4, "uint8")])
def test_opencv_reads_what_was_written(tmp_path, rng, compression, bands, dtype):
    """OpenCV counts blue, green, red, and has no zstd."""
    image, path = picture(rng, bands, dtype), tmp_path / "x.tif"
    write(path, stripes(image), form(bands, dtype, compression), ABOUT)
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)  # it knows no GDAL tags
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).reshape(HEIGHT, WIDTH, bands)
    cv2.utils.logging.setLogLevel(level)
    order = [2, 1, 0, 3][:bands] if bands >= 3 else [0]
    np.testing.assert_array_equal(found[..., order], image)


def test_tifffile_reads_a_bigtiff_and_its_levels(tmp_path, rng):
    image = picture(rng)
    write(tmp_path / "x.tif", stripes(image), form(), ABOUT)
    with tifffile.TiffFile(tmp_path / "x.tif") as found:
        assert found.is_bigtiff
        assert [page.shape[:2] for page in found.pages] == level_sizes(HEIGHT, WIDTH, TILE)
        assert [page.subfiletype for page in found.pages] == [0, 1, 1]
        np.testing.assert_array_equal(found.pages[0].asarray(), image)
    assert read_about(tmp_path / "x.tif") == ABOUT


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_bytes_depend_on_the_pixels_alone(tmp_path, rng, compression):
    image = picture(rng)
    for name, height, threads in (("a.tif", 512, 1), ("b.tif", 100, 3), ("c.tif", HEIGHT, None)):
        how = form(compression=compression)
        write(tmp_path / name, stripes(image, height), how, ABOUT, threads=threads)
    first = (tmp_path / "a.tif").read_bytes()
    assert (tmp_path / "b.tif").read_bytes() == first
    assert (tmp_path / "c.tif").read_bytes() == first


def test_an_image_that_breaks_off_leaves_the_earlier_one(tmp_path, rng):
    image = picture(rng)
    write(tmp_path / "x.tif", stripes(image), form(), ABOUT)
    before = (tmp_path / "x.tif").read_bytes()

    def breaks():
        yield image[:700]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "x.tif", breaks(), form(), ABOUT)
    with pytest.raises(ValueError, match="700 rows of an image of 1301"):
        write(tmp_path / "x.tif", iter([image[:700]]), form(), ABOUT)
    with pytest.raises(ValueError, match="a stripe"):
        write(tmp_path / "x.tif", iter([image[:, :-1]]), form(), ABOUT)
    with pytest.raises(ValueError, match="a stripe"):
        write(tmp_path / "x.tif", iter([image, image]), form(), ABOUT)
    assert (tmp_path / "x.tif").read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"x.tif"}


FULL = """
import resource, signal, sys
import numpy as np
from pathlib import Path
from acx4lib.errors import OutputError
from acx4files.images.tiff import Format, write
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
form = Format(height=1301, width=1100, bands=3, dtype="uint16", pixel_mm=0.0056)
try:
    write(Path(sys.argv[1]), (np.ones((1301, 1100, 3), np.uint16) for _ in range(1)), form, {})
except OutputError as error:
    print(error)
"""


@pytest.mark.parametrize("limit", [100, 1_000_000, 5_000_000, 9_500_000])
def test_no_room_leaves_nothing(tmp_path, limit):
    """A file may not grow beyond a limit, as if the disk were full."""
    command = [sys.executable, "-c", FULL, str(tmp_path / "x.tif"), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    says = r"(File too large|No space left on device); \S+ MB are free"
    assert re.match(re.escape(f"{tmp_path / 'x.tif'}: ") + says, done.stdout)
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_a_preview_is_small_stretched_and_of_the_same_scene(tmp_path):
    """Grey values rise from left to right in a narrow range, and from dark to bright in it."""
    rows, cols = 2600, 1900
    ramp = np.linspace(9000, 11000, cols).astype(np.uint16)
    image = np.repeat(np.broadcast_to(ramp, (rows, cols))[..., None], 3, axis=2).copy()
    image[:, :100] = 0
    write(tmp_path / "x.tif", stripes(image), form(shape=(rows, cols)), ABOUT)
    write_preview(tmp_path / "x.jpg", tmp_path / "x.tif")
    shown = cv2.imread(str(tmp_path / "x.jpg"))
    assert shown.shape == (PREVIEW_PX, round(PREVIEW_PX * cols / rows), 3)
    middle = shown[1000].astype(float)
    assert middle[:60].max() < 20  # not seen; JPEG's own errors are of this size
    assert middle[-20:].min() > 240
    light = middle[200:1400, 1] ** GAMMA
    assert np.corrcoef(np.arange(200, 1400), light)[0, 1] > 0.999
