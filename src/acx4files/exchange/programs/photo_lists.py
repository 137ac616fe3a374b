"""Lists of image coordinates of BINGO and PAT-B: a block for each image.

BINGO's image.dat is read as Pix4D documents what it writes: blocks ``image camera``, then ``point
x y`` in mm from the middle of the image; a block may end with -99. Of geoin.dat the lines CONT and
CHCK are read as one public reader has them; nothing was tried on a file that BINGO wrote.

Of PAT-B the image coordinates (.im) alone have a layout that is simple enough to read. No layout by
its maker, and no file, was at hand: blocks of an image, its points and -99, as other programs call
them. Control (.con) and orientations (.ori) are not read.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from acx4files.exchange import safe
from acx4files.exchange.coordinates import UNKNOWN, stacked
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.options import BlockOfProject, Option, PixelUm, Source
from acx4files.exchange.project import Control, Images, Measured, Project, first_use, flight_of
from acx4files.exchange.safe import Line, Opened
from acx4files.flight.problems import METRES, Range, lines_of, quoted
from acx4files.flight.table_files import checked
from acx4files.flight.tables import Schema, Table
from acx4lib.errors import FlightError

LISTED = Schema(
    required=(),
    keys=(("image", "point"),),
    ranges=dict.fromkeys(("x", "y"), Range(-1e7, 1e7)),
)
"""Image coordinates, in micrometres or larger units."""

END = "-99"
"""Mark of the end of a block; a list without marks has headers of exactly two cells."""

CAMERA = "CAM"
"""Name of the camera where a header has none."""

ROLES = {"CONT": "control", "CHCK": "check"}
"""Keywords of geoin.dat that are read."""

UM = {"mm": 1000.0, "um": 1.0}
"""Micrometres of the units that a .pro file of PAT-B may state."""

NOT_READ = (".con", ".ori", ".at", ".pro")
"""Endings of PAT-B's files that are not read."""

BINGO = ("x and y are in mm from the middle of the image, x right, y up, in the distorted image",)
UNTRIED = "CONT and CHCK of geoin.dat are point, east, north, height: untried on a file of BINGO"


Size = Annotated[str, Option("WxH", "Size of the pictures: 4000x3000.")]


def read_bingo(
    source: Annotated[Path, Source], *, size: Size, pixel_um: PixelUm, block: BlockOfProject = None
) -> ImportedFlight:
    """Read BINGO's image.dat, or *_bingo.txt of Pix4D; control points of geoin.dat beside it.

    Image coordinates are in mm from the middle of the image. The layout is that which Pix4D
    documents; it is untried on files that BINGO itself wrote.

    Examples
    --------
    acx4 import bingo image.dat --size 4000x3000 --pixel-um 6 --out my_flight

    Raises
    ------
    FlightError
        For another layout, and for a size that is none.
    """
    path = source / "image.dat" if source.is_dir() else source
    file, beside = safe.read(path), path.parent / "geoin.dat"
    others: dict[str, Any] = {"sources": [file], "assumed": BINGO}
    if beside.exists():
        geoin = safe.read(beside)
        control, unread = _control(geoin)
        shown = ", ".join(f"{count} {quoted(name)}" for name, count in unread.most_common(5))
        others["lost"] = {f"other lines of geoin.dat: {shown}": sum(unread.values())}
        if control is not None:
            others |= {"sources": [file, geoin], "assumed": (*BINGO, UNTRIED), "control": control}
    project = _project(_read(file), size, pixel_um, um=1000.0, source="BINGO", **others)
    return flight_of(project, block=block)


