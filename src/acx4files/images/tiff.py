"""TIFF files: the memory of tags checked before reading, and large images written.

A tag says where its values lie. Thousands of tags may name the same megabyte of a small file, and
a reader makes a copy for each of them.
"""

from __future__ import annotations

import json
import logging
import os
import struct
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from types import TracebackType
from typing import IO, Any, BinaryIO, Self

import cv2
import numpy as np
import tifffile
from numpy.typing import NDArray

from acx4files.results import whole_files
from acx4lib import expected
from acx4lib.expected import Raster
from acx4lib.least_squares import processors

MOST_BYTES = 20_000_000
"""Largest sum of the values of all tags; places of a million tiles take 16 MB."""

MOST_TAGS = 4096
"""Largest number of tags of a directory."""

SIZES = {
    **dict.fromkeys((1, 2, 6, 7), 1),
    **dict.fromkeys((3, 8), 2),
    **dict.fromkeys((4, 9, 11, 13), 4),
    **dict.fromkeys((5, 10, 12, 16, 17, 18), 8),
}
"""Bytes of a value by the type of the tag."""

EXIF, GPS = 34665, 34853
BELOW = (EXIF, GPS)
"""Tags that name a directory of others."""

UNREAD = {37724, 34377, 34675}
"""Tags of layers and colour profiles, which are large and not used here."""

_BROKEN = (struct.error, OSError, ValueError, OverflowError)


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """Encoding of numbers in a file: byte order, and width of offsets."""

    order: str
    big: bool

    @property
    def tag(self) -> struct.Struct:
        return struct.Struct(self.order + ("HHQQ" if self.big else "HHII"))

    @property
    def place(self) -> struct.Struct:
        return struct.Struct(self.order + ("Q" if self.big else "I"))

    @property
    def number(self) -> struct.Struct:
        return struct.Struct(self.order + ("Q" if self.big else "H"))


def opened(source: Path | BinaryIO) -> tifffile.TiffFile:
    """Open a TIFF, but never as a microscope format, which is read without a limit.

    Parameters
    ----------
    source : Path or binary file
        A file whose tags have no `fault`.
    """
    return tifffile.TiffFile(source, is_lsm=False, is_ndpi=False, is_scanimage=False, is_stk=False)


