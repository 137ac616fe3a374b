"""Match the pictures of a whole flight, and write the measured flight."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from acx4files.flight.block_from_tables import BLOCKS, BlockTables, read_block, without_points
from acx4files.flight.reader import Flight, checked, read, table_files
from acx4files.flight.toml_file import read_toml
from acx4files.measuring.levels import Matched, MeasureOptions, Tell, is_within_search, match_block
from acx4files.measuring.orientation import Coarse, oriented_by_features
from acx4files.measuring.oriented import firm, refined
from acx4files.measuring.targets import Measured, Surveyed, find_surveyed
from acx4files.measuring.views import (
    Surface,
    View,
    declared_views,
    level,
    seen_at,
    size_on_file,
)
from acx4files.results import whole_files
from acx4lib import expected, shown
from acx4lib.block import Block, select_images
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.expected import Array
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import Pose, rph_from_rotation

SETTINGS = "flight.toml"
"""The file that is written last: it makes the folder a flight, into which no command writes."""

R_NED_M = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""From the mapping frame to north, east, down."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """The measurements of a block.

    Attributes
    ----------
    block : str
    matched : Matched
        Tie points.
    surveyed : Surveyed
        Control and check points.
    sentences : tuple of str
        Messages for the user on pictures, tie points and surveyed points.
    """

    block: str
    matched: Matched
    surveyed: Surveyed
    sentences: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Unmeasured:
    """A flight whose blocks may lack image points.

    Attributes
    ----------
    flight : Flight
        Its blocks have the measurements that are there.
    tables : dict of str to BlockTables
        Of every block.
    """

    flight: Flight
    tables: dict[str, BlockTables]


def measure_flight(
    path: str | Path,
    folder: str | Path,
    *,
    options: MeasureOptions = MeasureOptions(),  # noqa: B008 frozen
    executor: Executor | None = None,
    tell: Tell = lambda *_: None,
) -> list[Outcome]:
    """Measure the pictures of a flight, and write the measured flight.

    Parameters
    ----------
    path : str or Path
        A flight; `image_points.csv` and `control_points.csv` may be missing or empty.
    folder : str or Path
        New or empty.
    options : MeasureOptions
    executor : Executor, optional
        Where pairs of pictures are matched; by default here.
    tell : callable
        Called with the name of a level, its finished pairs, and all.

    Raises
    ------
    FlightError
        Where the flight cannot be read or measured.
    AdjustmentError
        Where the points of a block cannot be adjusted.
    OutputError
        Where the folder must not be used.
    """
    unmeasured = read_unmeasured(path)
    flight = unmeasured.flight
    with whole_files.claim(folder, signs=[]):
        outcomes: dict[str, Outcome] = {}
        points: dict[str, list[Measured]] = {}
        for name in flight.blocks:
            points[name] = _given(unmeasured.tables[name], flight.apriori.image_point_px)
            if any(flight.image_files[name]):
                twin = _measured_before(unmeasured, name, outcomes)
                outcomes[name] = twin or _measured(
                    unmeasured, name, points[name], options, executor, tell
                )
                points[name] += outcomes[name].surveyed.rows
                taken = {row.point for row in points[name]}
                taken |= {*unmeasured.tables[name].control.text["point"]}
                points[name] += _tie_rows(outcomes[name].matched, taken)
        _write(unmeasured, Path(folder), points)
    read(folder)
    return [*outcomes.values()]


def read_unmeasured(path: str | Path) -> Unmeasured:
    """Return the flight in a folder, with the measurements that it already has.

    Parameters
    ----------
    path : str or Path
        Folder with a flight.toml. `image_points.csv` and `control_points.csv` may be missing.

    Raises
    ------
    FlightError
        With all problems, one line each; also where a block has neither pictures nor
        measurements, and where no block has pictures.
    """
    folder = expected.folder(path, "the folder of a flight, with a flight.toml")
    names = [name for name in BLOCKS if (folder / name).is_dir()]
    if not names:
        blocks = ", ".join(f"{name}/" for name in BLOCKS)
        raise FlightError([f"{folder}: no block to measure; a flight has {blocks}"])
    tables = {name: without_points(read_block(folder, name, pictures=folder)) for name in names}
    flight = checked(read_toml(folder / SETTINGS), list(tables.values()))
    pictured = [name for name in names if any(flight.image_files[name])]
    empty = [
        f"{folder / name / 'images.csv'}: column file: names no picture; "
        "give it the file of every image, relative to the block's folder"
        for name, table in tables.items()
        if name not in pictured and not (pictured and len(table.image_points))
    ]
    if empty:
        raise FlightError(empty)
    return Unmeasured(flight=flight, tables=tables)


def views_of(flight: Flight, block: Block, files: Sequence[Path]) -> list[View]:
    """Return the pictures of a block with their approximate orientations, at their files' size.

    Parameters
    ----------
    flight : Flight
    block : Block
        With one image for each file.
    files : sequence of Path
    """
    inside = flight.pictures.resolve()
    named = [flight.pictures / path.relative_to(inside) for path in files]
    views = declared_views(block, named)
    return [seen_at(view, size_on_file(view.path, view.declared)) for view in views]


# --- a block ---------------------------------------------------------------------------------


def _measured_before(
    unmeasured: Unmeasured, name: str, before: dict[str, Outcome]
) -> Outcome | None:
    """Return the outcome of an earlier block with the same pictures, trajectory and control."""

    def input_of(block: str) -> tuple[object, ...]:
        tables = unmeasured.tables[block]
        files = [path and path.name for path in unmeasured.flight.image_files[block]]
        texts = (tables.images.text, tables.trajectory.text, tables.control.text)
        return files, texts, len(tables.image_points)

    alike = (outcome for block, outcome in before.items() if input_of(block) == input_of(name))
    outcome = next(alike, None)
    if outcome is None or len(unmeasured.tables[name].image_points):
        return None
    return replace(outcome, block=name)


def _measured(
    unmeasured: Unmeasured,
    name: str,
    given: Sequence[Measured],
    options: MeasureOptions,
    executor: Executor | None,
    tell: Tell,
) -> Outcome:
    """Measure one block."""
    flight = unmeasured.flight
    files = flight.image_files[name]
    block = select_images(flight.block(name), np.array([path is not None for path in files]))
    views = views_of(flight, block, [path for path in files if path is not None])
    control = unmeasured.tables[name].control
    grid = [control.numbers[key] for key in ("east_m", "north_m", "height_m")]
    x_m = block.frame.from_grid(np.column_stack(grid))
    matched, coarse = _matched(block, views, _ground(block, x_m, options), options, executor, tell)
    sentences = [*_on_trajectory(block, matched.views, coarse.apart)] if coarse else []
    sentences += _on_ties(name, matched, options.reduce)
    if len(control):
        with suppress(AdjustmentError):
            placed = refined(_held(block, coarse), matched.views, matched.rays)
            matched = replace(matched, views=placed.views, surface=placed.surface)
    surveyed = find_surveyed(matched.views, matched.surface, control.text["point"], x_m, given)
    sentences += _on_surveyed(name, surveyed)
    return Outcome(block=name, matched=matched, surveyed=surveyed, sentences=tuple(sentences))


def _ground(block: Block, control_m: Array, options: MeasureOptions) -> Surface | None:
    """Return a first, level ground: as given, or the median of the surveyed points, if any."""
    if options.ground_m is not None:
        below = block.frame.to_grid(np.mean(block.trajectory.T_m_b.r, axis=0)[None])
        below[0, 2] = options.ground_m
        return level(float(block.frame.from_grid(below)[0, 2]))
    return level(float(np.median(control_m[:, 2]))) if len(control_m) else None


def _matched(
    block: Block,
    views: Sequence[View],
    surface: Surface | None,
    options: MeasureOptions,
    executor: Executor | None,
    tell: Tell,
) -> tuple[Matched, Coarse | None]:
    """Match a block from its trajectory's orientations; where they are too coarse, by features."""
    run = partial(match_block, options=options, executor=executor, tell=tell)
    if surface and is_within_search(block, views, surface, options.reduce):
        with suppress(FlightError, AdjustmentError):
            return run(block, views, surface), None
    count = partial(tell, f"{block.name} features")
    coarse = oriented_by_features(block, views, executor=executor, tell=count)
    return run(coarse.block, coarse.views, coarse.surface, faint=True), coarse


