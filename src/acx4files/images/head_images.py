"""The images of a flight's heads: complete exposures, and their files, read and checked.

An image that is stored in its file as in memory is mapped, not read. Then pixels that are not
used take no time, and the memory of used ones can be given back.
"""

from __future__ import annotations

import hashlib
import logging
import mmap
import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import SEEK_END
from pathlib import Path

import numpy as np
import tifffile

from acx4files.flight.reader import Flight
from acx4lib.errors import FlightError
from acx4lib.expected import Raster
from acx4lib.geometry.camera import Camera

BANDS = 4
"""Largest number of bands of an image."""

MAKE_FILES = (
    "give heads/images.csv a column 'file' with the TIFF of every head's image, relative to heads/"
)


# --- which files -----------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class HeadFiles:
    """The files of all heads at one exposure.

    Attributes
    ----------
    exposure : str
        Its name; ``block/name`` where two blocks of a flight have such an exposure.
    paths : tuple of Path
        In the order of the heads; paths for the user.
    """

    exposure: str
    paths: tuple[Path, ...]


def head_files(
    flight: Flight, heads: Sequence[str], blocks: Sequence[str] = ("heads",)
) -> tuple[dict[str, HeadFiles], dict[str, str]]:
    """Return the exposures of some blocks whose image files exist.

    Parameters
    ----------
    flight : Flight
    heads : sequence of str
        Names of the cameras.
    blocks : sequence of str
        Blocks that are measured in heads.

    Returns
    -------
    complete : dict of str to HeadFiles
        Files by exposure, in the order of the flight.
    incomplete : dict of str to str
        What is missing, for exposures where only some heads have a file.

    Raises
    ------
    FlightError
        Where no image of a head has a file.
    """
    inside = flight.pictures.resolve()
    by_exposure: dict[tuple[str, str], dict[str, Path]] = {}
    for block in blocks:
        for i, path in enumerate(flight.image_files.get(block, ())):
            taken = flight.blocks[block]
            camera = taken.cameras[taken.images.camera_idx[i]].name
            if path is not None and camera in heads:
                exposure = taken.trajectory.exposures[taken.images.exposure_idx[i]]
                named = flight.pictures / path.relative_to(inside)
                by_exposure.setdefault((block, exposure), {})[camera] = named
    if not by_exposure:
        table = flight.path / "heads" / "images.csv"
        raise FlightError([f"{table}: names no files of head images; {MAKE_FILES}"])
    times = Counter(exposure for _, exposure in by_exposure)
    complete, incomplete = {}, {}
    for (block, exposure), files in by_exposure.items():
        label = exposure if times[exposure] == 1 else f"{block}/{exposure}"
        missing = [name for name in heads if name not in files]
        if missing:
            incomplete[label] = (
                f"{flight.path / block / 'images.csv'}: exposure {exposure}: no file for "
                f"{', '.join(missing)}; an exposure is rendered from all of {', '.join(heads)}"
            )
        else:
            paths = tuple(files[name] for name in heads)
            complete[label] = HeadFiles(exposure=label, paths=paths)
    return complete, incomplete


