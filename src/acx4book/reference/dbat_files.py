"""The Damped Bundle Adjustment Toolbox (DBAT): its projects and reports, and numbers beside theirs.

DBAT counts image coordinates from the upper left corner of the image and subtracts the principal
point (px, py from that corner). It *adds* the distortion, so every K and P has the opposite sign.
It gives px and the width of the format for pixels that are 1 + as times wider than high.
Differences are in units of the last printed digit.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.reference import data
from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.bundle import adjust
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.start import resected
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.frames import Pose

# --- files of a project and of a report


INTERIOR_NAMES = ("cc", "px", "py", "as", "K1", "K2", "K3", "P1", "P2")
"""DBAT's interior parameters, in the order of `interior_to_dbat`."""

_OURS = ("f", "xp", "yp", "b1", "k1", "k2", "k3", "p1", "p2")
_HALF_PIXEL = 0.5
"""Our coordinates (0, 0) are the centre of a pixel, theirs are its corner."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurements:
    """Image points of a file.

    Attributes
    ----------
    image, point : ndarray, shape (n,)
        DBAT's numbers of images, from 1, and of points.
    xy_px : ndarray, shape (n, 2)
        Coordinates from the upper left corner, y down.
    sigma_px : ndarray, shape (n,)
    """

    image: Index
    point: Index
    xy_px: Array
    sigma_px: Array

    @property
    def colrow(self) -> Array:
        """Pixel coordinates in the library's convention, shape (n, 2)."""
        return self.xy_px - _HALF_PIXEL


@dataclass(frozen=True, kw_only=True, eq=False)
class Surveyed:
    """Points with given coordinates.

    Attributes
    ----------
    point : ndarray, shape (n,)
    labels : tuple of str
    x, sigma : ndarray, shape (n, 3)
        Object units; sigma is zero where the file has none.
    """

    point: Index
    labels: tuple[str, ...]
    x: Array
    sigma: Array


def _rows(path: Path) -> list[list[str]]:
    """Return the cells of a comma-separated file without comments and empty lines."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [
        [cell.strip() for cell in line.split(",")]
        for line in lines
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _table(path: Path, columns: tuple[str, ...], cure: str = "") -> Array:
    """Return a file of numbers; ValueError with the line and the column where one is missing."""
    rows = _rows(path)
    for number, row in enumerate(rows, 1):
        if len(row) != len(columns):
            expected = ", ".join(columns[len(row) :]) or f"only {len(columns)} columns"
            problem = f"row {number} has {len(row)} of {len(columns)} columns"
            msg = f"{path}: {problem} ({', '.join(columns)}); expected {expected}{cure}"
            raise ValueError(msg)
    return np.array(rows, dtype=float).reshape(-1, len(columns))


def read_image_points(path: Path) -> Measurements:
    """Read "image, point, x, y, sigma".

    Raises
    ------
    ValueError
        Where a row has another number of columns, as one without sigma.
    """
    cure = ": write the sigma of every measurement, px, as the last column"
    table = _table(path, ("image", "point", "x", "y", "sigma"), cure)
    return Measurements(
        image=table[:, 0].astype(np.intp),
        point=table[:, 1].astype(np.intp),
        xy_px=table[:, 2:4],
        sigma_px=table[:, 4],
    )


def read_marked_points(path: Path, *, sigma_px: float) -> Measurements:
    """Read "point, image, x, y"; all measurements get the same sigma."""
    table = _table(path, ("point", "image", "x", "y"))
    return Measurements(
        image=table[:, 1].astype(np.intp),
        point=table[:, 0].astype(np.intp),
        xy_px=table[:, 2:4],
        sigma_px=np.full(len(table), sigma_px),
    )


def _joined(parts: tuple[Measurements, ...]) -> Measurements:
    """Return the measurements of several files together."""
    return Measurements(
        image=np.concatenate([part.image for part in parts]),
        point=np.concatenate([part.point for part in parts]),
        xy_px=np.concatenate([part.xy_px for part in parts]),
        sigma_px=np.concatenate([part.sigma_px for part in parts]),
    )


def _read_surveyed(path: Path) -> Surveyed:
    """Read "point, label, x, y, z" with or without three sigmas, sorted by point."""
    rows = sorted(_rows(path), key=lambda row: int(row[0]))
    numbers = np.array([row[2:] for row in rows], dtype=float)
    return Surveyed(
        point=np.array([int(row[0]) for row in rows], dtype=np.intp),
        labels=tuple(row[1] for row in rows),
        x=numbers[:, :3],
        sigma=numbers[:, 3:] if numbers.shape[1] > 3 else np.zeros((len(rows), 3)),
    )


def _read_images(path: Path) -> tuple[str, ...]:
    """Read the images' file names, without folders, in the order of their numbers."""
    rows = sorted(_rows(path), key=lambda row: int(row[0]))
    return tuple(row[1].rsplit("/", 1)[-1] for row in rows)