def _held(block: Block, coarse: Coarse | None) -> Block:
    """Return the block held by its positions, and by its attitudes unless features gave them."""
    if coarse is None:
        return firm(block)
    found, given = coarse.block.trajectory, block.trajectory
    T_m_b = Pose(R=found.T_m_b.R, r=given.T_m_b.r)
    held = replace(found, T_m_b=T_m_b, sigma_position=given.sigma_position)
    return firm(replace(coarse.block, trajectory=held))


# --- what is said ----------------------------------------------------------------------------


def _on_trajectory(block: Block, views: Sequence[View], apart: Sequence[str]) -> Iterator[str]:
    """Yield sentences on pictures left out and on the attitudes by strip, or else by course."""
    if apart:
        yield (
            f"{block.name}: {len(apart)} pictures are not connected with the others and were "
            f"not measured: {', '.join(apart[:5])}{' …' if len(apart) > 5 else ''}"
        )
    image_idx = [block.images.names.index(view.name) for view in views]
    exposure, first = np.unique(block.images.exposure_idx[image_idx], return_index=True)
    R_c_b = np.swapaxes(mountings(block.cameras).R, 1, 2)[block.images.camera_idx[image_idx]]
    R_m_b = (np.array([view.T_m_c.R[0] for view in views]) @ R_c_b)[first]
    by_pictures = np.degrees(rph_from_rotation(R_NED_M @ R_m_b))
    by_trajectory = np.degrees(rph_from_rotation(R_NED_M @ block.trajectory.T_m_b.R[exposure]))
    off = (by_trajectory - by_pictures + 180) % 360 - 180
    strips = np.array(block.images.strips)[image_idx][first]
    courses = [f"heading {heading:.0f}°" for heading in np.round(by_pictures[:, 2] / 45) * 45 % 360]
    group = np.where(strips == "", courses, np.char.add("strip ", strips))
    for name in np.unique(group):
        rows = off[group == name]
        mean = ", ".join(f"{value:+.1f}" for value in rows.mean(axis=0))
        yield (
            f"{block.name}: {name}, {shown.count(len(rows), 'exposure')}: the trajectory's roll, "
            f"pitch, heading are off by {mean}° on average"
        )


