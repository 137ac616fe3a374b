"""Images that are mapped from their files: what was read of them can be forgotten."""

from __future__ import annotations

import mmap

import numpy as np


def mapped_file(image: np.ndarray) -> mmap.mmap | None:
    """Return the mapping that an image lies in; None where it lies in memory."""
    base: object = image
    while isinstance(base, np.ndarray | memoryview):
        base = base.base if isinstance(base, np.ndarray) else base.obj
    return base if isinstance(base, mmap.mmap) else None


def forget(image: np.ndarray) -> None:
    """Give back the memory of mapped pixels; they are read again where they are needed.

    An image that lies in memory stays as it is. Four heads of an aerial camera are more than
    what a renderer should hold at a time.
    """
    mapped = mapped_file(image)
    if mapped is not None and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)
