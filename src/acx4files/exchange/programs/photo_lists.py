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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from acx4files.exchange import safe
from acx4files.exchange.coordinates import UNKNOWN, stacked
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.options import BlockOfProject, Option, PixelUm, Source
from acx4files.exchange.project import (
    Control,
    Images,
    Measured,
    Project,
    first_use,
    flight_of,
    naming,
    require_names,
)
from acx4files.exchange.safe import Line, Opened
from acx4files.flight.problems import METRES, Range, quoted
from acx4lib.errors import FlightError

IMAGE = Range(-1e7, 1e7)
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
        As `bingo` and `flight_of`, and for a size that is none.
    """
    return flight_of(bingo(source, size=_width_height(size), pixel_um=pixel_um), block=block)


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
    size_px = _width_height(size)
    return flight_of(_patb(source, unit=unit, size=size_px, pixel_um=pixel_um), block=block)


def _width_height(text: str) -> tuple[int, int]:
    """Return width and height, px, of a text such as 4000x3000."""
    match = re.fullmatch(r"0*([1-9]\d{0,5})[x×]0*([1-9]\d{0,5})", text.strip(), re.ASCII | re.I)
    if match is None:
        says = "must be width x height in pixels, such as 4000x3000"
        raise FlightError([f"--size {text}: {says}"])
    return int(match[1]), int(match[2])


def bingo(source: Path, *, size: tuple[int, int], pixel_um: float) -> Project:
    """Return BINGO's image.dat, and geoin.dat beside it.

    Parameters
    ----------
    source : Path
        The list of image coordinates, whatever its name is, or the folder with image.dat.
    size : tuple of int
        Width and height of the images, px.
    pixel_um : float

    Raises
    ------
    FlightError
        For another layout.
    """
    path = source / "image.dat" if source.is_dir() else source
    file = safe.read(path)
    points = _read(file)
    beside = path.parent / "geoin.dat"
    control, others, sources = None, Counter[str](), [file]
    if beside.exists():
        geoin = safe.read(beside)
        control, others = _control(geoin)
        sources += [geoin] if control is not None else []
    shown = ", ".join(f"{count} {quoted(name)}" for name, count in others.most_common(5))
    return _project(
        points,
        size=size,
        pixel_um=pixel_um,
        pixels_per_unit=1000 / pixel_um,
        source="BINGO",
        sources=sources,
        control=control,
        lost={f"other lines of geoin.dat: {shown}": sum(others.values())},
        assumed=BINGO if control is None else (*BINGO, UNTRIED),
    )


def _patb(source: Path, *, unit: str, size: tuple[int, int], pixel_um: float) -> Project:
    """Return PAT-B's image coordinates."""
    file = safe.read(source)
    if source.suffix.lower() in NOT_READ:
        fault = f"{source.suffix} of PAT-B is not read: its layout is not known for certain"
        raise file.wrong("file", fault, "must be the image coordinates, .im")
    left_out = tuple(
        f"{path.name}: not read"
        for path in sorted(source.parent.glob(f"{source.stem}.*"))
        if path.suffix.lower() in NOT_READ
    )
    sentences = (
        f"x and y are in {unit} from the middle of the image, x right, y up; all images have one "
        "camera; what follows them on a line is no part of them",
        "the layout is untried on a file that PAT-B wrote",
    )
    return _project(
        _read(file, camera=CAMERA),
        size=size,
        pixel_um=pixel_um,
        pixels_per_unit=UM[unit] / pixel_um,
        source="PAT-B",
        sources=[file],
        assumed=sentences,
        left_out=left_out,
    )


@dataclass(frozen=True, kw_only=True)
class _Seen:
    """A measured point; `xy` is in the list's unit, from the middle of the image, y up."""

    line: Line
    image: str
    camera: str
    point: str
    xy: tuple[float, float]


def _read(file: Opened, camera: str = "") -> list[_Seen]:
    """Return all measurements of a list; a camera is that of all images, else the header's."""
    points: list[_Seen] = []
    before: set[tuple[str, str]] = set()
    for header, rows in _blocks(file):
        image = header.cell(0, "image")
        camera_name = camera or (header.cells[1] if len(header) > 1 else CAMERA)
        for row in rows:
            point = row.cell(0, "point")
            if (image, point) in before:
                fault = f"{quoted(point)} stands twice in image {quoted(image)}"
                raise row.wrong("point", fault, "must stand once")
            before.add((image, point))
            xy = (row.number_at(1, "x", IMAGE), row.number_at(2, "y", IMAGE))
            points.append(_Seen(line=row, image=image, camera=camera_name, point=point, xy=xy))
    if not points:
        raise file.wrong("file", "has no measurement", "must have blocks: image camera; point x y")
    return points


def _blocks(file: Opened) -> Iterator[tuple[Line, list[Line]]]:
    """Yield the header and the points of every image."""
    rows = list(safe.lines(file, comment="#"))
    ends = any(row.cells[0] == END for row in rows)
    header: Line | None = None
    points: list[Line] = []
    for row in rows:
        if row.cells[0] == END:
            if header is None:
                raise row.wrong("block", f"{END} without a header", "must be image, then points")
            yield header, points
            header, points = None, []
        elif header is None:
            header = row
        elif not ends and len(row) == 2:
            yield header, points
            header, points = row, []
        else:
            points.append(row)
    if header is not None:
        yield header, points


def _project(
    points: Sequence[_Seen],
    *,
    size: tuple[int, int],
    pixel_um: float,
    pixels_per_unit: float,
    **others: Any,
) -> Project:
    """Return a list as a project, with other fields of it."""
    cameras: dict[str, str] = {}
    for point in points:
        named = (point.image, point.camera, point.point)
        require_names(named, naming(partial(point.line.wrong, "name")))
        if cameras.setdefault(point.image, point.camera) != point.camera:
            two = f"{quoted(cameras[point.image])} and {quoted(point.camera)}"
            fault = f"image {quoted(point.image)} has the cameras {two}"
            raise point.line.wrong("camera", fault, "must be one")
    xy = np.array([point.xy for point in points]) * [pixels_per_unit, -pixels_per_unit]
    width, height = size
    middle = np.array([width - 1, height - 1]) / 2
    names, image_idx = first_use([point.image for point in points])
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
        measured=Measured.of(
            list(zip(image_idx, (point.point for point in points), xy + middle, strict=True))
        ),
        found=(
            f"the outermost measurement is {right:.0f} px, {down:.0f} px from the middle of "
            f"{width} x {height} px",
        ),
        **others,
    )


def _control(file: Opened) -> tuple[Control | None, Counter[str]]:
    """Return the points of geoin.dat, and the keywords of lines that are not read."""
    rows: dict[str, tuple[list[float], bool]] = {}
    others: Counter[str] = Counter()
    for line in safe.lines(file):
        keyword = line.cells[0]
        if keyword in ("*", "C"):  # remarks
            continue
        if keyword not in ROLES:
            others[keyword] += 1
            continue
        name = line.cell(1, "point")
        if name in rows:
            raise line.wrong("point", f"{quoted(name)} stands twice", "must stand once")
        enh = line.numbers(2, 5, "east, north, height", METRES).tolist()
        rows[name] = (enh, ROLES[keyword] == "check")
    if not rows:
        return None, others
    enh, is_check = zip(*rows.values(), strict=True)
    return Control(names=tuple(rows), enh=np.array(enh), is_check=is_check), others