@contextmanager
def in_silence() -> Iterator[None]:
    """Suppress messages of the TIFF reader about problems reported elsewhere."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def end_of_pixels(tiff: tifffile.TiffFile) -> int:
    """Return the size that a TIFF needs for the parts of its first image, bytes, by its tags."""
    page = tiff.pages.first
    places = zip(page.dataoffsets, page.databytecounts, strict=False)
    return max((int(offset) + int(n) for offset, n in places), default=0)


def is_cut_off(file: BinaryIO, size: int) -> bool:
    """Tell whether a TIFF ends before its tags or its pixels do.

    Parameters
    ----------
    file : binary file
        At its beginning.
    size : int
        Of the file, bytes.
    """
    try:
        if _end_of_tags(file) > size:
            return True
        file.seek(0)
        if fault(file, size):
            return False  # reported where the file is read
        file.seek(0)
        with in_silence():
            return end_of_pixels(opened(file)) > size
    except (*_BROKEN, TypeError, LookupError):  # damaged otherwise, or no TIFF
        return False


def _end_of_tags(file: BinaryIO) -> int:
    """Return the end of the first directory of a TIFF, bytes; 0 for other files."""
    start = _begin(file)
    if start is None:
        return 0
    kind, offset = start
    file.seek(offset)
    number = file.read(kind.number.size)
    n = kind.number.unpack(number)[0] if len(number) == kind.number.size else 0
    return offset + kind.number.size + n * kind.tag.size + kind.place.size


def _begin(file: BinaryIO) -> tuple[_Kind, int] | None:
    """Return the encoding of a TIFF, and the offset of its first directory; None for others."""
    start = file.read(16)
    order = {b"II": "<", b"EP": "<", b"MM": ">"}.get(start[:2], "")
    if not order or len(start) < 8:
        return None
    (version,) = struct.unpack(order + "H", start[2:4])
    kind = _Kind(order=order, big=version == 43)
    (offset,) = kind.place.unpack_from(start, 8 if kind.big else 4)
    return kind, offset


def fault(file: BinaryIO, size: int, *, pages: int = 1, below: bool = False) -> str:
    """Return the reason not to read the tags of a TIFF; empty without any, or for other files.

    Parameters
    ----------
    file : binary file
        At its beginning.
    size : int
        Of the file, bytes.
    pages : int
        Directories of images that are read.
    below : bool
        Whether the directories of EXIF and GPS are read as well.
    """
    total = 0
    most = min(size, MOST_BYTES)
    try:
        for code, n_bytes in _values(file, pages, below=below):
            total += n_bytes if code not in UNREAD else 0
            if total > most:
                return f"has tags of more than {most} bytes, in {size}; they may share none"
    except _BROKEN:  # the reader says in which way it is damaged
        pass
    return ""


def _values(file: BinaryIO, pages: int, *, below: bool) -> Iterator[tuple[int, int]]:
    """Yield tags and the bytes of their values, directory after directory."""
    start = _begin(file)
    if start is None:
        return
    kind, offset = start
    for _ in range(pages):
        if offset == 0:
            return
        others = []
        for code, n_bytes, value in _directory(file, kind, offset):
            yield code, n_bytes
            if below and code in BELOW:
                others.append(value)
        offset = kind.place.unpack(file.read(kind.place.size))[0]
        for directory in others:
            yield from ((code, n_bytes) for code, n_bytes, _ in _directory(file, kind, directory))


def _directory(file: BinaryIO, kind: _Kind, offset: int) -> Iterator[tuple[int, int, int]]:
    """Yield tag, bytes and offset of its values; then the file is behind the directory."""
    file.seek(offset)
    (n,) = kind.number.unpack(file.read(kind.number.size))
    if n > MOST_TAGS:
        return
    content = file.read(n * kind.tag.size)
    whole = len(content) // kind.tag.size * kind.tag.size
    for code, tag_type, count, value in kind.tag.iter_unpack(content[:whole]):
        yield code, count * SIZES.get(tag_type, 8), value


# --- Images too large for the memory, written as a tiled BigTIFF with overviews
#
# The rows come in stripes while they are rendered. A file gets its name when it is complete and on
# the disk, or never.


TILE = 512
"""Rows and columns of a tile; the last overview is not larger."""

COMPRESSIONS = ("none", "deflate", "zstd", "lzw")
"""zstd is the fastest; every program reads deflate."""

PREVIEW_PX = 2000
"""Longer side of a preview."""

GAMMA = 1.6
"""Gamma of a preview: dark ground is visible, and colours do not become pale."""

MOST_STACKED = 100
"""Largest number of bands of a stack."""

_CODEC = {"deflate": "zlib", "zstd": "zstd", "lzw": "lzw"}
"""The TIFF writer's names; its own "deflate" has a code that few programs read."""

_LEVEL = {"deflate": 1, "zstd": 1}

_AT_A_TIME = 2**25
"""Bytes of tiles that threads compress at a time."""

_GDAL_NODATA = (42113, "s", 0, "0", True)
_UNSPECIFIED = 0


@dataclass(frozen=True, kw_only=True)
class Format:
    """The format of an image.

    Attributes
    ----------
    height, width, bands : int
    dtype : str
        ``uint8`` or ``uint16``.
    pixel_mm : float
        Size of a pixel in the image plane.
    compression : str
        One of `COMPRESSIONS`.
    stack : bool
        Whether its bands are pictures of their own, and no colours.
    """

    height: int
    width: int
    bands: int
    dtype: str
    pixel_mm: float
    compression: str = "none"
    stack: bool = False

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            msg = f"compression {self.compression!r} is none of {', '.join(COMPRESSIONS)}"
            raise ValueError(msg)
        most = MOST_STACKED if self.stack else 4
        if self.dtype not in ("uint8", "uint16") or not 1 <= self.bands <= most:
            bands = f"{self.bands} of {self.dtype}"
            raise ValueError(f"1 to {most} bands of uint8 or uint16 are written, not {bands}")
        expected.whole("height", self.height)
        expected.whole("width", self.width)
        expected.positive("pixel_mm", self.pixel_mm)