def _on_ties(name: str, matched: Matched, reduce: int) -> Iterator[str]:
    """Yield sentences on the tie points of a block."""
    n, rays = len(np.unique(matched.rays.point)), len(matched.rays)
    yield (
        f"{name}: {n} tie points with {rays} measurements in {len(matched.views)} pictures, "
        f"{rays / max(n, 1):.1f} rays a point; {matched.n_rejected} measurements rejected"
    )
    if matched.reduced > reduce:
        yield f"{name}: measured at 1/{matched.reduced} of their size; larger they hold no more"
    each = np.bincount(matched.rays.view, minlength=len(matched.views))
    few = [view.name for view, k in zip(matched.views, each, strict=True) if k < 12]
    if few:
        yield f"{name}: fewer than 12 points in {', '.join(few[:5])}{' …' if len(few) > 5 else ''}"


def _on_surveyed(name: str, surveyed: Surveyed) -> Iterator[str]:
    """Yield sentences on the surveyed points of a block."""
    points = {row.point for row in surveyed.rows}
    if points:
        n = len(surveyed.rows)
        yield f"{name}: {len(points)} surveyed points found, with {n} measurements"
    for point, images in surveyed.not_found.items():
        more = f" and {len(images) - 5} more" if len(images) > 5 else ""
        yield f"{name}: point {point} not found in {', '.join(images[:5])}{more}"


# --- the measured flight ---------------------------------------------------------------------


def _given(tables: BlockTables, sigma_px: float) -> list[Measured]:
    """Return the measurements that a block has already."""
    table = tables.image_points
    sigma = table.numbers.get("sigma_px", np.full(len(table), sigma_px))
    columns = (*(table.text[name] for name in ("image", "point")), table.numbers["col_px"])
    rows = zip(*columns, table.numbers["row_px"], sigma, strict=True)
    return [
        Measured(image=image, point=point, col_px=float(c), row_px=float(r), sigma_px=float(s))
        for image, point, c, r, s in rows
    ]


def _tie_rows(matched: Matched, taken: set[str]) -> Iterator[Measured]:
    """Yield the measurements of tie points, under names that nothing else has."""
    rays = matched.rays
    names = (name for k in range(1, 10**9) if (name := f"T{k:05d}") not in taken)
    name_of = {point: next(names) for point in dict.fromkeys(rays.point.tolist())}
    for point, v, colrow, sigma in zip(
        rays.point.tolist(), rays.view.tolist(), rays.colrow, rays.sigma_px, strict=True
    ):
        view = matched.views[v]
        col, row = view.full(colrow[None])[0]
        yield Measured(
            image=view.name,
            point=name_of[point],
            col_px=float(col),
            row_px=float(row),
            sigma_px=float(sigma) * view.shrink,
        )


def _write(unmeasured: Unmeasured, folder: Path, points: dict[str, list[Measured]]) -> None:
    """Write a measured flight: its tables, its pictures, which are linked, and its settings last.

    Images without a picture and without measurements are left out.
    """
    flight = unmeasured.flight
    names = [name.as_posix() for name in table_files(flight)]
    contents = {name: (flight.path / name).read_bytes() for name in names if name != SETTINGS}
    own_control = [f"{block}/control_points.csv" in names for block in flight.blocks]
    if "control_points.csv" not in names and not all(own_control):
        contents["control_points.csv"] = b"point,east_m,north_m,height_m\n"
    inside = flight.pictures.resolve()
    for block, rows in points.items():
        files = flight.image_files[block]
        table = pd.DataFrame([vars(row) for row in rows], columns=[*Measured.__annotations__])
        contents[f"{block}/image_points.csv"] = _csv(table, float_format="%.4f")
        images = pd.read_csv(
            flight.path / block / "images.csv",
            dtype=str,
            keep_default_na=False,
            encoding="utf-8-sig",
        )
        named = [name.strip() for name in images.columns].index("image")
        used = images.iloc[:, named].str.strip().isin(table["image"])
        pictured = [path is not None for path in files]
        contents[f"{block}/images.csv"] = _csv(images[used | np.array(pictured)])
        for path in filter(None, files):
            target = folder / path.relative_to(inside)
            target.parent.mkdir(parents=True, exist_ok=True)
            whole_files.link(path, target)
    for name, content in contents.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        whole_files.write(folder / name, content)
    whole_files.copy(flight.path / SETTINGS, folder / SETTINGS)


def _csv(table: pd.DataFrame, float_format: str | None = None) -> bytes:
    return table.to_csv(index=False, float_format=float_format, lineterminator="\n").encode()
