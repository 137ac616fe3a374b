"""Read an aerial image from a TIFF: check its header, map its pixels where possible."""

from __future__ import annotations

import hashlib
import logging
import mmap
import re
import struct
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import SEEK_END
from pathlib import Path

import numpy as np
import tifffile

from acx4files.flight.table_files import free_memory
from acx4files.images import tiff as tiff_files
from acx4lib.errors import FlightError
from acx4lib.expected import Raster
from acx4lib.geometry.camera import Camera

BANDS = 4
"""Largest number of bands of an image."""

PAGES = 100
"""Number of pages of a file that are examined; overviews and masks are about a dozen."""

_BROKEN = (
    *(ValueError, TypeError, LookupError, ArithmeticError, RuntimeError, struct.error),
    MemoryError,  # from absurd sizes
)
"""Errors of the TIFF reader where the bytes of a file contradict its header."""

_OTHERS = {
    b"\xff\xd8\xff": "a JPEG image",
    b"\x89PNG": "a PNG image",
    b"\x00\x00\x00\x0cjP  ": "a JPEG 2000 image",
    b"\xff\x4f\xff\x51": "a JPEG 2000 image",
    b"BM": "a BMP image",
}
_COLOURS = {
    **dict.fromkeys((1, 2), ""),
    0: "white as zero",
    3: "a colour palette",
    4: "a mask",
    5: "CMYK",
    8: "CIE L*a*b*",
    32803: "a Bayer pattern",
}
_YCBCR = 6
_JPEG = {6, 7}
_BOUNDED = {1, 5, 8, 32773, 32946, 34925, 50000}
"""Ways to pack bytes: none, LZW, deflate, packbits, LZMA, zstd; what is too long is refused."""
_HEADER_OF_PART = 2**17
_ALPHA = {1, 2}
_ORIENTATION = 274
_REDUCED_OR_MASK = 1 | 4

_SAMPLED, _AT_A_TIME = 256, 4096


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageFile:
    """The pixels of one image file.

    Attributes
    ----------
    image : ndarray, shape (rows, cols, bands)
        8 or 16 bit, read-only.
    reduction : int
        K, if the image has 1/K of the camera's size.
    """

    image: Raster
    reduction: int


@dataclass(frozen=True, kw_only=True)
class _Header:
    """Properties of a file's image, from its header."""

    width: int
    height: int
    bands: int
    depth: int
    dtype: str
    photometric: int
    compression: int
    turned: int
    alpha: bool
    n_images: int
    offsets: tuple[int, ...]
    counts: tuple[int, ...]
    n_parts: int
    part_px: int
    as_in_memory: bool

    @property
    def pixel_bytes(self) -> int:
        """Bytes of a pixel of all bands."""
        return self.bands * np.dtype(self.dtype).itemsize


def image_from_file(path: Path, camera: Camera) -> ImageFile:
    """Read the image of a camera from a TIFF.

    Parameters
    ----------
    path : Path
        A TIFF or BigTIFF with one image of one to four bands of 8 or 16 bit, stored in any way.
        An uncompressed image in this computer's byte order is mapped.
    camera : Camera
        The image must have its size, or 1/K of it.

    Raises
    ------
    FlightError
        With a sentence that names the file.
    """
    with _readable(path):
        size = path.stat().st_size
        with path.open("rb") as file:
            fault = tiff_files.fault(file, size, pages=PAGES)
        if fault:
            raise FlightError([f"{path}: {fault}"])
        with tiff_files.opened(path) as tiff:
            header = _header(tiff)
    k = _reduction(header, camera)
    problem = _kind_problem(header) or _size_problem(header, camera, k)
    problem = problem or _extent_problem(header, size) or _memory_problem(header, size)
    problem = problem or _part_problem(path, header)
    if problem:
        raise FlightError([f"{path}: {problem}"])
    image = (_mapped if header.as_in_memory else _decoded)(path, header)
    image.flags.writeable = False
    return ImageFile(image=image, reduction=k)


