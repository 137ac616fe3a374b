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
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4lib.model import Model

# --- DBAT's two projects, adjusted; approximate values come from the measurements only


INTERIOR_NAMES = ("cc", "px", "py", "as", "K1", "K2", "K3", "P1", "P2")
"""DBAT's interior parameters, in the order of `interior_to_dbat`."""

_OURS = ("f", "xp", "yp", "b1", "k1", "k2", "k3", "p1", "p2")

HALF_PIXEL = 0.5
"""Our coordinates (0, 0) are the centre of a pixel, theirs are its corner."""

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
    point : ndarray, shape (n_surveyed,)
        Numbers of the control and check points.
    x, sigma : ndarray, shape (n_surveyed, 3)
        As given; sigma is zero where the file has none.
    is_check : ndarray of bool, shape (n_surveyed,)
    origin : ndarray, shape (3,)
        Subtracted from the coordinates before the adjustment.
    free : tuple of str
        Interior parameters that were estimated.
    """

    bundle: Bundle
    report: Path
    point: Array
    x: Array
    sigma: Array
    is_check: Mask
    origin: Array
    free: tuple[str, ...]


def camcal() -> Project:
    """Calibrate the camera of `camcal`: 21 images of a flat sheet, four points without error."""
    file = data.path("dbat-camcal/image_points.txt")
    measured = np.loadtxt(file, delimiter=",")  # image, point, x, y, sigma
    # the height of the format is given in mm
    camera = Camera(
        name="Camera1",
        width_px=2272,
        height_px=1704,
        pixel_mm=5.43764 / 1704,
        interior=Interior(f=7.3),
    )
    return _adjusted("dbat-camcal", camera, measured, free=FREE)


def sxb() -> Project:
    """Adjust `sxb`: five aerial images with weighted control and a known camera.

    Map coordinates are used as if they were Cartesian, as in the reference.
    """
    parts = []
    for file, sigma_px in (("image_points_marked.txt", 0.5), ("image_points_tie.txt", 1.0)):
        table = np.loadtxt(data.path(f"dbat-sxb/{file}"), delimiter=",")  # point, image, x, y
        sigma = np.full(len(table), sigma_px)
        parts.append(np.column_stack([table[:, 1], table[:, 0], table[:, 2:], sigma]))
    size_px, pixel_mm = (8858, 12996), 0.006
    xp, yp = (np.array([26.577, 38.811]) - 0.5 * pixel_mm * np.array(size_px)) * [1, -1]
    camera = Camera(
        name="Camera1",
        width_px=size_px[0],
        height_px=size_px[1],
        pixel_mm=pixel_mm,
        interior=Interior(f=123.9392, xp=float(xp), yp=float(yp)),
    )
    return _adjusted("dbat-sxb", camera, np.concatenate(parts), free=())


def _adjusted(folder: str, camera: Camera, measured: Array, *, free: tuple[str, ...]) -> Project:
    """Adjust measurements: image and point by DBAT's numbers, x, y from the corner, sigma, px."""
    surveyed = _rows(data.path(f"{folder}/control_points.txt"))
    point = surveyed.index.to_numpy()
    numbers = surveyed.iloc[:, 1:].to_numpy(dtype=float)
    x, sigma = numbers[:, :3], numbers[:, 3:] if numbers.shape[1] > 3 else np.zeros((len(point), 3))
    is_check = np.isin(point, CHECK_POINTS)
    origin = x.mean(axis=0).round(-2)
    names = tuple(_rows(data.path(f"{folder}/images.txt"))[1].str.rpartition("/")[2].str.strip())
    points, point_idx = np.unique(measured[:, 1].astype(int), return_inverse=True)
    control = SurveyedPoints(
        point_idx=np.searchsorted(points, point), x_m=x - origin, sigma_m=sigma
    )
    n = len(names)
    unknown = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    block = Block(
        cameras=(camera,),
        images=Images(names=names),
        points=tuple(map(str, points)),
        image_points=ImagePoints(
            image_idx=measured[:, 0].astype(np.intp) - 1,
            point_idx=point_idx,
            colrow=measured[:, 2:4] - HALF_PIXEL,
            sigma_px=measured[:, 4],
        ),
        control=control[~is_check],
        check=control[is_check],
        trajectory=Trajectory(exposures=names, T_m_b=unknown),
    )
    network = adjust.free_orientation(resected(block), Model(free=free))
    # DBAT corrects the points as they were measured
    bundle = adjust.adjust(replace(network, distortion_at="measured"))
    return Project(
        bundle=bundle,
        report=data.path(f"{folder}/reference_report.txt"),
        point=point,
        x=x,
        sigma=sigma,
        is_check=is_check,
        origin=origin,
        free=free,
    )


def _rows(path: Path) -> pd.DataFrame:
    """Return a comma-separated file by its first column, in the order of its numbers."""
    return pd.read_csv(path, comment="#", header=None, index_col=0).sort_index()


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
# its own label.