def write(
    path: Path,
    stripes: Iterable[Raster],
    form: Format,
    about: Mapping[str, Any],
    *,
    threads: int | None = None,
) -> None:
    """Write an image stripe by stripe while it is made.

    Parameters
    ----------
    path : Path
        An earlier file of this name is replaced.
    stripes : iterable of ndarray, shape (rows, width, bands)
        From top to bottom, with any number of rows each. A stripe of `TILE` rows may be overwritten
        when the next is requested.
    form : Format
    about : mapping
        Written as JSON into the ImageDescription.
    threads : int, optional
        Number of threads that compress; by default one for each processor.

    Raises
    ------
    OutputError
        Where there is no space for it.
    OSError
        Where the file cannot be written otherwise, as without permission.
    ValueError
        Where the stripes do not match `form`.

    Notes
    -----
    No-data is zero, and it is declared in GDAL's tag. The meaning of a fourth band is left
    unspecified: it is not transparency. The same pixels give the same bytes.
    """
    threads = threads or processors.cores()
    sizes = _sizes(form)
    with whole_files.appearing(path) as part, _overviews(path.parent, form) as pyramid:
        with tifffile.TiffWriter(part, bigtiff=True) as tiff:
            base = _tiles(_passed_on(_checked(stripes, form), pyramid), form.width)
            _write_level(tiff, base, form, sizes[0], json.dumps(about, indent=1), threads)
            for level, size in enumerate(sizes[1:], start=1):
                tiles = _tiles(pyramid.stripes(level, TILE), size[1])
                _write_level(tiff, tiles, form, size, None, threads)
        _to_disk(part)


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
        percentiles 0.5 and 99.5, with a gamma for 16 bit.
    """
    with tifffile.TiffFile(image_path) as tiff:
        large = [page for page in tiff.pages if max(page.shape[:2]) >= PREVIEW_PX]
        image = (large[-1] if large else tiff.pages.first).asarray()
        is_colour = tiff.pages.first.photometric == tifffile.PHOTOMETRIC.RGB
    image = image.reshape(*image.shape[:2], -1)
    colours = image[..., :3] if is_colour else image[..., :1]
    shown = _stretched(_fitted(colours))
    good, jpeg = cv2.imencode(".jpg", shown[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
    if not good:
        raise ValueError(f"{path}: the preview could not be encoded")
    whole_files.write(path, jpeg.tobytes())


def _fitted(image: Raster) -> Raster:
    """Return an image whose longer side is at most that of a preview."""
    factor = PREVIEW_PX / max(image.shape[:2])
    if factor >= 1:
        return image
    rows, cols = (max(round(n * factor), 1) for n in image.shape[:2])
    small = cv2.resize(image, (cols, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=image.dtype).reshape(rows, cols, -1)


def _stretched(image: Raster) -> NDArray[np.uint8]:
    """Return the image in 8 bit, with the same stretch for all bands; no-data stays black.

    Numbers of 16 bit are proportional to light, those of a screen are not.
    """
    values = image[image > 0]
    low, high = np.percentile(values, [0.5, 99.5]) if len(values) else (0.0, 1.0)
    scaled = np.clip((image - np.float32(low)) / np.float32(max(high - low, 1.0)), 0, 1)
    shown = scaled ** np.float32(1 / GAMMA if image.dtype == np.uint16 else 1)
    return np.where(image > 0, np.rint(255 * shown), 0).astype(np.uint8)


def _to_disk(path: Path) -> None:
    """Wait until a file is on the disk and not only in memory."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _sizes(form: Format) -> list[tuple[int, int]]:
    return level_sizes(form.height, form.width, TILE)