def fingerprint(path: Path) -> str:
    """Return a checksum of a file's size and of one megabyte, spread evenly over the file.

    It quickly distinguishes images, but it may miss a change of a few pixels.
    """
    size = path.stat().st_size
    checksum = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for offset in np.linspace(0, max(size - _AT_A_TIME, 0), _SAMPLED, dtype=np.int64):
            file.seek(int(offset))
            checksum.update(file.read(_AT_A_TIME))
    return checksum.hexdigest()


class _Messages(logging.Handler):
    """A log handler that keeps messages."""

    def __init__(self) -> None:
        super().__init__()
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.messages.append(record.getMessage())


@contextmanager
def _captured_log() -> Iterator[list[str]]:
    """Keep the TIFF reader's messages; they are reported with the file's name, or not at all."""
    handler = _Messages()
    logger = logging.getLogger("tifffile")
    before = logger.propagate
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield handler.messages
    finally:
        logger.removeHandler(handler)
        logger.propagate = before


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Replace errors and messages of the TIFF reader by one sentence."""
    with _captured_log() as log, np.errstate(divide="raise", invalid="raise"):
        try:
            if path.exists() and not (
                path.is_file() or path.is_dir()
            ):  # reading a pipe would wait for its other end
                raise OSError(0, "no regular file")
            yield
        except OSError as error:
            raise FlightError([f"{path}: cannot be read ({error.strerror or error})"]) from None
        except tifffile.TiffFileError:
            raise FlightError([f"{path}: {_not_tiff(path)}"]) from None
        except _BROKEN as error:
            reason = _reason(error, log)
            problem = f"{path}: is damaged, its pixels cannot be decoded ({reason}); copy it again"
            raise FlightError([problem]) from None


def _reason(error: Exception, log: Sequence[str]) -> str:
    """Return the TIFF reader's reason for an error, at most 200 characters."""
    words = [re.sub(r"<[^<>]*+>", "", line) for line in log]
    if isinstance(error, (RuntimeError, ValueError)):
        words.append(str(error))
    return " ".join((words or ["its header is not consistent"])[0].split())[:200]


def _not_tiff(path: Path) -> str:
    with path.open("rb") as file:
        start = file.read(12)
    if not start:
        return "is empty; a head image is a TIFF"
    known = (kind for magic, kind in _OTHERS.items() if start.startswith(magic))
    kind = next(known, "no TIFF, or its header is damaged")
    return f"is {kind}; head images are read from TIFF (16 or 8 bit)"


def _header(tiff: tifffile.TiffFile) -> _Header:
    """Return the properties of a file's first image; overviews and masks are not counted."""
    page = tiff.pages.first
    others = [p for p in _further_pages(tiff) if isinstance(p, tifffile.TiffPage)]
    n_alike = sum(
        p.shape[:2] == page.shape[:2] and not p.subfiletype & _REDUCED_OR_MASK for p in others
    )
    native = page.dtype == np.uint8 or (tiff.byteorder == "<") == (sys.byteorder == "little")
    interleaved = page.samplesperpixel == 1 or page.planarconfig == 1
    plain = page.fillorder == 1 and page.predictor == 1
    tiled, in_strips = (page.tilelength, page.tilewidth), (page.rowsperstrip, page.imagewidth)
    part = tiled if page.is_tiled else in_strips
    return _Header(
        width=int(page.imagewidth),  # a damaged tag may have several values
        height=int(page.imagelength),
        bands=int(page.samplesperpixel),
        depth=int(page.imagedepth),
        dtype=page.dtype.name if page.dtype is not None else f"{page.bitspersample} bit",
        photometric=int(page.photometric),
        compression=int(page.compression),
        turned=int(page.tags.valueof(_ORIENTATION, default=1)),
        alpha=not _ALPHA.isdisjoint(page.extrasamples),
        n_images=1 + n_alike,
        offsets=tuple(map(int, page.dataoffsets)),
        counts=tuple(map(int, page.databytecounts)),
        n_parts=int(np.prod(page.chunked)),
        part_px=int(part[0]) * int(part[1]),
        as_in_memory=bool(
            native and interleaved and plain and page.is_contiguous and page.is_memmappable
        ),
    )


