"""The tables of a block, and the arrays in the mapping frame made from them."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import repeat
from pathlib import Path

import numpy as np

from acx4files.conventions import lonlat_of, poses
from acx4files.flight.problems import ABSENT, NO_ROWS, RANGES, Problem
from acx4files.flight.settings import Setup
from acx4files.flight.table_files import read_columns
from acx4files.flight.tables import SCHEMAS, SIGMA_ATTITUDE, SIGMA_POSITION, Table
from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.geodesy import MappingFrame, mean_origin
from acx4lib.least_squares.covariance import GaussMarkov

BLOCKS = ("heads", "calibration", "validation")
TABLES = ("images", "image_points", "trajectory")
SIGMA_CONTROL = (0.01, 0.01, 0.02)
"""East, north, height, m, of control points without sigma of their own."""


NOWHERE = (0.0, 0.0, 1e6)
"""Position in the mapping frame, m, for a surveyed point that the CRS does not cover. No camera
looks so far up, so the point is rejected as a gross error."""


@dataclass(frozen=True, eq=False)
class BlockTables:
    """The tables of a block, and the folder of the flight with its pictures."""

    name: str
    pictures: Path
    images: Table
    image_points: Table
    trajectory: Table
    control: Table

    @property
    def tables(self) -> tuple[Table, ...]:
        """All tables of the block."""
        return (self.images, self.image_points, self.trajectory, self.control)

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Problems of all tables; heads with a picture each need no measurement."""
        files = self.images.text.get("file", ())
        pictured = bool(files) and all(files)
        found, cure = [], "acx4 measure finds points in its pictures"
        for table in self.tables:
            for problem in table.problems:
                if not (pictured and table is self.image_points and problem.found == NO_ROWS):
                    found.append(problem)
                elif self.name != "heads":
                    found.append(replace(problem, expected=f"{problem.expected}; {cure}"))
        return tuple(found)

    @cached_property
    def rays(self) -> Counter[str]:
        """Number of measurements of every point, in the order of first occurrence."""
        return Counter(self.image_points.text["point"])


def read_block(folder: Path, name: str, *, pictures: Path) -> BlockTables:
    """Read the tables of a block; their `problems` list the errors.

    Parameters
    ----------
    folder : Path
        Folder of the flight.
    name : str
        Name of the block and of its folder.
    pictures : Path
        Folder of the flight with its pictures.
    """
    own = folder / name / "control_points.csv"
    control = own if os.path.lexists(own) else folder / "control_points.csv"
    needs = {control: f"block {name} without its own"}
    paths = (*(folder / name / f"{table}.csv" for table in TABLES), control)
    tables = (
        read_columns(p, str(p), SCHEMAS[p.name], needed_by=needs.get(p, f"block {name}"))
        for p in paths
    )
    return BlockTables(name, pictures, *tables)


def without_points(tables: BlockTables) -> BlockTables:
    """Return the tables of a block that needs no measurements and no control points.

    Empty tables replace missing image points and control points.
    """
    lacks = {ABSENT, NO_ROWS, "is empty"}
    if not {problem.found for problem in tables.image_points.problems}.isdisjoint(lacks):
        tables = replace(tables, image_points=_without_rows(tables.image_points, "image_points"))
    if ABSENT in {problem.found for problem in tables.control.problems}:
        tables = replace(tables, control=_without_rows(tables.control, "control_points"))
    return tables


def _without_rows(table: Table, name: str) -> Table:
    required = SCHEMAS[f"{name}.csv"].required
    return Table(
        file=table.file,
        text={column: () for column in required if column not in RANGES},
        numbers={column: np.zeros(0) for column in required if column in RANGES},
    )


def index_of(names: Iterable[str], known: Sequence[str]) -> Index:
    """Return the indices of names among known ones, -1 for an unknown name."""
    index = {name: i for i, name in enumerate(known)}
    return np.fromiter(map(index.get, names, repeat(-1)), dtype=np.intp)


def used_exposures(tables: BlockTables) -> Mask:
    """Tell which rows of the trajectory have an image, shape (n_rows,)."""
    used = set(tables.images.text["exposure"])
    return np.array([name in used for name in tables.trajectory.text["exposure"]], dtype=bool)


def measured_control(tables: BlockTables) -> Mask:
    """Tell which control points are measured in the block, shape (n_rows,)."""
    return np.array([name in tables.rays for name in tables.control.text["point"]], dtype=bool)


