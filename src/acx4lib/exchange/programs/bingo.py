"""BINGO's image.dat, and the control points of geoin.dat.

image.dat as Pix4D documents what it writes: blocks ``image camera``, then ``point x y`` in mm from
the middle of the image; a block may end with -99. Of geoin.dat the lines CONT and CHCK are read as
one public reader has them; nothing of it has been tried on a file that BINGO wrote.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

from acx4lib.exchange.brought import Brought
from acx4lib.exchange.programs.shared import photo_lists
from acx4lib.exchange.programs.shared.photo_lists import Measured
from acx4lib.exchange.safe import opened, text_lines
from acx4lib.flight.problems import METRES, quoted

ROLES = {"CONT": "control", "CHCK": "check"}

ASSUMED = ("x and y are in mm from the middle of the image, x right, y up, in the distorted image",)
UNTRIED = "CONT and CHCK of geoin.dat are point, east, north, height: untried on a file of BINGO"


def read(
    source: Path, *, size: tuple[int, int], pixel_um: float, block: str | None = None
) -> Brought:
    """Read image.dat, and geoin.dat beside it.

    Parameters
    ----------
    source : Path
        The list of image coordinates, whatever its name is, or the folder with image.dat.
    size : tuple of int
        Width and height of the images, px.
    pixel_um : float
    block : str, optional
        By default calibration.

    Raises
    ------
    FlightError
        For another layout.
    """
    path = source / "image.dat" if source.is_dir() else source
    file = opened.read(path)
    found = photo_lists.read(file)
    brought = photo_lists.brought(
        file,
        found,
        source="BINGO",
        pixels_per_unit=1000 / pixel_um,
        size=size,
        pixel_um=pixel_um,
        block=block or "calibration",
    )
    brought = replace(brought, assumed=ASSUMED)
    control = path.parent / "geoin.dat"
    return _with_control(brought, control, found) if control.exists() else brought


def _with_control(brought: Brought, path: Path, found: list[Measured]) -> Brought:
    file = opened.read(path)
    rows: dict[str, list[Any]] = {}
    others: Counter[str] = Counter()
    for line in text_lines.lines(file):
        keyword = line.cells[0]
        if keyword in ("*", "C"):  # remarks
            continue
        if keyword not in ROLES:
            others[keyword] += 1
            continue
        name = line.cell(1, "point")
        if name in rows:
            raise line.wrong("point", f"{quoted(name)} stands twice", "must stand once")
        rows[name] = [*line.numbers(2, 5, "east, north, height", METRES).tolist(), ROLES[keyword]]
    if not rows:
        return replace(brought, left_out=_not_read(others))
    columns = ("east_m", "north_m", "height_m", "role")
    table = dict(zip(columns, map(list, zip(*rows.values(), strict=True)), strict=True))
    measured = {one.point for one in found}
    seen = len(measured.intersection(rows))
    return replace(
        brought,
        sha256={**brought.sha256, **opened.checksums([file])},
        tables={**brought.tables, "control_points.csv": {"point": [*rows], **table}},
        assumed=(*brought.assumed, UNTRIED),
        found=(*brought.found, f"{len(rows)} control and check points, {seen} of them measured"),
        left_out=_not_read(others),
    )


def _not_read(others: Counter[str]) -> tuple[str, ...]:
    n = sum(others.values())
    shown = ", ".join(f"{count} {quoted(name)}" for name, count in others.most_common(5))
    return (f"{n} other lines of geoin.dat: {shown}",) if n else ()
