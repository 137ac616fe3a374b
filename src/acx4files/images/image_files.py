"""Read an aerial image from a TIFF: check its header, map its pixels where possible."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from os import SEEK_END
from pathlib import Path

import numpy as np
import tifffile

from acx4files.images import tiff as tiff_files
from acx4lib.errors import FlightError
from acx4lib.expected import Raster
from acx4lib.geometry.camera import Camera

BANDS = 4
"""Largest number of bands of an image."""

_BROKEN = (
    *(ValueError, TypeError, LookupError, ArithmeticError, RuntimeError, AttributeError),
    *(struct.error, MemoryError),
)
"""Errors of the TIFF reader where the bytes of a file contradict its header."""

_OTHERS = {b"\xff\xd8\xff": "a JPEG image", b"\x89PNG": "a PNG image"}
_COLOURS = {
    0: "white as zero",
    3: "a colour palette",
    4: "a mask",
    5: "CMYK",
    32803: "a Bayer pattern",
}
_GREY, _RGB, _YCBCR = 1, 2, 6
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
    try:
        with tiff_files.in_silence(), tifffile.TiffFile(path) as tiff:
            page = tiff.pages.first
            k = max(camera.width_px // max(page.imagewidth, 1), 1)
            if problem := next(_problems(tiff, camera, k, path.stat().st_size), None):
                raise FlightError([f"{path}: {problem}"])
            image = _pixels(path, page)
    except OSError as error:
        raise FlightError([f"{path}: cannot be read ({error.strerror or error})"]) from None
    except (tifffile.TiffFileError, *_BROKEN) as error:
        raise FlightError([f"{path}: {_reason(path, error)}"]) from None
    image.flags.writeable = False
    return ImageFile(image=image, reduction=k)


def _problems(tiff: tifffile.TiffFile, camera: Camera, k: int, size: int) -> Iterator[str]:
    """Yield the problems of an image that is not read: its kind, its size, or parts that miss."""
    page = tiff.pages.first
    yield from _problems_of_kind(page)
    others = [p for p in list(tiff.pages)[1:] if isinstance(p, tifffile.TiffPage)]
    others = [p for p in others if not p.subfiletype & _REDUCED_OR_MASK]
    n_images = page.imagedepth + sum(p.shape[:2] == page.shape[:2] for p in others)
    if n_images > 1:
        yield f"holds {n_images} images; all bands must be in one"
    if (page.imagewidth, page.imagelength) != (camera.width_px // k, camera.height_px // k):
        yield (
            f"has {page.imagewidth} x {page.imagelength} px; {camera.name} has {camera.width_px} x "
            f"{camera.height_px}, and its images that or 1/K of it, K a whole number"
        )
    if len(page.dataoffsets) < np.prod(page.chunked) or not all(page.databytecounts):
        yield "has parts without pixels; was the writing interrupted?"  # they would be read as 0
    if (end := tiff_files.end_of_pixels(tiff)) > size:
        yield f"ends after {size} bytes of at least {end}; was the copying interrupted?"


def _problems_of_kind(page: tifffile.TiffPage) -> Iterator[str]:
    if page.dtype not in (np.uint8, np.uint16):
        kind = page.dtype.name if page.dtype is not None else f"{page.bitspersample} bit"
        yield f"has pixels of type {kind}; unsigned whole numbers of 8 or 16 bit are read"
    if not _ALPHA.isdisjoint(page.extrasamples):
        yield (
            "has a band of transparency (alpha); write it without, and near infrared as an extra "
            "band of unspecified meaning"
        )
    if not 1 <= page.samplesperpixel <= BANDS:
        yield f"has {page.samplesperpixel} bands; one to {BANDS} are read"
    decoded_to_rgb = page.photometric == _YCBCR and page.compression == tifffile.COMPRESSION.JPEG
    if page.photometric not in (_GREY, _RGB) and not decoded_to_rgb:
        colours = _COLOURS.get(page.photometric, "an unusual colour space")
        yield f"is stored as {colours}; grey values or RGB are read, black as zero"
    turned = page.tags.valueof(_ORIENTATION, default=1)
    if turned != 1:
        yield f"is to be shown turned (orientation {turned}); store the pixels as shown"


def _pixels(path: Path, page: tifffile.TiffPage) -> Raster:
    """Return the pixels of an image, mapped where they are stored as in memory."""
    shape = page.imagelength, page.imagewidth, page.samplesperpixel
    dtype = np.dtype(page.dtype)
    native = dtype.newbyteorder(page.parent.byteorder).isnative
    interleaved = page.samplesperpixel == 1 or page.planarconfig == 1
    if native and interleaved and page.is_contiguous and page.is_memmappable:
        return np.memmap(path, dtype, "r", page.dataoffsets[0], shape)
    image = page.asarray(squeeze=False)
    planes = np.moveaxis(image[:, 0], 0, 2)  # rows, columns, planes, bands of a plane
    return np.ascontiguousarray(planes.reshape(shape), dtype=dtype)


def _reason(path: Path, error: Exception) -> str:
    """Return why a file is not read, from its beginning and an error of the TIFF reader."""
    with path.open("rb") as file:
        start = file.read(12)
    if not start:
        return "is empty; a head image is a TIFF"
    known = next((kind for magic, kind in _OTHERS.items() if start.startswith(magic)), None)
    if known or isinstance(error, tifffile.TiffFileError):
        kind = known or "no TIFF, or its header is damaged"
        return f"is {kind}; head images are read from TIFF (16 or 8 bit)"
    says = isinstance(error, (RuntimeError, ValueError)) and " ".join(str(error).split())[:200]
    reason = says or "its header is not consistent, or cut off"
    return f"is damaged, its pixels cannot be decoded ({reason}); copy it again"


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


# --- Segments of a JPEG, and pictures without their end


SCAN, END = 0xDA, 0xD9
FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG's frame headers."""

LARGE = 65_536
"""Bytes at the end of a large JPEG; previews with an end of their own stand at its beginning."""

_PNG = b"\x89PNG\r\n\x1a\n"


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
        return b"IEND" in data[-4096:]
    start = 2 + sum(4 + len(part) for _, part in segments(data))
    return data.find(b"\xff\xd9", start) >= 0  # which no pixels have: 0 follows their 255


def is_cut_off(path: Path) -> bool:
    """Tell whether a file is a JPEG, a PNG or a TIFF without its end.

    A large JPEG with an end marker in its last bytes is not read in full.
    """
    kind = path.suffix.lower()
    if kind in (".tif", ".tiff"):
        return _is_cut_tiff(path)
    if kind not in (".jpg", ".jpeg", ".png"):
        return False
    with path.open("rb") as file:
        size = file.seek(0, SEEK_END)
        file.seek(max(size - LARGE, 0))
        if size > 2 * LARGE and b"\xff\xd9" in file.read():
            return False
        file.seek(0)
        return not is_whole(file.read())


def _is_cut_tiff(path: Path) -> bool:
    """Tell whether a TIFF ends before its tags or its pixels do."""
    with path.open("rb") as file:
        if file.read(2) not in (b"II", b"MM"):  # none, which is reported where the file is read
            return False
    try:
        with tiff_files.in_silence(), tifffile.TiffFile(path) as tiff:
            return tiff_files.end_of_pixels(tiff) > path.stat().st_size
    except (tifffile.TiffFileError, *_BROKEN):
        return True