def assemble(tables: BlockTables, setup: Setup) -> Block:
    """Assemble the block from tables without problems.

    Returns
    -------
    Block
        In its own mapping frame, without trajectory rows that have no image and without control
        points that are not measured.
    """
    used = used_exposures(tables)
    frame = mean_origin(setup.grid, lonlat_of(tables.trajectory.numbers, setup.grid)[used])
    trajectory = _trajectory(tables.trajectory, used, frame, setup)
    points = tuple(tables.rays)
    surveyed, is_check = _surveyed(tables, points, frame)
    present = set(tables.images.text["camera"])
    cameras = tuple(camera for name, camera in setup.cameras.items() if name in present)
    return Block(
        name=tables.name,
        frame=frame,
        cameras=cameras,
        images=_images(tables.images, [camera.name for camera in cameras], trajectory.exposures),
        points=points,
        image_points=_image_points(tables, points, setup),
        control=surveyed[~is_check],
        check=surveyed[is_check],
        trajectory=trajectory,
        smallest_angle=setup.smallest_angle,
    )


def _images(table: Table, cameras: Sequence[str], exposures: Sequence[str]) -> Images:
    return Images(
        names=tuple(table.text["image"]),
        camera_idx=index_of(table.text["camera"], cameras),
        exposure_idx=index_of(table.text["exposure"], exposures),
        strips=tuple(table.text.get("strip", ("",) * len(table))),
    )


def _image_points(tables: BlockTables, points: Sequence[str], setup: Setup) -> ImagePoints:
    table = tables.image_points
    return ImagePoints(
        image_idx=index_of(table.text["image"], tables.images.text["image"]),
        point_idx=index_of(table.text["point"], points),
        colrow=table.stack("col_px", "row_px"),
        sigma_px=_sigma(table, ["sigma_px"], [setup.apriori.image_point_px])[:, 0],
    )


def _sigma(table: Table, columns: Sequence[str], default: Sequence[float]) -> Array:
    """Return standard deviations from the table; defaults for missing columns."""
    sigma = [
        table.numbers.get(column, np.full(len(table), value))
        for column, value in zip(columns, default, strict=True)
    ]
    return np.stack(sigma, axis=-1)


def _trajectory(table: Table, used: Mask, frame: MappingFrame, setup: Setup) -> Trajectory:
    apriori = setup.apriori
    gnss = (apriori.gnss_horizontal_m, apriori.gnss_horizontal_m, apriori.gnss_vertical_m)
    ins = (apriori.roll_pitch_deg, apriori.roll_pitch_deg, apriori.heading_deg)
    T_m_b = poses(table.select(used).numbers, frame)
    return Trajectory(
        exposures=tuple(np.array(table.text["exposure"], dtype=object)[used]),
        T_m_b=T_m_b,
        R_g_m=frame.grid_axes(T_m_b.r),
        sigma_position=_sigma(table, SIGMA_POSITION, gnss)[used],
        sigma_attitude=np.radians(_sigma(table, SIGMA_ATTITUDE, ins)[used]),
        time_s=table.numbers.get("time_s", np.full(len(table), np.nan))[used],
        slow_positions=GaussMarkov(
            share=apriori.gnss_correlated_share, time_constant_s=apriori.gnss_correlation_s
        ),
        slow_attitudes=GaussMarkov(
            share=apriori.attitude_correlated_share, time_constant_s=apriori.attitude_correlation_s
        ),
    )


def _surveyed(
    tables: BlockTables, points: Sequence[str], frame: MappingFrame
) -> tuple[SurveyedPoints, Mask]:
    """Return the measured surveyed points, and the mask of the check points."""
    table, measured = tables.control, measured_control(tables)
    x_m = frame.from_grid(table.stack("east_m", "north_m", "height_m")[measured])
    x_m[~np.isfinite(x_m).all(axis=1)] = NOWHERE
    role = np.array(table.text.get("role", ("control",) * len(table)), dtype=object)[measured]
    surveyed = SurveyedPoints(
        point_idx=index_of(np.array(table.text["point"], dtype=object)[measured], points),
        x_m=x_m,
        R_g_m=frame.grid_axes(x_m),
        sigma_m=_sigma(table, SIGMA_POSITION, SIGMA_CONTROL)[measured],
    )
    is_check = (role == "check") if tables.name != "validation" else np.ones(len(role), dtype=bool)
    return surveyed, is_check