def _further_pages(tiff: tifffile.TiffFile) -> Iterator[object]:
    """Yield the first `PAGES` pages after the first: a small file may have a million of them."""
    for k in range(1, PAGES):
        try:
            yield tiff.pages[k]
        except IndexError:
            return


def _kind_problem(header: _Header) -> str | None:
    """Return the problem of pixels of a kind that is not read; None otherwise."""
    as_rgb = header.photometric == _YCBCR and header.compression in _JPEG  # converted in decoding
    colours = "" if as_rgb else _COLOURS.get(header.photometric, "an unusual colour space")
    turned = f"is to be shown turned (orientation {header.turned}); store the pixels as shown"
    alpha = (
        "has a band of transparency (alpha); write it without, and near infrared as an extra "
        "band of unspecified meaning"
    )
    kind = f"has pixels of type {header.dtype}; unsigned whole numbers of 8 or 16 bit are read"
    problems = {
        kind: header.dtype not in ("uint8", "uint16"),
        alpha: header.alpha,
        f"has {header.bands} bands; one to {BANDS} are read": not 1 <= header.bands <= BANDS,
        f"is stored as {colours}; grey values or RGB are read, black as zero": bool(colours),
        turned: header.turned != 1,
        f"holds {header.n_images} images; all bands must be in one": header.n_images > 1,
        "has a third dimension; one image is read": header.depth != 1,
    }
    return next((problem for problem, wrong in problems.items() if wrong), None)


