"""A real photograph on the ground."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from acx4sim.scenery.noise import GroundWindow, white

Picture = NDArray[np.uint16]

_HALVED_LEVEL = 2  # 25 cm: a pixel of the photo is 12.5 cm, of the halved photo 25 cm
_BRIGHTEST = 56_000.0  # DN of 255
_COUNT = 256  # numbers of the halved photos for one of the photo
_DITHER = 0.29  # standard deviation of the rounding of the photo to 8 bit
_SALT = 3
_MOST_PIXELS = 1 << 30  # OpenCV does not read more


@dataclass(frozen=True, kw_only=True, eq=False)
class Photo:
    """A photograph that covers the plane, mirrored at its edges.

    Attributes
    ----------
    name : str
        Name of its file.
    halves : tuple of ndarray of uint16, shape (rows, cols, 3)
        The photo, north first, halved once, twice, ...; 256 for one number of the 8 bit.
    """

    name: str
    halves: tuple[Picture, ...]

    def paint(self, window: GroundWindow) -> Picture:
        """Return the photo's DN in a window, shape (rows, cols, 3), red first.

        DN are proportional to the square of the photo's numbers, which are made for a screen.
        """
        k = min(max(window.level - _HALVED_LEVEL, 0), len(self.halves) - 1)
        step = 2.0 ** (window.level - _HALVED_LEVEL - k)
        source = self.halves[k]
        east, north = window.en()
        x, y = np.meshgrid(
            _mirrored(east / window.cell_m * step - 0.5, source.shape[1]),
            _mirrored(-north / window.cell_m * step - 0.5, source.shape[0]),
        )
        counts = cv2.remap(
            source,
            x.astype(np.float32),
            y.astype(np.float32),
            cv2.INTER_CUBIC,
            borderMode=cv2.BORDER_REFLECT,
        )
        fine = np.stack([white(window, _SALT + band) for band in range(3)], axis=-1)
        shares = np.clip(counts / np.float32(_COUNT) + fine * _DITHER, 0, 255) / 255
        return np.asarray(np.rint(shares**2 * _BRIGHTEST), np.uint16)


def _mirrored(x: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Fold positions into a picture of n pixels, outer edges at -0.5 and n - 0.5."""
    return np.asarray(n - np.abs((x + 0.5) % (2 * n) - n) - 0.5)


def read_photo(path: str | Path) -> Photo:
    """Read a photograph from a JPEG, PNG or TIFF, converted to 8 bit and colour.

    Raises
    ------
    OSError
        Where the file does not exist, cannot be read or is too large.
    """
    image = _decoded(os.fspath(path))
    if image is None or min(image.shape[:2]) < 2:
        msg = "is not a picture that can be read; give a JPEG, PNG or TIFF"
        raise OSError(errno.EINVAL, msg, os.fspath(path))
    counts = image.astype(np.uint16)
    counts *= _COUNT
    halves = [_half(counts)]
    while min(halves[-1].shape[:2]) > 64:
        halves.append(_half(halves[-1]))
    return Photo(name=Path(path).name, halves=tuple(halves))


def _decoded(path: str) -> NDArray[np.uint8] | None:
    """Return a picture, None for a file that is none; raise an OSError for one too large."""
    if Path(path).exists() and not (Path(path).is_file() or Path(path).is_dir()):
        raise OSError(errno.EINVAL, "is no file", path)
    try:
        data = np.fromfile(path, np.uint8)
        with _silent():
            image = cv2.imdecode(data, cv2.IMREAD_COLOR_RGB) if len(data) else None
    except (cv2.error, MemoryError):
        msg = f"is too large a picture; at most {_MOST_PIXELS:,} pixels that fit into memory"
        raise OSError(errno.EFBIG, msg, path) from None
    return None if image is None else np.asarray(image, np.uint8)


@contextmanager
def _silent() -> Iterator[None]:
    """Suppress what the picture libraries themselves print to standard error."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def _half(image: Picture) -> Picture:
    size = image.shape[1] // 2, image.shape[0] // 2
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint16)