# --- the pixels of an exposure ---------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class HeadImages:
    """The pixels of all heads at one exposure.

    Attributes
    ----------
    images : tuple of ndarray, shape (rows, cols, bands)
        8 or 16 bit, read-only; all have the same type and number of bands.
    reduction : int
        K, if the images have 1/K of the cameras' size.
    """

    images: tuple[Raster, ...]
    reduction: int

    def forget(self) -> None:
        """Release the memory of mapped pixels; they are read again when needed."""
        for image in self.images:
            if isinstance(image.base, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
                image.base.madvise(mmap.MADV_DONTNEED)


def read_heads(paths: Sequence[Path], cameras: Sequence[Camera]) -> HeadImages:
    """Read the images of all heads at one exposure.

    Parameters
    ----------
    paths : sequence of Path
    cameras : sequence of Camera
        At full size, one for each path.

    Raises
    ------
    FlightError
        With a sentence for every file that cannot be read, or that differs from the others.
    """
    problems: list[str] = []
    files: list[ImageFile] = []
    for path, camera in zip(paths, cameras, strict=True):
        try:
            files.append(image_from_file(path, camera))
        except FlightError as error:
            problems += error.problems
    kinds = [
        f"{8 * file.image.dtype.itemsize} bit, {file.image.shape[2]} bands, 1/{file.reduction} of "
        "the size"
        for file in files
    ]
    if not problems:
        usual = Counter(kinds).most_common(1)[0][0]
        problems = [
            f"{path}: has {kind}, the other heads have {usual}; all must be alike"
            for path, kind in zip(paths, kinds, strict=True)
            if kind != usual
        ]
    if problems:
        raise FlightError(problems)
    return HeadImages(images=tuple(file.image for file in files), reduction=files[0].reduction)


# --- one file --------------------------------------------------------------------------------


_BROKEN = (
    *(ValueError, TypeError, LookupError, ArithmeticError, RuntimeError, AttributeError),
    *(struct.error, MemoryError, tifffile.TiffFileError),
)
"""Errors of the TIFF reader where the bytes of a file contradict its header."""

_GREY, _RGB, _YCBCR = 1, 2, 6
_ALPHA = {1, 2}
_ORIENTATION = 274
_REDUCED_OR_MASK = 1 | 4


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
        with in_silence(), tifffile.TiffFile(path) as tiff:
            page = tiff.pages.first
            k = max(camera.width_px // max(page.imagewidth, 1), 1)
            if problem := next(_problems(tiff, camera, k, path.stat().st_size), None):
                raise FlightError([f"{path}: {problem}"])
            image = _pixels(path, page)
    except OSError as error:
        raise FlightError([f"{path}: cannot be read ({error.strerror or error})"]) from None
    except _BROKEN as error:
        reason = " ".join(str(error).split())[:200]
        says = f"is no TIFF, or a damaged one ({reason}); head images are TIFF of 8 or 16 bit"
        raise FlightError([f"{path}: {says}"]) from None
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
    if (end := end_of_pixels(tiff)) > size:
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
        colours = tifffile.PHOTOMETRIC(page.photometric).name
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
    return max(map(sum, zip(page.dataoffsets, page.databytecounts, strict=False)), default=0)


def fingerprint(path: Path) -> str:
    """Return a checksum of a file's size and of one megabyte, spread evenly over the file.

    It quickly distinguishes images, but it may miss a change of a few pixels.
    """
    size = path.stat().st_size
    checksum = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for offset in np.linspace(0, max(size - 4096, 0), 256, dtype=np.int64):
            file.seek(int(offset))
            checksum.update(file.read(4096))
    return checksum.hexdigest()


# --- segments of a JPEG, and pictures without their end --------------------------------------


SCAN, END = 0xDA, 0xD9
LARGE = 65_536
"""Bytes at the end of a large JPEG; previews with an end of their own stand at its beginning."""


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
    if data.startswith(b"\x89PNG"):
        return b"IEND" in data[-4096:]
    start = 2 + sum(4 + len(part) for _, part in segments(data))
    return data.find(b"\xff\xd9", start) >= 0  # which no pixels have: 0 follows their 255


def is_cut_off(path: Path) -> bool:
    """Tell whether a file is a JPEG, a PNG or a TIFF without its end."""
    with path.open("rb") as file:
        start, size = file.read(4), file.seek(0, SEEK_END)
        if start.startswith((b"\xff\xd8", b"\x89PNG")):
            file.seek(max(size - LARGE, 0))
            if size > 2 * LARGE and b"\xff\xd9" in file.read():
                return False
            file.seek(0)
            return not is_whole(file.read())
    if not start.startswith((b"II", b"MM")):
        return False
    try:
        with in_silence(), tifffile.TiffFile(path) as tiff:
            return end_of_pixels(tiff) > path.stat().st_size
    except _BROKEN:
        return True