NUMBER = re.compile(r"(?<![\w.%])(?<!\^\()(?<!\^\(-)-?\d+(?:\.\d+)?(?:e[-+]\d+)?(?!\w|\.\w)")
"""A separate number: not the 3 of K3, the 4.13 of the label B4.13 or the power of a unit."""

_COUNTED = re.compile(r"^(\d+) (points with \d+ rays)\.$")
_RAYS = re.compile(r"^(\d+): (\d+\.\d+ \([\d ]*\))$")
_ROW = re.compile(r"^(\d+),")
_TABLES = ("Prior", "Posterior", "Diff", "Smallest angles")

Place = tuple[str, ...]
"""Headings of a line, the outermost first, then its own label."""


@dataclass(frozen=True, kw_only=True)
class Line:
    """What a line of a report states: its text after the label, and the numbers as printed."""

    text: str
    numbers: tuple[str, ...]


def read(path: Path) -> dict[Place, Line]:
    """Return the lines of a report by their place, in their order, without bare headings.

    Raises
    ------
    ValueError
        Where two lines have the same place.
    """
    lines: dict[Place, Line] = {}
    for place, text in _lines(path.read_text(encoding="utf-8")):
        if place in lines:
            msg = f"{path}: {' > '.join(place)} stands there twice"
            raise ValueError(msg)
        lines[place] = Line(text=" ".join(text.split()), numbers=tuple(NUMBER.findall(text)))
    headings = {place[:depth] for place in lines for depth in range(1, len(place))}
    return {place: line for place, line in lines.items() if line.text or place not in headings}


def _lines(text: str) -> Iterator[tuple[Place, str]]:
    headings: list[tuple[int, str]] = []
    for raw in text.splitlines()[1:-1]:
        content = raw.strip()
        depth = len(raw) - len(raw.lstrip())
        if content.startswith("id,"):
            continue
        if _ROW.match(content) or _RAYS.match(content):
            # the indentation of right-aligned numbers varies
            depth = next(d for d, name in reversed(headings) if name.startswith(_TABLES)) + 1
        while headings and headings[-1][0] >= depth:
            headings.pop()
        label, said = _split(content)
        yield (*(heading for _, heading in headings), label), said
        headings.append((depth, label))


def _split(content: str) -> tuple[str, str]:
    """Return a line's label and its statement."""
    if match := _COUNTED.match(content):
        return match[2], match[1]
    if match := _RAYS.match(content):
        return match[1], match[2]
    if _ROW.match(content):
        label, _, said = content.partition(",")
        return label, said
    if content.startswith("Redundancy "):  # this is the only label without a colon
        return "Redundancy", content.removeprefix("Redundancy")
    label, _, said = content.partition(":")
    return label.strip(), said.strip()


# --- a printed number beside one that is computed


COLUMNS = ("quantity", "kind", "printed", "ours", "difference", "unit", "units", "agrees")


class Angle(float):
    """An angle in degrees; full turns do not matter."""

    __slots__ = ()


Statements = dict[Place, tuple[float | int, ...] | str]
"""Our numbers for the places of a report, or our text where a line has none. An int is a count or
a name and must agree exactly; a float must agree to one unit of the last printed digit."""


def last_digit(printed: str) -> float:
    """Return the unit of the last digit of a printed number: 0.01 for ``-3.40``."""
    mantissa, _, exponent = printed.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(f"1e{int(exponent or 0) - decimals}")


def compare(printed: Mapping[Place, Line], ours: Statements) -> pd.DataFrame:
    """Compare all lines of a report with our numbers.

    Parameters
    ----------
    printed : mapping
        Lines of a report by their places, without headings and lines that are no results.
    ours : mapping

    Returns
    -------
    DataFrame
        One row per printed number, and one per line without numbers. `units` is the difference in
        units of the last printed digit. A place that exists on one side only, or with more or less
        numbers or another text, has a row that does not agree.
    """
    rows: list[tuple[object, ...]] = []
    for place in (*printed, *(place for place in ours if place not in printed)):
        rows += _rows_of_place(place, printed.get(place), ours.get(place))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _rows_of_place(
    place: Place, line: Line | None, values: tuple[float | int, ...] | str | None
) -> Iterator[tuple[object, ...]]:
    quantity = " > ".join(place)
    if line is not None and not line.numbers and values == line.text:
        yield quantity, "statement", line.text, np.nan, 0.0, np.nan, 0.0, True
    elif line is None or not isinstance(values, tuple) or len(values) != len(line.numbers):
        text = line.text if line else ""
        yield f"{quantity} [{values}]", _kind(place), text, *[np.nan] * 4, False
    else:
        for number, (text, value) in enumerate(zip(line.numbers, values, strict=True), 1):
            name = f"{quantity} ({number})" if len(values) > 1 else quantity
            yield name, _kind(place, number), *_row(text, value)


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
    (("Cameras",), "camera"),
    (("Residuals",), "residual statistic"),
    (("Total error",), "residual statistic"),
    (("Sigma0",), "residual statistic"),
    (("Point Precision",), "standard deviation"),
    (("measurements",), "object point"),
)
"""Words in the place of a quantity, and its kind; the first entry that fits is used."""


def _kind(path: Place, number: int = 1) -> str:
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
