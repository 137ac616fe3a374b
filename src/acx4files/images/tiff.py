"""Images too large for the memory, written as a tiled BigTIFF with overviews; and previews.

The rows come in stripes while they are rendered. A file gets its name when it is complete.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import tifffile

from acx4files.results import whole_files
from acx4lib.expected import Raster
from acx4lib.synthetic_image.rendering import halve

TILE = 512
"""Rows and columns of a tile; the last overview is not larger."""

PREVIEW_PX = 2000
"""Longer side of a preview."""

GAMMA = 1.6
"""Gamma of a preview: dark ground is visible, and colours do not become pale."""

_GDAL_NODATA = (42113, "s", 0, "0", True)
_UNSPECIFIED = 0


def write(
    path: Path,
    stripes: Iterable[Raster],
    shape: tuple[int, int, int],
    about: Mapping[str, Any],
    *,
    pixel_mm: float,
    dtype: str = "uint16",
    colour: bool = True,
) -> None:
    """Write an image stripe by stripe while it is made.

    Parameters
    ----------
    path : Path
        An earlier file of this name is replaced.
    stripes : iterable of ndarray, shape (TILE, width, bands)
        From top to bottom; the last may be lower. A stripe may be overwritten when the next is
        requested.
    shape : tuple of int
        Height, width and bands.
    about : mapping
        Written as JSON into the ImageDescription.
    pixel_mm : float
        Size of a pixel in the image plane.
    dtype : str
        ``uint8`` or ``uint16``.
    colour : bool
        Whether the first three bands are red, green and blue.

    Raises
    ------
    OutputError
        Where there is no space for it.
    OSError
        Where the file cannot be written otherwise, as without permission.

    Notes
    -----
    No-data is zero, and it is declared in GDAL's tag. The meaning of a fourth band is left
    unspecified: it is not transparency. The same pixels give the same bytes. The overviews, a
    third of the image, are kept in memory.
    """
    height, width, bands = shape
    sizes = level_sizes(height, width)
    smaller = [np.empty((*size, bands), dtype) for size in sizes[1:]]
    how: dict[str, Any] = {
        "dtype": dtype,
        "tile": (TILE, TILE),
        "photometric": "rgb" if colour else "minisblack",
        "planarconfig": "contig" if bands > 1 else None,
        "extrasamples": [_UNSPECIFIED] * (bands - (3 if colour else 1)) or None,
        "metadata": None,
        "resolutionunit": "CENTIMETER",
        "extratags": [_GDAL_NODATA],
    }
    first = {"description": json.dumps(about, indent=1), "software": "acx4lib", "subfiletype": 0}
    with whole_files.appearing(path) as part, tifffile.TiffWriter(part, bigtiff=True) as tiff:
        for level, size in enumerate(sizes):
            if level > 1:
                halve(smaller[level - 1], smaller[level - 2])
            rows = _halved(stripes, smaller[:1]) if level == 0 else _stripes(smaller[level - 1])
            tiff.write(
                _tiles(rows),
                shape=(*size, bands) if bands > 1 else size,
                resolution=2 * (10 / pixel_mm * max(size) / max(height, width),),
                **how,
                **(first if level == 0 else {"software": False, "subfiletype": 1}),
            )


def level_sizes(height: int, width: int) -> list[tuple[int, int]]:
    """Return rows and columns of an image and its overviews; the last fits into a tile."""
    sizes = [(height, width)]
    while max(sizes[-1]) > TILE:
        rows, cols = sizes[-1]
        sizes.append((-(-rows // 2), -(-cols // 2)))
    return sizes


def _halved(stripes: Iterable[Raster], smaller: list[Raster]) -> Iterator[Raster]:
    """Yield stripes; fill the first overview, if there is any, with them."""
    row = 0
    for stripe in stripes:
        for overview in smaller:
            halve(overview[row : row + TILE // 2], stripe)
        yield stripe
        row += TILE // 2


def _stripes(image: Raster) -> Iterator[Raster]:
    return (image[row : row + TILE] for row in range(0, len(image), TILE))


def _tiles(stripes: Iterable[Raster]) -> Iterator[Raster]:
    """Yield tiles row by row; those at the border are smaller, and the writer fills them up."""
    for rows in stripes:
        for col in range(0, rows.shape[1], TILE):
            tile = rows[:, col : col + TILE]
            yield tile[..., 0] if tile.shape[2] == 1 else tile


def read_about(path: Path) -> dict[str, Any]:
    """Return the description in an image; empty for a file that `write` did not write."""
    try:
        with tifffile.TiffFile(path) as tiff:
            about = json.loads(tiff.pages.first.description)
    except (OSError, ValueError, LookupError):
        return {}
    return about if isinstance(about, dict) else {}


def write_preview(path: Path, image_path: Path) -> None:
    """Write a small 8-bit JPEG of an image, with its contrast stretched.

    Parameters
    ----------
    path : Path
    image_path : Path
        An image that `write` wrote; it is not changed. Only the preview is stretched between the
        percentiles 0.5 and 99.5, the same for all bands, with a gamma for 16 bit, which are
        proportional to light. No-data stays black.
    """
    with tifffile.TiffFile(image_path) as tiff:
        large = [page for page in tiff.pages if max(page.shape[:2]) >= PREVIEW_PX]
        image = (large[-1] if large else tiff.pages.first).asarray()
        is_colour = tiff.pages.first.photometric == tifffile.PHOTOMETRIC.RGB
    image = image.reshape(*image.shape[:2], -1)[..., : 3 if is_colour else 1]
    factor = min(PREVIEW_PX / max(image.shape[:2]), 1)
    rows, cols = (max(round(n * factor), 1) for n in image.shape[:2])
    image = cv2.resize(image, (cols, rows), interpolation=cv2.INTER_AREA).reshape(rows, cols, -1)
    values = image[image > 0]
    low, high = np.percentile(values, [0.5, 99.5]) if len(values) else (0.0, 1.0)
    scaled = np.clip((image - np.float32(low)) / np.float32(max(high - low, 1.0)), 0, 1)
    shown = scaled ** np.float32(1 / GAMMA if image.dtype == np.uint16 else 1)
    shown = np.where(image > 0, np.rint(255 * shown), 0).astype(np.uint8)
    _, jpeg = cv2.imencode(".jpg", shown[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    whole_files.write(path, jpeg.tobytes())
