"""Overviews of an image that comes in stripes: each has half the size of the one before."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryFile
from types import TracebackType
from typing import IO, Self

import cv2
import numpy as np

from acx4lib.expected import Raster


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


class Pyramid:
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
        """Open it; its file is removed when it closes or the process ends."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        """Close the file, which removes it."""
        self._file.close()

    def _row_bytes(self, level: int) -> int:
        return self._sizes[level][1] * self._bands * self._dtype.itemsize

    def add(self, stripe: Raster) -> None:
        """Add the next rows of the image, any number of them."""
        self._add(stripe, 0)

    def _add(self, stripe: Raster, level: int) -> None:
        """Add rows to a level, and their halved rows to the next level."""
        if level:
            at = self._start[level] + self._done[level] * self._row_bytes(level)
            self._file.seek(at)
            self._file.write(np.ascontiguousarray(stripe).data)
        self._done[level] += len(stripe)
        if level + 1 == len(self._sizes):
            return
        rest = self._rest[level]
        rows = stripe if rest is None else np.concatenate([rest, stripe])
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
            data = self._file.read(n * self._row_bytes(level))
            yield np.frombuffer(data, dtype=self._dtype).reshape(n, cols, self._bands)
