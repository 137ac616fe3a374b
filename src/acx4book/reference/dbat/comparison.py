"""Comparison of printed numbers with ours, in units of the last printed digit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.reference import data
from acx4book.reference.dbat import files as dbat_files
from acx4book.reference.dbat.files import Line, Measurements, Surveyed
from acx4lib.bundle import adjust, uses
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.start import resected
from acx4lib.expected import Array
from acx4lib.flight.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose

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
        rows += _rows(path, printed.get(path), ours.get(path))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _rows(
    path: tuple[str, ...], line: Line | None, statement: Statement | None
) -> list[tuple[object, ...]]:
    quantity, kind = " > ".join(path), _kind(path)
    if line is None or statement is None or line.statement != statement.text:
        text = line.statement.format(*line.numbers) if line else ""
        said = statement.text if statement else "nothing"
        return [(f"{quantity} [{said}]", kind, text, *[np.nan] * 4, False)]
    if not line.numbers:
        return [(quantity, "statement", line.statement, np.nan, 0.0, np.nan, 0.0, True)]
    out: list[tuple[object, ...]] = []
    many = len(line.numbers) > 1
    for number, (text, value) in enumerate(zip(line.numbers, statement.values, strict=True), 1):
        name = f"{quantity} ({number})" if many else quantity
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
"""Of a difference in units of the last printed digit; further ones change with any rounding."""

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
    measured = dbat_files.read_image_points(data.path("dbat-camcal/image_points.txt"))
    # the height of the format is given in mm
    camera = dbat_files.camera_from_dbat(
        cc=7.3, pp=None, size_px=(2272, 1704), pixel_mm=5.43764 / 1704
    )
    return _adjusted("dbat-camcal", camera, measured, free=FREE)


def sxb() -> Project:
    """Adjust `sxb`: five aerial images with weighted control and a known camera.

    Map coordinates are used as if they were Cartesian, as in the reference.
    """
    files = (("image_points_marked.txt", 0.5), ("image_points_tie.txt", 1.0))
    measured = dbat_files.joined(
        tuple(
            dbat_files.read_marked_points(data.path(f"dbat-sxb/{file}"), sigma_px=sigma_px)
            for file, sigma_px in files
        )
    )
    camera = dbat_files.camera_from_dbat(
        cc=123.9392, pp=(26.577, 38.811), size_px=(8858, 12996), pixel_mm=0.006
    )
    return _adjusted("dbat-sxb", camera, measured, free=())


def _adjusted(
    folder: str, camera: Camera, measured: Measurements, *, free: tuple[str, ...]
) -> Project:
    surveyed = dbat_files.read_surveyed(data.path(f"{folder}/control_points.txt"))
    names = dbat_files.read_images(data.path(f"{folder}/images.txt"))
    is_check = np.isin(surveyed.point, CHECK_POINTS)
    origin = surveyed.x.mean(axis=0).round(-2)
    block = _block(camera, measured, names, surveyed=surveyed, is_check=is_check, origin=origin)
    network = uses.free_orientation(block, free=free)
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
    given = SurveyedPoints(
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
        control=given[~is_check],
        check=given[is_check],
        trajectory=Trajectory(exposures=names, T_m_b=unknown),
    )
    return resected(block)
