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
    GAMMA,
    PREVIEW_PX,
    TILE,
    level_sizes,
    read_about,
    write,
    write_preview,
)
from acx4lib.synthetic_image.rendering import halve

HEIGHT, WIDTH = 1301, 1100
ABOUT = {"exposure": "H3-04", "name": "Jaguariaíva", "f_mm": 74.0, "heads": [{"camera": "CAM1"}]}


def picture(rng, bands=3, dtype="uint16", shape=(HEIGHT, WIDTH)):
    """Return noise with a black corner: no head saw it."""
    image = rng.integers(1, np.iinfo(dtype).max, (*shape, bands), dtype=dtype, endpoint=True)
    image[:300, :200] = 0
    return image


def written(path, image, **how):
    colour = image.shape[2] >= 3
    about = {"pixel_mm": 0.0056, "dtype": image.dtype.name, "colour": colour, **how}
    stripes = (image[i : i + TILE] for i in range(0, len(image), TILE))
    write(path, stripes, image.shape, ABOUT, **about)
    return path


def opened(path, **how):
    """Open with GDAL, which says that an image is not georeferenced; it is not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        return rasterio.open(path, **how)


@pytest.mark.parametrize(
    ("bands", "dtype"), [(1, "uint16"), (2, "uint8"), (3, "uint16"), (4, "uint8")]
)
def test_gdal_reads_what_was_written(tmp_path, rng, bands, dtype):
    image = picture(rng, bands, dtype)
    path = written(tmp_path / "x.tif", image)
    with opened(path) as found:
        np.testing.assert_array_equal(np.moveaxis(found.read(), 0, -1), image)
        assert found.dtypes == (dtype,) * bands
        assert found.nodatavals == (0.0,) * bands
        assert found.block_shapes == [(TILE, TILE)] * bands
        assert [found.overviews(band) for band in found.indexes] == [[2, 4]] * bands
        names = ["gray", "undefined"] if bands < 3 else ["red", "green", "blue", "undefined"]
        assert [colour.name for colour in found.colorinterp] == names[:bands]
        tags = found.tags()
    assert json.loads(tags["TIFFTAG_IMAGEDESCRIPTION"]) == ABOUT == read_about(path)
    assert float(tags["TIFFTAG_XRESOLUTION"]) == pytest.approx(10 / 0.0056, rel=1e-6)  # 32 bit
    assert tags["TIFFTAG_RESOLUTIONUNIT"] == "3 (pixels/cm)"
    assert {path.name for path in tmp_path.iterdir()} == {"x.tif"}


def test_gdals_overviews_are_means_of_what_was_seen(tmp_path, rng):
    image = picture(rng)
    written(tmp_path / "x.tif", image)
    expected = image
    for level in range(2):
        expected = means(expected)
        with opened(tmp_path / "x.tif", overview_level=level) as found:
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
@pytest.mark.parametrize("shape", [(2, 2, 1), (7, 5, 4), (1, 1, 3), (64, 33, 2)])
def test_half_an_image_is_the_rounded_mean(rng, dtype, shape):
    image = rng.integers(0, 9, shape, dtype=dtype)
    for one in (image, np.iinfo(dtype).max - image):
        small = np.empty_like(means(one))
        halve(small, one)
        np.testing.assert_array_equal(small, means(one))


def test_tifffile_reads_a_bigtiff_and_its_levels(tmp_path, rng):
    image = picture(rng)
    with tifffile.TiffFile(written(tmp_path / "x.tif", image)) as found:
        assert found.is_bigtiff
        assert [page.shape[:2] for page in found.pages] == level_sizes(HEIGHT, WIDTH)
        assert [page.subfiletype for page in found.pages] == [0, 1, 1]
        np.testing.assert_array_equal(found.pages[0].asarray(), image)


@pytest.mark.parametrize("shape", [(1, 1), (3, 700), (512, 512), (513, 511)])
def test_any_size_can_be_written(tmp_path, rng, shape):
    image = picture(rng, 3, "uint16", shape) | 1
    with opened(written(tmp_path / "x.tif", image)) as found:
        np.testing.assert_array_equal(np.moveaxis(found.read(), 0, -1), image)


def test_an_image_that_breaks_off_leaves_the_earlier_one(tmp_path, rng):
    image = picture(rng)
    before = written(tmp_path / "x.tif", image).read_bytes()

    def breaks():
        yield image[:TILE]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "x.tif", breaks(), image.shape, ABOUT, pixel_mm=0.0056)
    assert (tmp_path / "x.tif").read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"x.tif"}


FULL = """
import resource, signal, sys
import numpy as np
from pathlib import Path
from acx4lib.errors import OutputError
from acx4files.images.tiff import write
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]),) * 2)
stripes = (np.ones((n, 1100, 3), np.uint16) for n in (512, 512, 277))
try:
    write(Path(sys.argv[1]), stripes, (1301, 1100, 3), {}, pixel_mm=0.0056)
except OutputError as error:
    print(error)
"""


@pytest.mark.parametrize("limit", [100, 1_000_000, 9_500_000])
def test_no_room_leaves_nothing(tmp_path, limit):
    """A file may not grow beyond a limit, as if the disk were full."""
    command = [sys.executable, "-c", FULL, str(tmp_path / "x.tif"), str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert re.match(re.escape(f"{tmp_path / 'x.tif'}: ") + "(File too large|No space)", done.stdout)
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_a_preview_is_small_stretched_and_of_the_same_scene(tmp_path):
    """Grey values rise from left to right in a narrow range, and from dark to bright in it."""
    rows, cols = 2600, 1900
    ramp = np.linspace(9000, 11000, cols).astype(np.uint16)
    image = np.repeat(np.broadcast_to(ramp, (rows, cols))[..., None], 3, axis=2).copy()
    image[:, :100] = 0
    write_preview(tmp_path / "x.jpg", written(tmp_path / "x.tif", image))
    shown = cv2.imread(str(tmp_path / "x.jpg"))
    assert shown.shape == (PREVIEW_PX, round(PREVIEW_PX * cols / rows), 3)
    middle = shown[1000].astype(float)
    assert middle[:60].max() < 20  # not seen; JPEG's own errors are of this size
    assert middle[-20:].min() > 240
    light = middle[200:1400, 1] ** GAMMA
    assert np.corrcoef(np.arange(200, 1400), light)[0, 1] > 0.999