def _overviews(folder: Path, form: Format) -> _Pyramid:
    return _Pyramid(folder, _sizes(form), bands=form.bands, dtype=np.dtype(form.dtype))


def _checked(stripes: Iterable[Raster], form: Format) -> Iterator[Raster]:
    """Yield the stripes; raise where they do not match the format."""
    rows = 0
    for stripe in stripes:
        rows += len(stripe)
        fits = stripe.shape[1:] == (form.width, form.bands) and stripe.dtype == form.dtype
        if not fits or rows > form.height:
            msg = f"a stripe {stripe.shape} of {stripe.dtype} that ends at row {rows}, not {form}"
            raise ValueError(msg)
        yield stripe
    if rows < form.height:
        raise ValueError(f"{rows} rows of an image of {form.height}")


def _passed_on(stripes: Iterable[Raster], pyramid: _Pyramid) -> Iterator[Raster]:
    for stripe in stripes:
        pyramid.add(stripe)
        yield stripe


def _tiles(stripes: Iterable[Raster], width: int) -> Iterator[Raster]:
    """Yield tiles row by row; those at the border are smaller, and the writer fills them up."""
    for rows in _regrouped(stripes):
        for col in range(0, width, TILE):
            tile = rows[:, col : col + TILE].copy()
            yield tile[..., 0] if tile.shape[2] == 1 else tile


def _regrouped(
    stripes: Iterable[Raster],
) -> Iterator[Raster]:
    """Yield stripes of the height of a tile; the last one may be lower."""
    kept: list[Raster] = []
    for stripe in stripes:
        kept.append(stripe)
        while (n := sum(map(len, kept))) >= TILE:
            rows = kept[0] if len(kept) == 1 else np.concatenate(kept)
            yield rows[:TILE]
            kept = [rows[TILE:]] if n > TILE else []
    if kept:
        yield np.concatenate(kept)


def _write_level(
    tiff: tifffile.TiffWriter,
    tiles: Iterator[Raster],
    form: Format,
    size: tuple[int, int],
    description: str | None,
    threads: int,
) -> None:
    """Write the image or one of its overviews."""
    colour = form.bands >= 3 and not form.stack
    extra = form.bands - (3 if colour else 1)
    scale = max(form.height, form.width) / max(size)
    per_cm = 10 / form.pixel_mm / scale
    tiff.write(
        tiles,
        shape=(*size, form.bands) if form.bands > 1 else size,
        dtype=form.dtype,
        tile=(TILE, TILE),
        photometric="rgb" if colour else "minisblack",
        planarconfig="contig" if form.bands > 1 else None,
        extrasamples=[_UNSPECIFIED] * extra or None,
        compression=_CODEC.get(form.compression),
        compressionargs={"level": _LEVEL[form.compression]} if form.compression in _LEVEL else None,
        predictor=form.compression in _CODEC,
        maxworkers=threads,
        buffersize=_AT_A_TIME,
        subfiletype=0 if description is not None else 1,
        description=description,
        metadata=None,
        software="acx4lib" if description is not None else False,
        resolution=(per_cm, per_cm),
        resolutionunit="CENTIMETER",
        extratags=[_GDAL_NODATA],
    )


# --- Overviews of an image that comes in stripes: each has half the size of the one before


