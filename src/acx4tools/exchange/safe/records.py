"""Binary files: records of one layout, or values one after another."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4tools.exchange.safe.opened import Opened

LONGEST_NAME = 1000
"""Largest number of bytes of a text in a binary file."""


def records(source: Opened, layout: np.dtype[Any]) -> NDArray[Any]:
    """Return a file that consists of records of one layout, an element for each.

    Parameters
    ----------
    source : Opened
    layout : dtype
        Of one record, with its byte order.

    Raises
    ------
    FlightError
        Where the file does not hold a whole number of records.
    """
    size = len(source.data)
    if size % layout.itemsize:
        expected = f"must be a multiple of {layout.itemsize}, one record; is it cut off?"
        raise source.wrong("file", f"has {size} bytes", expected)
    return np.frombuffer(source.data, dtype=layout)


@dataclass(kw_only=True)
class Cursor:
    """A place in a binary file, from which values are taken.

    Attributes
    ----------
    source : Opened
    at : int
        Bytes before it.
    """

    source: Opened
    at: int = 0

    @property
    def left(self) -> int:
        """Count the bytes that follow."""
        return len(self.source.data) - self.at

    def take(self, layout: str, element: str) -> tuple[Any, ...]:
        """Return the next values, by a layout of `struct`; `element` is what messages call them."""
        begin = self._skip(struct.calcsize(layout), element)
        return struct.unpack_from(layout, self.source.data, begin)

    def array(self, layout: np.dtype[Any], n: int, element: str) -> NDArray[Any]:
        """Return the next `n` records of a layout."""
        begin = self._skip(n * layout.itemsize, element)
        return np.frombuffer(self.source.data, dtype=layout, count=n, offset=begin)

    def text(self, element: str) -> str:
        """Return the next text, which a null byte ends."""
        end = self.source.data.find(b"\0", self.at, self.at + LONGEST_NAME)
        if end < 0:
            found = f"text at byte {self.at} has no end"
            raise self.source.wrong(element, found, f"must have at most {LONGEST_NAME} bytes")
        begin = self._skip(end + 1 - self.at, element)
        try:
            return self.source.data[begin:end].decode("utf-8")
        except UnicodeDecodeError:
            raise self.source.wrong(element, f"text at byte {begin}", "must be UTF-8") from None

    def _skip(self, size: int, element: str) -> int:
        """Move on, and return where that began."""
        if not 0 <= size <= self.left:
            found = f"at byte {self.at}: {max(size, 0)} bytes, {self.left} are left"
            raise self.source.wrong(element, found, "must be complete; is the file cut off?")
        self.at += size
        return self.at - size
