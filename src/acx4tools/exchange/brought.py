"""What an import brings of a flight, in the flight's own form, and what it says of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acx4lib.flight.table_files import Columns


@dataclass(frozen=True, kw_only=True)
class Brought:
    """A part of a flight that was read from another program's files, or all of it.

    Attributes
    ----------
    source : str
        Program or format, with its version where the files state it: "Metashape 1.7.2".
    sha256 : mapping of str to str
        The files that were read, by their names without folders.
    settings : mapping
        Keys of flight.toml, nested as there. What the source does not know is absent.
    tables : mapping of str to table
        By file below the flight: ``calibration/images.csv``, ``control_points.csv``. Columns and
        units are those of the file of this name.
    pictures : mapping of str to Path
        Where the pictures are that column ``file`` of an images.csv names, by file below the
        flight: ``calibration/images/a.tif``.
    assumed : tuple of str
        Conventions that were assumed: axes, origins, angles, time bases, datums; a sentence each.
    found : tuple of str
        What was read, counted, and what proves that it was read rightly: a sentence each.
    left_out : tuple of str
        What the source has and the flight has not, counted and named, and why.
    """

    source: str
    sha256: Mapping[str, str]
    settings: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, Columns] = field(default_factory=dict)
    pictures: Mapping[str, Path] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    found: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def number_of(n: int, nouns: str) -> str:
    """Return a number with its noun, given for many: 2 cameras, 1 camera."""
    return f"{n} {nouns.removesuffix('s') if n == 1 else nouns}"