# --- conventions -----------------------------------------------------------------------------


def _camera_from_dbat(
    *, cc: float, pp: tuple[float, float] | None, size_px: tuple[int, int], pixel_mm: float
) -> Camera:
    """Return a camera without distortion from DBAT's values."""
    middle = 0.5 * pixel_mm * np.array(size_px)
    xp, yp = (np.array(pp) - middle) * [1, -1] if pp is not None else (0.0, 0.0)
    return Camera(
        name="Camera1",
        width_px=size_px[0],
        height_px=size_px[1],
        pixel_mm=pixel_mm,
        interior=Interior(f=cc, xp=float(xp), yp=float(yp)),
    )


def interior_to_dbat(camera: Camera, cov: Array) -> tuple[Array, Array]:
    """Return an interior orientation and its covariance in DBAT's parameters.

    Parameters
    ----------
    camera : Camera
    cov : ndarray, shape (10, 10)
        In the order of `camera.INTERIOR`; b2, which DBAT does not have, is left out.

    Returns
    -------
    values : ndarray, shape (9,)
        In the order of `INTERIOR_NAMES`.
    cov : ndarray, shape (9, 9)

    Notes
    -----
    x (1 + b1) - xp equals (1 + b1) (x - xp / (1 + b1)). From this follow px and its derivatives.
    """
    interior = camera.interior
    order = [INTERIOR.index(name) for name in _OURS]
    values = interior.to_array()[order]
    scale = 1 + interior.b1
    values[1] = interior.xp / scale + 0.5 * camera.width_px * camera.pixel_mm
    values[2] = 0.5 * camera.height_px * camera.pixel_mm - interior.yp
    values[4:] *= -1
    by_ours = np.diag([1.0, 1 / scale, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    by_ours[1, 3] = -interior.xp / scale**2
    return values, by_ours @ cov[np.ix_(order, order)] @ by_ours.T


# --- DBAT's report: every printed number with its place
#
# The report is a tree with indentation. The place of a line is the path of headings above it and
# its own label. Its statement is the rest, without the numbers.


NUMBER = re.compile(r"(?<![\w.%])(?<!\^\()(?<!\^\(-)-?\d+(?:\.\d+)?(?:e[-+]\d+)?(?!\w|\.\w)")
"""A separate number: not the 3 of K3, the 4.13 of the label B4.13 or the power of a unit."""

_COUNTED = re.compile(r"^(\d+) (points with \d+ rays)\.$")
_RAYS = re.compile(r"^(\d+): (\d+\.\d+ \([\d ]*\))$")
_ROW = re.compile(r"^(\d+),")
_TABLES = ("Prior", "Posterior", "Diff", "Smallest angles")


@dataclass(frozen=True, kw_only=True)
class Line:
    """One line of a report.

    Attributes
    ----------
    path : tuple of str
        Headings, the outermost first, then the line's own label.
    statement : str
        Text after the label, with ``{}`` in the place of every number.
    numbers : tuple of str
        The numbers as printed.
    """

    path: tuple[str, ...]
    statement: str
    numbers: tuple[str, ...]


def read(path: Path) -> dict[tuple[str, ...], Line]:
    """Read a report.

    Returns
    -------
    dict
        Its lines by their path, in their order, without headings that have no statement.

    Raises
    ------
    ValueError
        Where two lines have the same place.
    """
    lines: dict[tuple[str, ...], Line] = {}
    for line in _lines(path.read_text(encoding="utf-8")):
        if line.path in lines:
            msg = f"{path}: {' > '.join(line.path)} stands there twice"
            raise ValueError(msg)
        lines[line.path] = line
    headings = {place[:depth] for place in lines for depth in range(1, len(place))}
    return {place: line for place, line in lines.items() if line.statement or place not in headings}


def _lines(text: str) -> Iterator[Line]:
    headings: list[tuple[int, str]] = []
    for raw in text.splitlines()[1:-1]:
        content = raw.strip()
        depth = len(raw) - len(raw.lstrip())
        if content.startswith("id,"):
            continue
        if _ROW.match(content) or _RAYS.match(content):
            depth = _table_depth(headings)  # the indentation of right-aligned numbers varies
        while headings and headings[-1][0] >= depth:
            headings.pop()
        label, statement = _split(content)
        path = (*(heading for _, heading in headings), label)
        headings.append((depth, label))
        numbers = tuple(NUMBER.findall(statement))
        yield Line(path=path, statement=_plain(NUMBER.sub("{}", statement)), numbers=numbers)


def _table_depth(headings: list[tuple[int, str]]) -> int:
    """Return a depth just below the table's heading."""
    return next(depth for depth, name in reversed(headings) if name.startswith(_TABLES)) + 1


def _split(content: str) -> tuple[str, str]:
    """Return a line's label and its statement."""
    for pattern in (_COUNTED, _RAYS):
        if match := pattern.match(content):
            first, second = match.groups()
            return (second, first) if pattern is _COUNTED else (first, second)
    if _ROW.match(content):
        label, _, statement = content.partition(",")
        return label, statement
    if content.startswith("Redundancy "):  # this is the only label without a colon
        return "Redundancy", content.removeprefix("Redundancy")
    label, _, statement = content.partition(":")
    return label.strip(), statement.strip()


def _plain(statement: str) -> str:
    """Return a statement with single spaces, and none after an opening parenthesis."""
    return " ".join(statement.split()).replace("( ", "(")


# --- a project read, and a printed number beside one that is computed


COLUMNS = ("quantity", "kind", "printed", "ours", "difference", "unit", "units", "agrees")


class Angle(float):
    """An angle in degrees; full turns do not matter."""

    __slots__ = ()


@dataclass(frozen=True, kw_only=True)
class Statement:
    """Our version of a printed statement.

    Attributes
    ----------
    text : str
        Text with ``{}`` in the place of every number.
    values : tuple of float or int
        An int is a count or a name and must agree exactly; a float must agree to one unit.
    """

    text: str
    values: tuple[float | int, ...] = ()


Statements = dict[tuple[str, ...], Statement]


def say(text: str, *values: float) -> Statement:
    """Return a statement."""
    return Statement(text=text, values=values)


def last_digit(printed: str) -> float:
    """Return the unit of the last digit of a printed number: 0.01 for ``-3.40``."""
    mantissa, _, exponent = printed.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(f"1e{int(exponent or 0) - decimals}")


def compare(
    printed: Mapping[tuple[str, ...], Line], ours: Mapping[tuple[str, ...], Statement]
) -> pd.DataFrame:
    """Compare all lines of a report with our statements.

    Parameters
    ----------
    printed : mapping
        Lines of a report by their places, without headings and lines that are no results.
    ours : mapping
        Our statements for the same places.

    Returns
    -------
    DataFrame
        One row per printed number, and one per statement without numbers. `units` is the
        difference in units of the last printed digit. A place that exists on one side only, or a
        statement with another text, has a row that does not agree.
    """
    rows: list[tuple[object, ...]] = []
    for path in (*printed, *(path for path in ours if path not in printed)):
        rows += _rows_of_path(path, printed.get(path), ours.get(path))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _rows_of_path(
    path: tuple[str, ...], line: Line | None, statement: Statement | None
) -> list[tuple[object, ...]]:
    quantity, kind = " > ".join(path), _kind(path)
    if line is None or statement is None or line.statement != statement.text:
        text = line.statement.format(*line.numbers) if line else ""
        ours = statement.text if statement else "nothing"
        return [(f"{quantity} [{ours}]", kind, text, *[np.nan] * 4, False)]
    if not line.numbers:
        return [(quantity, "statement", line.statement, np.nan, 0.0, np.nan, 0.0, True)]
    out: list[tuple[object, ...]] = []
    several = len(line.numbers) > 1
    for number, (text, value) in enumerate(zip(line.numbers, statement.values, strict=True), 1):
        name = f"{quantity} ({number})" if several else quantity
        out.append((name, _kind(path, number), *_row(text, value)))
    return out


def _row(printed: str, value: float) -> tuple[str, float, float, float, float, bool]:
    """Return printed, ours, difference, unit, difference in units, and whether it agrees."""
    difference = float(value) - float(printed)
    if isinstance(value, Angle):
        difference = (difference + 180) % 360 - 180
    if isinstance(value, int):
        return printed, float(value), difference, 1.0, difference, difference == 0
    unit = last_digit(printed)
    agrees = abs(difference) <= unit
    units = round(difference / unit, DIGITS)
    same_turn = float(value) - difference
    return printed, same_turn + units * unit, units * unit, unit, units, agrees


DIGITS = 4
"""Decimals of a difference in units of the last digit; further ones change with any rounding."""

KINDS = (
    (("Correlations over",), "correlation"),
    (("Photo ", "> Value"), "exterior orientation"),
    (("> Deviation",), "standard deviation"),
    (("Camera1 ", "ignificance"), "significance"),
    (("Quality > Cameras",), "coverage"),
    (("Cameras",), "camera"),
    (("Residuals",), "residual statistic"),
    (("Total error",), "residual statistic"),
    (("Sigma0",), "residual statistic"),
    (("Point Precision",), "standard deviation"),
    (("Point Angles",), "angle of rays"),
    (("measurements",), "object point"),
)
"""Words in the place of a quantity, and its kind; the first entry that fits is used."""


def _kind(path: tuple[str, ...], number: int = 1) -> str:
    place = " > ".join(path)
    if " measurements > Posterior" in place and 4 <= number <= 6:
        return "standard deviation"
    for words, kind in KINDS:
        if all(word in place for word in words):
            return kind
    return "count"


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the numbers of values and the largest difference by kind.

    Parameters
    ----------
    table : DataFrame
        As `compare` returns it.

    Returns
    -------
    DataFrame
        kind, values, agree, largest (difference in units of the last digit); the last row is
        for all kinds together.
    """
    total = table.assign(kind="all")
    groups = pd.concat([table, total]).groupby("kind", sort=False)
    out = groups.agg(
        values=("agrees", "size"),
        agree=("agrees", "sum"),
        largest=("units", lambda units: units.abs().max()),
    )
    return out.reset_index()


# --- DBAT's two projects as blocks; approximate values come from the measurements only


FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2", "b1")
"""Interior parameters that the project `camcal` estimates: all that it has."""

CHECK_POINTS = (351, 410)
"""Points of the project `sxb` that its author used as check points."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Project:
    """A project of DBAT, adjusted here.

    Attributes
    ----------
    bundle : Bundle
    report : Path
        Report that DBAT printed.
    surveyed : Surveyed
        Control and check points as given.
    is_check : ndarray, shape (n_surveyed,)
    origin : ndarray, shape (3,)
        Subtracted from the coordinates before the adjustment.
    free : tuple of str
        Interior parameters that were estimated.
    """

    bundle: Bundle
    report: Path
    surveyed: Surveyed
    is_check: np.ndarray
    origin: Array
    free: tuple[str, ...]


def camcal() -> Project:
    """Calibrate the camera of `camcal`: 21 images of a flat sheet, four points without error."""
    measured = read_image_points(data.path("dbat-camcal/image_points.txt"))
    # the height of the format is given in mm
    camera = _camera_from_dbat(cc=7.3, pp=None, size_px=(2272, 1704), pixel_mm=5.43764 / 1704)
    return _adjusted("dbat-camcal", camera, measured, free=FREE)


def sxb() -> Project:
    """Adjust `sxb`: five aerial images with weighted control and a known camera.

    Map coordinates are used as if they were Cartesian, as in the reference.
    """
    files = (("image_points_marked.txt", 0.5), ("image_points_tie.txt", 1.0))
    measured = _joined(
        tuple(
            read_marked_points(data.path(f"dbat-sxb/{file}"), sigma_px=sigma_px)
            for file, sigma_px in files
        )
    )
    camera = _camera_from_dbat(
        cc=123.9392, pp=(26.577, 38.811), size_px=(8858, 12996), pixel_mm=0.006
    )
    return _adjusted("dbat-sxb", camera, measured, free=())


def _adjusted(
    folder: str, camera: Camera, measured: Measurements, *, free: tuple[str, ...]
) -> Project:
    surveyed = _read_surveyed(data.path(f"{folder}/control_points.txt"))
    names = _read_images(data.path(f"{folder}/images.txt"))
    is_check = np.isin(surveyed.point, CHECK_POINTS)
    origin = surveyed.x.mean(axis=0).round(-2)
    block = _block(camera, measured, names, surveyed=surveyed, is_check=is_check, origin=origin)
    network = adjust.free_orientation(block, free=free)
    # DBAT corrects the points as they were measured
    adjusted = adjust.adjust(replace(network, distortion_at="measured"))
    return Project(
        bundle=adjusted,
        report=data.path(f"{folder}/reference_report.txt"),
        surveyed=surveyed,
        is_check=is_check,
        origin=origin,
        free=free,
    )


def _block(
    camera: Camera,
    measured: Measurements,
    names: tuple[str, ...],
    *,
    surveyed: Surveyed,
    is_check: np.ndarray,
    origin: Array,
) -> Block:
    """Return the block of measurements, control and resected images."""
    numbers, point_idx = np.unique(measured.point, return_inverse=True)
    surveyed_points = SurveyedPoints(
        point_idx=np.searchsorted(numbers, surveyed.point),
        x_m=surveyed.x - origin,
        sigma_m=surveyed.sigma,
    )
    n = len(names)
    unknown = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    block = Block(
        cameras=(camera,),
        images=Images(names=names),
        points=tuple(map(str, numbers)),
        image_points=ImagePoints(
            image_idx=measured.image - 1,
            point_idx=point_idx,
            colrow=measured.colrow,
            sigma_px=measured.sigma_px,
        ),
        control=surveyed_points[~is_check],
        check=surveyed_points[is_check],
        trajectory=Trajectory(exposures=names, T_m_b=unknown),
    )
    return resected(block)
