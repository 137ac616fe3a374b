"""Lists of image coordinates, a block for each image, as BINGO and PAT-B have them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.shared import tables
from acx4lib.exchange.safe import opened, text_lines
from acx4lib.exchange.safe.opened import Opened
from acx4lib.exchange.safe.text_lines import Line
from acx4lib.flight.problems import Range, quoted

IMAGE = Range(-1e7, 1e7)
"""Image coordinates, in micrometres or larger units."""

END = "-99"
"""What a block ends with; a list without any has headers of exactly two cells instead."""

CAMERA = "CAM"
"""Name of the camera where a header has none."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A measured point.

    Attributes
    ----------
    line : Line
    image, camera, point : str
    xy : tuple of float
        In the list's unit, from the middle of the image, y up.
    """

    line: Line
    image: str
    camera: str
    point: str
    xy: tuple[float, float]


def read(file: Opened) -> list[Measured]:
    """Return all measurements of a list.

    Raises
    ------
    FlightError
        For a line that is neither a header nor a point, or a point that an image has twice.
    """
    found: list[Measured] = []
    seen: set[tuple[str, str]] = set()
    for header, rows in _blocks(file):
        image = header.cell(0, "image")
        camera = header.cells[1] if len(header) > 1 else CAMERA
        for row in rows:
            point = row.cell(0, "point")
            if (image, point) in seen:
                what = f"{quoted(point)} stands twice in image {quoted(image)}"
                raise row.wrong("point", what, "must stand once")
            seen.add((image, point))
            xy = (row.number_at(1, "x", IMAGE), row.number_at(2, "y", IMAGE))
            found.append(Measured(line=row, image=image, camera=camera, point=point, xy=xy))
    if not found:
        raise file.wrong("file", "has no measurement", "must have blocks: image camera; point x y")
    return found


def _blocks(file: Opened) -> Iterator[tuple[Line, list[Line]]]:
    """Yield the header and the points of every image."""
    rows = list(text_lines.lines(file, comment="#"))
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


def brought(
    file: Opened,
    found: Sequence[Measured],
    *,
    source: str,
    pixels_per_unit: float,
    size: tuple[int, int],
    pixel_um: float,
    block: str,
) -> Brought:
    """Return a list as tables of a flight.

    Parameters
    ----------
    file : Opened
    found : sequence of Measured
    source : str
        Of which program.
    pixels_per_unit : float
    size : tuple of int
        Width and height of the images, px.
    pixel_um : float
    block : str

    Raises
    ------
    FlightError
        For a name that no flight may use, or one image with two cameras.
    """
    cameras: dict[str, str] = {}
    for one in found:
        tables.require_names((one.image, one.camera, one.point), _at(one.line))
        if cameras.setdefault(one.image, one.camera) != one.camera:
            two = f"{quoted(cameras[one.image])} and {quoted(one.camera)}"
            what = f"image {quoted(one.image)} has the cameras {two}"
            raise one.line.wrong("camera", what, "must be one")
    xy = np.array([one.xy for one in found]) * [pixels_per_unit, -pixels_per_unit]
    colrow = xy + np.array([size[0] - 1, size[1] - 1]) / 2
    points = [one.point for one in found]
    width, height = size
    sensor = {"width_px": width, "height_px": height, "pixel_um": pixel_um}
    return Brought(
        source=source,
        sha256=opened.checksums([file]),
        settings={"cameras": {name: dict(sensor) for name in dict.fromkeys(cameras.values())}},
        tables={
            f"{block}/images.csv": tables.images([*cameras], [*cameras.values()], [*cameras]),
            f"{block}/image_points.csv": tables.image_points(
                [one.image for one in found], points, colrow
            ),
        },
        found=(
            f"{number_of(len(cameras), 'images')}, {number_of(len(set(points)), 'points')}, "
            f"{number_of(len(found), 'measurements')}; the "
            f"outermost is {np.abs(xy).max(axis=0)[0]:.0f} px, {np.abs(xy).max(axis=0)[1]:.0f} px "
            f"from the middle of {width} x {height} px",
        ),
    )


def _at(line: Line) -> Callable[[str, str, str], FlightError]:
    def wrong(name: str, found: str, expected: str) -> FlightError:
        return line.wrong("name", found if name in found else f"{quoted(name)} {found}", expected)

    return wrong