def level_sizes(height: int, width: int, smallest: int) -> list[tuple[int, int]]:
    """Return rows and columns of an image and its overviews; the last fits into `smallest`."""
    sizes = [(height, width)]
    while max(sizes[-1]) > smallest:
        rows, cols = sizes[-1]
        sizes.append((-(-rows // 2), -(-cols // 2)))
    return sizes


def halved(image: Raster) -> Raster:
    """Return means of 2 x 2 pixels, rounded half up, without no-data pixels (zero).

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        A last odd row or column counts twice.

    Returns
    -------
    ndarray, shape (ceil(rows / 2), ceil(cols / 2), bands)
    """
    rows, cols, bands = image.shape
    if rows % 2 or cols % 2:
        image = np.pad(image, ((0, rows % 2), (0, cols % 2), (0, 0)), mode="edge")
    half = image.shape[1] // 2, image.shape[0] // 2
    # with two bands at once, OpenCV rounds half to even, and with more than four, too
    parts = [image] if bands in (1, 3, 4) else np.split(image, bands, axis=2)
    means = [cv2.resize(part, half, interpolation=cv2.INTER_AREA) for part in parts]
    means = [mean.reshape(half[1], half[0], -1) for mean in means]
    joined = means[0] if len(means) == 1 else np.concatenate(means, axis=2)
    small: Raster = joined.astype(image.dtype, copy=False)
    if image.min() == 0:
        _mend(small, image)
    return small


def _mend(small: Raster, image: Raster) -> None:
    """Replace, in place, means of 2 x 2 pixels with some zeros by the means of the others."""
    four = [image[i::2, j::2] for i in (0, 1) for j in (0, 1)]
    empty = four[0] == 0
    for part in four[1:]:
        empty |= part == 0
    values = np.stack([part[empty] for part in four]).astype(np.uint32)
    count = np.maximum(np.count_nonzero(values, axis=0), 1)
    small[empty] = ((values.sum(axis=0) + count // 2) // count).astype(image.dtype)


class _Pyramid:
    """The overviews of one image, kept in a file without a name until they are used.

    Parameters
    ----------
    folder : Path
        Folder with room for a third of the image.
    sizes : list of tuple of int
        From `level_sizes`.
    bands : int
    dtype : dtype
    """

    def __init__(
        self, folder: Path, sizes: list[tuple[int, int]], *, bands: int, dtype: np.dtype
    ) -> None:
        self._sizes, self._bands, self._dtype = sizes, bands, dtype
        self._rest: list[Raster | None] = [None for _ in sizes]
        self._done = [0 for _ in sizes]
        per_level = [rows * self._row_bytes(level) for level, (rows, _) in enumerate(sizes)]
        self._start = [sum(per_level[1:level]) for level in range(len(sizes))]
        self._file: IO[bytes] = TemporaryFile(dir=folder)  # noqa: SIM115 closed with this

    def __enter__(self) -> Self:
        """Return the pyramid; its file is removed when it closes or the process ends."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Close the file, and so remove it."""
        self._file.close()

    def _row_bytes(self, level: int) -> int:
        return self._sizes[level][1] * self._bands * self._dtype.itemsize

    def add(self, stripe: Raster) -> None:
        """Add the next rows of the image, any number of them."""
        self._add(stripe, 0)

    def _add(self, stripe: Raster, level: int) -> None:
        """Add rows to a level, and their halved rows to the next level."""
        if level:
            offset = self._start[level] + self._done[level] * self._row_bytes(level)
            self._file.seek(offset)
            self._file.write(np.ascontiguousarray(stripe).data)
        self._done[level] += len(stripe)
        if level + 1 == len(self._sizes):
            return
        leftover = self._rest[level]
        rows = stripe if leftover is None else np.concatenate([leftover, stripe])
        ended = self._done[level] == self._sizes[level][0]
        paired = len(rows) if ended else len(rows) - len(rows) % 2
        self._rest[level] = rows[paired:].copy() if paired < len(rows) else None
        if paired:
            self._add(halved(rows[:paired]), level + 1)

    def stripes(self, level: int, height: int) -> Iterator[Raster]:
        """Yield an overview, `height` rows at a time; the last stripe may have fewer.

        Parameters
        ----------
        level : int
            Number of the overview; 1 is the largest.
        height : int
        """
        rows, cols = self._sizes[level]
        for row in range(0, rows, height):
            n = min(height, rows - row)
            self._file.seek(self._start[level] + row * self._row_bytes(level))
            content = self._file.read(n * self._row_bytes(level))
            yield np.frombuffer(content, dtype=self._dtype).reshape(n, cols, self._bands)