def _reduction(header: _Header, camera: Camera) -> int:
    """Return K of an image at 1/K of its camera's size; 1 for a larger image."""
    return max(camera.width_px // max(header.width, 1), 1)


def _size_problem(header: _Header, camera: Camera, k: int) -> str | None:
    if (header.width, header.height) == (camera.width_px // k, camera.height_px // k):
        return None
    return (
        f"has {header.width} x {header.height} px; {camera.name} has {camera.width_px} x "
        f"{camera.height_px}, and its images that or 1/K of it, K a whole number"
    )


def _extent_problem(header: _Header, size: int) -> str | None:
    """Return a problem if the file is too short for its pixels, or some were never written."""
    offsets, counts = np.array(header.offsets), np.array(header.counts)
    needed = header.width * header.height * header.bands * np.dtype(header.dtype).itemsize
    too_few = len(offsets) != len(counts) or len(offsets) < max(header.n_parts, 1)
    if too_few or not counts.all() or (header.compression == 1 and counts.sum() < needed):
        return "has parts without pixels; was the writing interrupted?"
    end = int((offsets + counts).max())
    if end > size:
        return f"ends after {size} bytes of at least {end}; was the copying interrupted?"
    return None


def _memory_problem(header: _Header, size: int) -> str | None:
    """Return the problem of pixels too many for the file or the memory; None otherwise."""
    if header.as_in_memory:
        return None
    whole, part = (n * header.pixel_bytes for n in (header.width * header.height, header.part_px))
    # A part is in memory as unpacked, as put together, and in the picture.
    return fault(max(whole, part), size, 2 * whole + 2 * part) or None


def _part_problem(path: Path, header: _Header) -> str | None:
    """Return a problem of parts packed in an unknown way, or of JPEG parts too large."""
    if header.compression in _BOUNDED:
        return None
    if header.compression not in _JPEG:
        return f"is packed in the way {header.compression}; give it as deflate, LZW, zstd or JPEG"
    with path.open("rb") as file:
        for offset, count in zip(header.offsets, header.counts, strict=False):
            file.seek(offset)
            size = size_of(file.read(min(count, _HEADER_OF_PART)))
            if size is None or size[0] * size[1] > header.part_px:
                return "has parts of JPEG that are larger than the picture says, or say no size"
    return None


def _mapped(path: Path, header: _Header) -> Raster:
    """Map an image that is stored in its file as in memory."""
    with path.open("rb") as file:
        mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    shape = (header.height, header.width, header.bands)
    count, offset = int(np.prod(shape)), header.offsets[0]
    return np.frombuffer(mapped, header.dtype, count, offset).reshape(shape)


def _decoded(path: Path, header: _Header) -> Raster:
    """Return the decoded image, with the bands of a pixel together."""
    with _readable(path), tiff_files.opened(path) as tiff:
        image = tiff.pages.first.asarray(squeeze=False)
    planes = np.moveaxis(image[:, 0], 0, 2)  # rows, columns, planes, bands of a plane
    pixels = planes.reshape(header.height, header.width, header.bands)
    return np.ascontiguousarray(pixels, dtype=header.dtype)


# --- The size of a JPEG or PNG by its header, before any pixel is unpacked


LARGEST_RATIO = 200
"""Largest ratio of a picture's bytes to its file's; pictures of the ground have 2 to 50."""

SMALL = 100_000_000
"""Bytes of a picture that is unpacked at any ratio: it may be empty."""

SCAN, END = 0xDA, 0xD9
FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG's frame headers."""

LARGE = 65_536
"""Bytes at the end of a large JPEG; previews with an end of their own stand at its beginning."""

LAST = 4096
"""Bytes at the end of a PNG among which its last chunk begins."""

_PICTURE_SIZES_JPEG, _PNG = b"\xff\xd8", b"\x89PNG\r\n\x1a\n"


def segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield markers and contents of a JPEG's segments up to its pixels."""
    offset = 2
    while offset + 4 <= len(data) and data[offset] == 0xFF:
        marker = data[offset + 1]
        if marker in (SCAN, END):
            return
        (length,) = struct.unpack(">H", data[offset + 2 : offset + 4])
        yield marker, data[offset + 4 : offset + 2 + length]
        offset += 2 + length


def is_whole(data: bytes) -> bool:
    """Tell whether a JPEG or a PNG has its end; a cut file would be decoded with grey pixels."""
    if data[:8] == _PNG:
        return b"IEND" in data[-LAST:]
    start = 2 + sum(4 + len(part) for _, part in segments(data))
    return data.find(b"\xff\xd9", start) >= 0  # which no pixels have: 0 follows their 255


def is_cut_off(path: Path) -> bool:
    """Tell whether a file is a JPEG, a PNG or a TIFF without its end.

    A large JPEG with an end marker in its last bytes is not read in full.
    """
    kind = path.suffix.lower()
    if kind not in (".jpg", ".jpeg", ".png", ".tif", ".tiff"):
        return False
    with path.open("rb") as file:
        size = file.seek(0, SEEK_END)
        if kind in (".tif", ".tiff"):
            file.seek(0)
            return tiff_files.is_cut_off(file, size)
        file.seek(max(size - LARGE, 0))
        if size > 2 * LARGE and b"\xff\xd9" in file.read():
            return False
        file.seek(0)
        return not is_whole(file.read())


def size_of(data: bytes) -> tuple[int, int] | None:
    """Return width and height of a JPEG or a PNG, px; None if its header lacks them."""
    if data[:8] == _PNG and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    if data[:2] == _PICTURE_SIZES_JPEG:
        for marker, part in segments(data):
            if marker in FRAMES and len(part) >= 6:
                height, width = struct.unpack(">HH", part[1:5])
                return width, height
    return None


def fault(n_bytes: int, size: int, needed: int | None = None) -> str:
    """Return the reason not to unpack a picture; empty without any.

    Parameters
    ----------
    n_bytes : int
        Bytes of its pixels.
    size : int
        Bytes of its file.
    needed : int, optional
        Bytes of memory for unpacking; by default those of its pixels.
    """
    if n_bytes > SMALL and n_bytes > LARGEST_RATIO * size:
        return f"has {n_bytes} bytes of pixels in {size}; {LARGEST_RATIO} times as many at most"
    needed, free = n_bytes if needed is None else needed, free_memory()
    if needed > free:
        return f"needs {needed} bytes of memory to be unpacked; {free} are free"
    return ""