def read_patb(
    source: Annotated[Path, Source],
    *,
    unit: Annotated[Literal["um", "mm"], Option("", "Of x and y.")],
    size: Size,
    pixel_um: PixelUm,
    block: BlockOfProject = None,
) -> ImportedFlight:
    """Read PAT-B's image coordinates, .im: untried on a file that PAT-B wrote.

    Blocks of an image, its points and -99. Control and orientations of PAT-B are not read.

    Examples
    --------
    acx4 import patb my_block.im --unit um --size 4000x3000 --pixel-um 6 --out my_flight

    Raises
    ------
    FlightError
        For another layout, and for a size that is none.
    """
    file = safe.read(source)
    if source.suffix.lower() in NOT_READ:
        fault = f"{source.suffix} of PAT-B is not read: its layout is not known for certain"
        raise file.wrong("file", fault, "must be the image coordinates, .im")
    sentences = (
        f"x and y are in {unit} from the middle of the image, x right, y up; all images have one "
        "camera; what follows them on a line is no part of them",
        "the layout is untried on a file that PAT-B wrote",
    )
    points, about = _read(file, camera=CAMERA), {"sources": [file], "assumed": sentences}
    project = _project(points, size, pixel_um, um=UM[unit], source="PAT-B", **about)
    return flight_of(project, block=block)


def _read(file: Opened, camera: str = "") -> Table:
    """Return all measurements of a list; a camera is that of all images, else the header's."""
    pairs = list(_measurements(file))
    if not pairs:
        raise file.wrong("file", "has no measurement", "must have blocks: image camera; point x y")
    cells = {
        "image": [header.cells[0] for header, _ in pairs],
        "camera": [camera or (*header.cells, CAMERA)[1] for header, _ in pairs],
    }
    for k, name in enumerate(("point", "x", "y")):
        cells[name] = [row.cell(k, name) for _, row in pairs]
    lines = np.array([row.number for _, row in pairs])
    table = checked(Table(file=file.file, lines=lines), cells, LISTED)
    if table.problems:
        raise FlightError(lines_of(table.problems))
    return table


def _measurements(file: Opened) -> Iterator[tuple[Line, Line]]:
    """Yield every point with the header of its image."""
    rows = list(safe.lines(file, comment="#"))
    has_ends = any(row.cells[0] == END for row in rows)
    header: Line | None = None
    for row in rows:
        if row.cells[0] == END:
            header = None
        elif header is None or (not has_ends and len(row) == 2):
            header = row
        else:
            yield header, row


def _project(points: Table, size: str, pixel_um: float, *, um: float, **others: Any) -> Project:
    """Return a list as a project; `um` is the unit of its coordinates."""
    match = re.fullmatch(r"0*([1-9]\d{0,5})[x×]0*([1-9]\d{0,5})", size.strip(), re.ASCII | re.I)
    if match is None:
        raise FlightError([f"--size {size}: must be width x height in pixels, such as 4000x3000"])
    width, height = int(match[1]), int(match[2])
    xy = points.stack("x", "y") * (um / pixel_um)
    colrow = xy * [1, -1] + np.array([width - 1, height - 1]) / 2
    cameras = dict(zip(points.text["image"], points.text["camera"], strict=True))
    names, image_idx = first_use(points.text["image"])
    right, down = np.abs(xy).max(axis=0)
    return Project(
        sensors={
            name: {"width_px": width, "height_px": height, "pixel_um": pixel_um}
            for name in dict.fromkeys(cameras.values())
        },
        images=Images(
            names=tuple(names),
            cameras=tuple(cameras.values()),
            exposures=tuple(names),
            T_w_c=stacked([UNKNOWN] * len(names)),
        ),
        measured=Measured.of(list(zip(image_idx, points.text["point"], colrow, strict=True))),
        found=(
            f"the outermost measurement is {right:.0f} px, {down:.0f} px from the middle of "
            f"{width} x {height} px",
        ),
        **others,
    )


def _control(file: Opened) -> tuple[Control | None, Counter[str]]:
    """Return the points of geoin.dat, and the keywords of lines that are not read."""
    lines = [line for line in safe.lines(file) if line.cells[0] not in ("*", "C")]  # remarks
    points = [line for line in lines if line.cells[0] in ROLES]
    others = Counter(line.cells[0] for line in lines if line.cells[0] not in ROLES)
    if not points:
        return None, others
    enh = np.array([line.numbers(2, 5, "east, north, height", METRES) for line in points])
    names = tuple(line.cells[1] for line in points)
    is_check = tuple(ROLES[line.cells[0]] == "check" for line in points)
    return Control(names=names, enh=enh, is_check=is_check), others
