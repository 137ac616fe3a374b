"""Images mapped from their files: memory of pixels that were read can be given back."""

from __future__ import annotations

import mmap

import numpy as np


def mapped_file(image: np.ndarray) -> mmap.mmap | None:
    """Return the file mapping of an image; None for an image in memory."""
    base: object = image
    while isinstance(base, np.ndarray | memoryview):
        base = base.base if isinstance(base, np.ndarray) else base.obj
    return base if isinstance(base, mmap.mmap) else None


def forget(image: np.ndarray) -> None:
    """Give back the memory of mapped pixels; they are read again when they are needed.

    An image in memory is not changed. The images of four aerial heads are too large to be held in
    memory during rendering.
    """
    mapped = mapped_file(image)
    if mapped is not None and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)
