"""Read a flight: the flight itself, or a list of all its problems.

Contradictions between the tables of a block and flight.toml are refused; oddities become notes.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path, PurePosixPath
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj

from acx4files.flight.block_from_tables import (
    BLOCKS,
    TABLES,
    BlockTables,
    assemble,
    index_of,
    lonlat_of,
    measured_control,
    read_block,
    used_exposures,
)
from acx4files.flight.problems import (
    SHOWN,
    Problem,
    counted,
    did_you_mean,
    lines_of,
    quoted,
    same_but_for_writing,
)
from acx4files.flight.readings import FOOT, fit_problems, misfit
from acx4files.flight.settings import KNOWN, Setup, flight_table, setup_of
from acx4files.flight.table_files import Columns, named_file, table_in_memory
from acx4files.flight.tables import SCHEMAS, Table
from acx4files.flight.toml_file import Toml, read_toml
from acx4lib import expected, shown
from acx4lib.block import Block, block_row, synthetic_images
from acx4lib.design import SAME_HEIGHT, flying_heights
from acx4lib.errors import FlightError, visible
from acx4lib.expected import Array, given
from acx4lib.geometry.camera import INTERIOR, Camera, inside
from acx4lib.geometry.collinearity import refraction_taken_up
from acx4lib.geometry.geodesy import LOCAL, GridSystem
from acx4lib.geometry.parameters import DELAYS
from acx4lib.least_squares.covariance import medians

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight(Setup):
    """A flight, read and found consistent.

    Attributes
    ----------
    path : Path
        Its folder; `PLACE` for a flight from tables in memory.
    pictures : Path
        Folder with its pictures: the same as `path`, unless the flight is a copy kept by a run.
    sha256 : dict of str to str
        Checksum of every table that was read, by its path below the folder.
    blocks : dict of str to Block
        The blocks that exist: heads, calibration, validation.
    trajectories : dict of str to Table
        For every block, its trajectory as the file has it.
    image_files : dict of str to tuple of Path or None
        For every block, the image file of every image, None without one.
    notes : tuple of str
        Strange but allowed values, one sentence each.
    """

    path: Path
    pictures: Path
    sha256: dict[str, str]
    blocks: dict[str, Block]
    trajectories: dict[str, Table]
    image_files: dict[str, tuple[Path | None, ...]]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Summarize the flight in one line."""
        blocks = [
            f"{name} {shown.count(len(block.images), 'image')}"
            for name, block in self.blocks.items()
        ]
        cameras = shown.count(len(self.cameras), "camera")
        return shown.line(f"Flight {self.name!r}", cameras, *blocks)

    def table(self) -> pd.DataFrame:
        """Return the counts of every block, one row per block."""
        rows = {name: block_row(block) for name, block in self.blocks.items()}
        return shown.row_table("block", rows)

    def block(self, name: str) -> Block:
        """Return a block by its name; FlightError if the flight has no such block."""
        if name not in self.blocks:
            raise FlightError([f"{self.path}: the flight has no block {name}"])
        return self.blocks[name]

    @property
    def heads(self) -> Block | None:
        """Block 1, the images of the camera heads; None without this block."""
        return self.blocks.get("heads")

    @property
    def calibration(self) -> Block | None:
        """Block 2, synthetic or single-head images; None without this block."""
        return self.blocks.get("calibration")

    @property
    def validation(self) -> Block | None:
        """Block 3, the independent one; None without this block."""
        return self.blocks.get("validation")

    @property
    def head_names(self) -> tuple[str, ...]:
        """Names of the heads in block heads, ordered as in [synthetic]; without it, all cameras."""
        present = tuple(camera.name for camera in self.blocks["heads"].cameras)
        named = self.synthetic.heads if self.synthetic else present
        return tuple(name for name in named if name in present)

    @property
    def transferred(self) -> tuple[str, ...]:
        """Blocks measured in head images and transferred into the synthetic image."""
        here = [name for name in ("calibration", "validation") if name in self.blocks]
        return tuple(here) if self.measured_in_heads else ()

    def mounted(self, name: str) -> Block:
        """Return a block as its mounted camera exposed it.

        For a block in `transferred` these are its synthetic images, without measurements.
        """
        synthetic = self.synthetic_camera
        if name not in self.transferred or synthetic is None:
            return self.block(name)
        return synthetic_images(self.block(name), synthetic)

    @property
    def synthetic_camera(self) -> Camera | None:
        """Camera of the synthetic image; None where flight.toml has no table [synthetic]."""
        return self.cameras[self.synthetic.camera] if self.synthetic else None


def read(path: str | Path, *, pictures: str | Path = "") -> Flight:
    """Read the flight in a folder and check it.

    Parameters
    ----------
    path : str or Path
        Folder with a flight.toml.
    pictures : str or Path
        The flight's own folder, if `path` is a copy of its tables kept by a run.

    Raises
    ------
    FlightError
        With all problems, one line each; files are named below `path` as it was given.
    """
    folder = expected.path("path", path)
    if not _is_folder(folder):
        raise FlightError(lines_of([_no_folder(folder)]))
    try:
        return _read(folder, Path(pictures or path))
    except MemoryError:
        raise FlightError(lines_of([_too_large(folder)])) from None


def _read(folder: Path, pictures: Path) -> Flight:
    toml = read_toml(folder / "flight.toml")
    blocks = _read_blocks(folder, pictures)
    others = [] if blocks else [_no_block(folder)]
    others += [_no_block_folder(folder / name) for name in BLOCKS if _is_other(folder / name)]
    notes = [f"{path} is in no block and is not read" for path in _strays(folder)]
    return checked(toml, blocks, problems=others, notes=notes)


def checked(
    toml: Toml,
    blocks: Sequence[BlockTables],
    *,
    problems: Sequence[Problem] = (),
    notes: Sequence[str] = (),
) -> Flight:
    """Build a flight from settings and tables; FlightError with all their problems.

    Parameters
    ----------
    toml : Toml
    blocks : sequence of BlockTables
    problems, notes : sequence
        Further problems and notes, beside the tables' own.
    """
    all_problems = [*_toml_problems(toml)]
    setup = None if all_problems else setup_of(toml)
    all_problems += problems
    for tables in blocks:
        all_problems += _block_problems(tables, toml, setup)
    if setup is not None and not all_problems:
        all_problems = [*_uncalibrated_problems(blocks, setup)]
    if all_problems or setup is None:
        raise FlightError(lines_of(all_problems))
    block_notes = [note for tables in blocks for note in _notes(tables)]
    return _flight(toml, setup, blocks, [*notes, *block_notes])


def _toml_problems(toml: Toml) -> Iterator[Problem]:
    """Yield the problems of flight.toml; if it could not be read, only the reason."""
    yield from toml.problems or flight_table(toml).problems(toml)


def read_kept(path: str | Path) -> Flight:
    """Read a flight from tables kept by a run.

    Heights and the fit to control points are not checked again: the first reading, perhaps by an
    earlier version, did this.

    Parameters
    ----------
    path : str or Path
        Folder with a flight.toml; image files are not needed.

    Raises
    ------
    FlightError
        Where tables are wrong, or do not belong together.
    """
    folder = Path(path)
    toml = read_toml(folder / "flight.toml")
    blocks = _read_blocks(folder, folder)
    problems = [*_toml_problems(toml), *([] if blocks else [_no_block(folder)])]
    for tables in blocks:
        problems += [*tables.problems, *_name_problems(tables, toml)]
    if problems:
        raise FlightError(lines_of(problems))
    setup = setup_of(toml)
    problems = [
        problem
        for tables in blocks
        for problem in (*_sensor_problems(tables, setup), *_position_problems(tables, setup.grid))
    ]
    if problems:
        raise FlightError(lines_of(problems))
    notes = [note for tables in blocks for note in _notes(tables)]
    return _flight(toml, setup, blocks, notes)


def table_files(flight: Flight) -> list[Path]:
    """Return the files from which a flight was read, except images, relative to its folder."""
    tables = [f"{name}.csv" for name in (*TABLES, "control_points", "distances")]
    names = [Path("flight.toml"), Path("control_points.csv")]
    names += [Path(block) / name for block in flight.blocks for name in tables]
    geoid, inside = Path(str(flight.grid.heights)), flight.path.resolve()
    if geoid.is_relative_to(inside):
        names.append(geoid.relative_to(inside))
    return [name for name in names if (flight.path / name).is_file()]


def _read_blocks(folder: Path, pictures: Path) -> list[BlockTables]:
    return [read_block(folder, n, pictures=pictures) for n in BLOCKS if _is_folder(folder / n)]


def _flight(
    toml: Toml, setup: Setup, blocks: Sequence[BlockTables], notes: Iterable[str]
) -> Flight:
    """Build the flight from blocks without problems."""
    assembled = {tables.name: assemble(tables, setup) for tables in blocks}
    held = _unobserved_parts(assembled.get("calibration"))
    setup = replace(setup, fix=tuple(dict.fromkeys((*setup.fix, *held))))
    notes = [*notes, *_vertical_notes(setup.grid), *area_notes(setup.grid, assembled)]
    notes += [note for block in assembled.values() for note in _datum_notes(block)]
    notes += _held_notes(setup)
    for tables in blocks:
        notes += _control_notes(tables, assembled[tables.name])
    if not (setup.simulated or setup.grid.is_local or "refraction" in toml.table()):
        notes += _refraction_notes(setup, assembled)
    files = {table.file: table.sha256 for tables in blocks for table in tables.tables}
    files[toml.file] = toml.sha256
    return Flight(
        **{f.name: getattr(setup, f.name) for f in fields(setup)},
        path=toml.folder,
        pictures=blocks[0].pictures if blocks else toml.folder,
        sha256={Path(f).relative_to(toml.folder).as_posix(): files[f] for f in files},
        blocks=assembled,
        trajectories={tables.name: tables.trajectory for tables in blocks},
        image_files={tables.name: _image_files(tables) for tables in blocks},
        notes=tuple(dict.fromkeys(map(visible, notes))),
    )


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # a name that no file can have
        return False


def _no_folder(folder: Path) -> Problem:
    expected = "must be the folder of a flight, with a flight.toml"
    return Problem(
        file=str(folder), line=1, column="folder", found="is no folder", expected=expected
    )


def _too_large(folder: Path) -> Problem:
    fault, expected = "reading it takes more memory than there is", "must fit into free memory"
    return Problem(file=str(folder), line=1, column="folder", found=fault, expected=expected)


def _is_other(path: Path) -> bool:
    """Tell whether a path with the name of a block exists and is no folder."""
    return os.path.lexists(path) and not _is_folder(path)


def _no_block_folder(path: Path) -> Problem:
    expected = "must be the folder of a block"
    return Problem(file=str(path), line=1, column="folder", found="is no folder", expected=expected)


def _no_block(folder: Path) -> Problem:
    expected = f"needs at least one of the folders {', '.join(f'{name}/' for name in BLOCKS)}"
    stray = "".join(f" ({path} is in none)" for path in _strays(folder))
    fault = f"no block at all{stray}"
    return Problem(file=str(folder), line=1, column="folder", found=fault, expected=expected)


def _strays(folder: Path) -> list[str]:
    """Return the tables of images outside all blocks: a block's folder may be misspelt."""
    paths = [*folder.glob("images.csv"), *folder.glob("*/images.csv")]
    below = [path.relative_to(folder) for path in paths]
    return sorted(str(path) for path in below if path.parent.name not in BLOCKS)[:SHOWN]


def _block_problems(tables: BlockTables, toml: Toml, setup: Setup | None) -> list[Problem]:
    """Return the problems of a block; its geometry is checked only if all else is right."""
    problems = [*tables.problems]
    problems += _name_problems(tables, toml)
    problems += _file_problems(tables)
    if setup is None:
        return problems
    problems += _sensor_problems(tables, setup)
    if not problems:
        sane = _without_single_rows(tables, setup.grid)
        problems = [*_position_problems(sane, setup.grid)]
        problems += [] if setup.grid.is_local else _height_problems(sane)
    return problems or [*fit_problems(tables, setup, toml)]


def _image_files(tables: BlockTables) -> tuple[Path | None, ...]:
    names = tables.images.text.get("file", ("",) * len(tables.images))
    inside, block = tables.pictures.resolve(), (tables.pictures / tables.name).resolve()
    return tuple(named_file(inside, block, name)[0] if name else None for name in names)


LEAST_ORIENTING = 3
"""Measured points that orient an image."""

VALIDATED = "validation"
"""The block whose images are not oriented by their points."""


def _notes(tables: BlockTables) -> Iterator[str]:
    for table in tables.tables:
        yield from table.notes
    ties = tables.rays.keys() - set(tables.control.text["point"])
    measured = set(tables.image_points.text["image"])
    images = [name for name in tables.images.text["image"] if name not in measured]
    count = Counter(tables.image_points.text["image"])
    few = [name for name, n in count.items() if n < LEAST_ORIENTING and tables.name != VALIDATED]
    rows, control = len(tables.trajectory), len(tables.control)
    for n, phrase in (
        (
            sum(tables.rays[name] == 1 for name in ties),
            f"of {len(ties)} tie points are measured only once",
        ),
        (
            len(images) if measured else 0,
            f"of {len(tables.images)} images have no measurements: {_some(images)}",
        ),
        (
            len(few),
            f"of {len(tables.images)} images have fewer than {LEAST_ORIENTING} measurements, which "
            f"orient no image by themselves: {_some(few)}",
        ),
        (rows - int(used_exposures(tables).sum()), f"of {rows} trajectory rows belong to no image"),
        (
            control - int(measured_control(tables).sum()),
            f"of {control} control points are not measured",
        ),
    ):
        if n:
            yield f"{tables.name}: {n} {phrase}"
    yield from _other_writing(tables, ties)


def _other_writing(tables: BlockTables, ties: Collection[str]) -> Iterator[str]:
    """Yield a note on surveyed points that are measured under a name written otherwise."""
    lost = [name for name in tables.control.text["point"] if name not in tables.rays]
    pairs = same_but_for_writing(lost, ties)
    if pairs:
        listed = _some([f"{name!r} as {other!r}" for name, other in pairs.items()])
        yield (
            f"{tables.name}: {len(pairs)} of {len(tables.control)} control points seem to be "
            f"measured as tie points, under names that are written otherwise: {listed}"
        )


def _some(names: list[str]) -> str:
    return ", ".join(names[:5]) + (", …" if len(names) > 5 else "")


# --- A flight from tables in memory: the columns of the files, and the same checks and sentences


CONTROL, DISTANCES = "control_points", "distances"
PLACE = Path("tables in memory")
"""In the place of a flight's folder, for messages; nothing is read there."""

Tables = Mapping[str, Columns]
"""The tables of a block, by the names of their files without the ending."""


def from_tables(
    settings: Mapping[str, Any],
    *,
    control_points: Columns | None = None,
    heads: Tables | None = None,
    calibration: Tables | None = None,
    validation: Tables | None = None,
) -> Flight:
    """Build a flight from tables in memory; only a geoid grid is read from a file.

    Parameters
    ----------
    settings : mapping
        The keys of flight.toml, nested as there: name, crs, heights, cameras and so on.
    control_points : table, optional
        For all blocks without their own.
    heads, calibration, validation : mapping of str to table, optional
        ``images``, ``image_points``, ``trajectory``; if there are some, ``distances``; if the
        block has its own, ``control_points``. A table is a DataFrame or a dict of arrays; its
        columns and units are those of the file of this name. Names may be whole numbers, a sigma
        may be infinite: not known.

    Raises
    ------
    FlightError
        With all problems, one line each, by table, row from 0, and column.
    """
    blocks = {"heads": heads, "calibration": calibration, "validation": validation}
    present = {name: tables for name, tables in blocks.items() if tables is not None}
    toml = Toml(folder=Path(), file="settings", values=_plain(settings), in_memory=True)
    wrong = list(_missing(present, settings))
    if wrong:
        raise FlightError(lines_of(wrong))
    read = [_block(name, tables, control_points) for name, tables in present.items()]
    flight = checked(toml, read)
    sums = {f"{b.name}/{t}.csv": getattr(b, t).sha256 for b in read for t in TABLES}
    sums |= {f"{b.name}/{DISTANCES}.csv": b.distances.sha256 for b in read if b.distances}
    return replace(flight, path=PLACE, pictures=PLACE, sha256=sums)


def _missing(blocks: Mapping[str, Tables], settings: object) -> Iterator[Problem]:
    """Yield missing blocks, and blocks and tables of a wrong type or name."""
    if not isinstance(settings, Mapping):
        yield _problem("settings", "settings", f"is {given(settings)}", "must be a dict")
    if not blocks:
        expected = "must have one at least: heads, calibration or validation"
        yield _problem("flight", "blocks", "no block at all", expected)
    for name, tables in blocks.items():
        if isinstance(tables, Mapping):
            yield from _names(name, tables)
        else:
            expected = f"must be a dict of the tables {', '.join(TABLES)}"
            yield _problem(name, "tables", f"is {given(tables)}", expected)


def _names(block: str, tables: Tables) -> Iterator[Problem]:
    """Yield unknown and missing tables of a block."""
    known = (*TABLES, CONTROL, DISTANCES)
    for table in tables:
        if table not in known:
            fault = f"unknown table{did_you_mean(str(table), known)}"
            yield _problem(block, str(table), fault, f"must be one of {', '.join(known)}")
    for table in TABLES:
        if table not in tables:
            yield _problem(block, table, "missing", "required")


def _problem(table: str, column: str, fault: str, expected: str) -> Problem:
    return Problem(
        file=table, line=-1, column=column, found=fault, expected=expected, in_memory=True
    )


def _block(name: str, tables: Tables, control_points: Columns | None) -> BlockTables:
    images, image_points, trajectory = (
        table_in_memory(tables[table], f"{name}.{table}", SCHEMAS[f"{table}.csv"])
        for table in TABLES
    )
    return BlockTables(
        name=name,
        pictures=Path(),
        images=images,
        image_points=image_points,
        trajectory=trajectory,
        control=_control(name, tables, control_points),
        distances=_distances(name, tables),
    )


def _distances(name: str, tables: Tables) -> Table | None:
    if DISTANCES not in tables:
        return None
    return table_in_memory(tables[DISTANCES], f"{name}.{DISTANCES}", SCHEMAS[f"{DISTANCES}.csv"])


def _control(name: str, tables: Tables, shared: Columns | None) -> Table:
    """Return a block's own control points, or those of the flight, or none."""
    block_control = tables.get(CONTROL)
    columns = shared if block_control is None else block_control
    if columns is None:
        columns = dict.fromkeys(("point", "east_m", "north_m", "height_m"), np.zeros(0))
    label = CONTROL if block_control is None else f"{name}.{CONTROL}"
    return table_in_memory(columns, label, SCHEMAS[f"{CONTROL}.csv"])


def _plain(value: Any) -> Any:
    """Convert settings to the plain types of flight.toml, without None and numpy's types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items() if entry is not None}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(entry) for entry in value] if isinstance(value, list | tuple) else value


# --- Contradictions between the tables of a block, and between these and flight.toml


def _name_problems(tables: BlockTables, toml: Toml) -> Iterator[Problem]:
    """Yield unknown names of images, cameras, exposures and points, and unknown roles."""
    cameras = toml.table("cameras")
    if cameras:
        yield from _unknown(tables.images, "camera", cameras, f"must be a camera of {toml.file}")
    for table, column, other in (
        (tables.images, "exposure", tables.trajectory),
        (tables.image_points, "image", tables.images),
    ):
        if len(other) and column in other.text:
            expected = f"must have a row in {other.file}"
            yield from _unknown(table, column, other.text[column], expected)
    yield from _unknown(tables.control, "role", ("control", "check"), "must be control or check")
    if tables.distances is not None:
        yield from _distance_problems(tables.distances, tables.image_points)
    yield from _strip_problems(tables, toml)
    if tables.name == "heads":
        yield from _head_problems(tables.images, toml)
    elif toml.get("synthetic", "measured_in") == "heads":
        yield from _other_cameras(tables.images, toml, ", since measured_in is 'heads'")


def _distance_problems(distances: Table, measured: Table) -> Iterator[Problem]:
    """Yield distances to unmeasured points, and distances from a point to itself."""
    if "point" not in measured.text or not distances.has("point_a", "point_b"):
        return
    for end in ("point_a", "point_b"):
        expected = f"must be a point of {measured.file}"
        yield from _unknown(distances, end, measured.text["point"], expected)
    names = list(zip(distances.text["point_a"], distances.text["point_b"], strict=True))
    yield from counted(
        [row for row, (a, b) in enumerate(names) if a == b],
        lambda row: distances.problem(
            row, "point_b", f"{quoted(names[row][1])} again", "must be another point than point_a"
        ),
    )


def _strip_problems(tables: BlockTables, toml: Toml) -> Iterator[Problem]:
    """Yield requested drifts or delays for which strips or times are missing."""
    keys = ("stages", "mounting", "gnss")
    asked = toml.get(*keys) if tables.name == "calibration" else None
    asked = asked if isinstance(asked, list) else []
    has_strips = any(tables.images.text.get("strip", ()))
    for name in asked:
        if name in ("drift", *DELAYS) and not has_strips:
            yield toml.problem(
                keys, repr(name), f"needs strips in {tables.images.file}, column strip"
            )
    yield from _timeless(tables, toml, keys, [name for name in asked if name in DELAYS])


def _timeless(
    tables: BlockTables, toml: Toml, keys: tuple[str, ...], delays: Sequence[str]
) -> Iterator[Problem]:
    """Yield requested delays and correlations if the trajectory has no times."""
    if len(tables.trajectory) == 0 or tables.trajectory.has("time_s"):
        return
    expected = f"needs times in {tables.trajectory.file}, column time_s"
    for name in delays:
        yield toml.problem(keys, repr(name), expected)
    for key in ("gnss_correlation_s", "attitude_correlation_s"):
        if key in toml.table("apriori"):
            yield toml.problem(("apriori", key), quoted(toml.get("apriori", key)), expected)


def _unknown(table: Table, column: str, known: Collection[str], expected: str) -> Iterator[Problem]:
    names, known = table.text.get(column, ()), dict.fromkeys(known)
    unknown = set(names) - known.keys() - {""}
    rows = [row for row, name in enumerate(names) if name in unknown] if unknown else []

    def problem(row: int) -> Problem:
        fault = f"{quoted(names[row])} is unknown{did_you_mean(names[row], known)}"
        return table.problem(row, column, fault, expected)

    yield from counted(rows, problem)


def _file_problems(tables: BlockTables) -> Iterator[Problem]:
    """Yield image files that are missing or outside the flight."""
    images, flight, folder = tables.images, tables.pictures, tables.pictures / tables.name
    names = images.text.get("file", ())
    expected = f"must be a file under {folder}, links resolved"
    inside, block = flight.resolve(), folder.resolve()
    faults = {name: named_file(inside, block, name)[1] for name in set(names) if name}
    rows = [row for row, name in enumerate(names) if faults.get(name)]

    def wrong(row: int) -> Problem:
        fault = f"{quoted(names[row])} {faults[names[row]]}"
        hint = _other_file(inside, block, names[row]) if fault.endswith("is not there") else ""
        return images.problem(row, "file", f"{fault}{hint}", expected)

    yield from counted(rows, wrong)


def _other_file(inside: Path, block: Path, name: str) -> str:
    """Return " (did you mean 'x'?)" where only case, slashes or the folder are others."""
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts:
        return ""
    for folder in dict.fromkeys((path.parent, PurePosixPath("images"), PurePosixPath())):
        try:
            there = sorted(one.name for one in (block / folder).iterdir())
        except OSError:
            continue
        same = (str(folder / one) for one in there if one.casefold() == path.name.casefold())
        for other in same:
            if named_file(inside, block, other)[0]:
                return f" (did you mean {other!r}?)"
    return ""


def _head_problems(images: Table, toml: Toml) -> Iterator[Problem]:
    """Yield contradictions between the heads' images and the declared heads."""
    settings, heads = toml.get(), toml.get("synthetic", "heads")
    if settings and "synthetic" not in settings:
        yield toml.problem(("synthetic",), "missing", "required, since there is a block heads")
    if not isinstance(heads, list) or "camera" not in images.text:
        return
    yield from _other_cameras(images, toml, "")
    names, cameras = set(images.text["camera"]), toml.table("cameras")
    for head in heads:
        if isinstance(head, str) and head not in names and head in cameras:
            expected = f"every head needs images in {images.file}"
            yield toml.problem(("synthetic", "heads"), f"{head!r} took no image", expected)


def _other_cameras(images: Table, toml: Toml, since: str) -> Iterator[Problem]:
    """Yield the images of declared cameras that are no heads."""
    heads = toml.get("synthetic", "heads")
    names = images.text.get("camera", ())
    known = [head for head in heads if isinstance(head, str)] if isinstance(heads, list) else names
    others = set(names) & toml.table("cameras").keys() - set(known)
    expected = f"must be one of synthetic.heads in {toml.file}{since}"
    yield from counted(
        [row for row, name in enumerate(names) if name in others],
        lambda row: images.problem(row, "camera", f"{names[row]!r} is no head", expected),
    )


def _uncalibrated_problems(blocks: Sequence[BlockTables], setup: Setup) -> Iterator[Problem]:
    """Yield cameras of the validation block that are not in the calibration block.

    Where both are transferred into the synthetic image, its camera is calibrated.
    """
    images = {tables.name: tables.images for tables in blocks}
    if setup.measured_in_heads or not {"calibration", "validation"} <= images.keys():
        return
    calibrated = images["calibration"].text.get("camera", ())
    validated, known = images["validation"].text.get("camera", ()), set(calibrated)
    first: dict[str, int] = {}
    for row, name in enumerate(validated if calibrated else ()):
        first.setdefault(name, row)
    for name, row in first.items():
        if name not in known:
            fault = f"{name!r} is not calibrated"
            expected = f"must be a camera with images in {images['calibration'].file}"
            yield images["validation"].problem(row, "camera", fault, expected)


def _sensor_problems(tables: BlockTables, setup: Setup) -> Iterator[Problem]:
    """Yield measurements outside the sensor; rows with unknown names are not checked."""
    images, measured = tables.images, tables.image_points
    if not (images.has("image", "camera") and measured.has("image", "col_px", "row_px")):
        return
    image_idx = index_of(measured.text["image"], images.text["image"])
    names = tuple(setup.cameras)
    camera_idx = np.append(index_of(images.text["camera"], names), -1)[image_idx]
    colrow = measured.stack("col_px", "row_px")  # noqa: PD013 a flight's table
    finite = np.isfinite(colrow).all(axis=1)
    for i, name in enumerate(names):
        camera, mine = setup.cameras[name], np.flatnonzero((camera_idx == i) & finite)
        rows = mine[~inside(camera, colrow[mine])]
        swapped = partial(_inside_if_swapped, camera, colrow)
        sides = np.array([camera.width_px, camera.height_px])
        mm = bool(np.all(np.abs(colrow[mine]) <= (sides + 1) / 2 * camera.pixel_mm))
        beyond_col = np.abs(colrow[rows, 0] - (camera.width_px - 1) / 2) > camera.width_px / 2
        for column, size, outside in (
            ("col_px", camera.width_px, rows[beyond_col]),
            ("row_px", camera.height_px, rows[~beyond_col]),
        ):
            expected = f"must lie on the sensor of {camera.name}, from -0.5 to {size - 0.5}"
            hint = " (in mm from the middle?)" if mm else ""
            yield from counted(outside, _outside(measured, column, hint, swapped, expected))


def _inside_if_swapped(camera: Camera, colrow: Array, row: int) -> bool:
    return bool(inside(camera, colrow[row, ::-1]))


def _outside(
    measured: Table, column: str, hint: str, may_be_swapped: Callable[[int], bool], expected: str
) -> Callable[[int], Problem]:
    """Return a function that describes a row whose measurement lies outside the sensor."""

    def problem(row: int) -> Problem:
        swapped = " (col and row swapped?)" if not hint and may_be_swapped(row) else hint
        fault = measured.text[column][row].strip() + swapped
        return measured.problem(row, column, fault, expected)

    return problem


def _position_problems(tables: BlockTables, grid: GridSystem) -> Iterator[Problem]:
    """Yield positions that the CRS or the geoid grid does not cover."""
    if grid.is_local:
        yield from _off_frame(tables)
        return
    yield from _degree_problems(tables, grid)
    for table, used in (
        (tables.trajectory, used_exposures(tables)),
        (tables.control, measured_control(tables)),
    ):
        rows = np.flatnonzero(used)
        lonlat = lonlat_of(table, grid)
        on_earth = np.isfinite(lonlat[:, 0]) & np.isfinite(lonlat[:, 1])
        if "east_m" in table.numbers:
            on_earth[on_earth] = np.isfinite(grid.convergence(lonlat[on_earth]))
        yield from counted(rows[~on_earth[rows]], _nowhere(table, grid))
        rows = rows[on_earth[rows]]
        undulation = grid.undulation(lonlat[rows])
        yield from counted(rows[~np.isfinite(undulation)], _no_height(table, grid, lonlat))


def _off_frame(tables: BlockTables) -> Iterator[Problem]:
    """Yield a problem if a flight on no map has a trajectory in longitude and latitude."""
    if "lat_deg" in tables.trajectory.numbers:
        expected = f"must be east_m, north_m, … kappa_deg, since crs is {LOCAL!r}"
        fault = "longitudes and latitudes of a flight on no map"
        yield tables.trajectory.problem(0, "lat_deg", fault, expected)


def _degree_problems(tables: BlockTables, grid: GridSystem) -> Iterator[Problem]:
    """Yield tables with longitudes and latitudes in place of metres."""
    for table in (tables.trajectory, tables.control):
        if table.has("east_m", "north_m") and of_degrees(
            grid, table.numbers["east_m"], table.numbers["north_m"]
        ):
            east, north = (table.text[name][0].strip() for name in ("east_m", "north_m"))
            fault = f"{east}, {north} (longitude, latitude in degrees?)"
            expected = f"must be metres where {quoted(grid.crs)[1:-1]} is meant for"
            yield table.problem(0, "east_m", fault, expected)


def _nowhere(table: Table, grid: GridSystem) -> Callable[[int], Problem]:
    expected = f"must be a position that {quoted(grid.crs)[1:-1]} covers, easting first"

    def problem(row: int) -> Problem:
        east, north = (table.text[name][row].strip() for name in ("east_m", "north_m"))
        return table.problem(row, "east_m", f"{east}, {north} is nowhere", expected)

    return problem


def _no_height(table: Table, grid: GridSystem, lonlat: Array) -> Callable[[int], Problem]:
    column = "lat_deg" if "lat_deg" in table.numbers else "east_m"
    expected = f"must lie inside the geoid grid {grid.height_system}"

    def problem(row: int) -> Problem:
        fault = f"no height is known at {lonlat[row, 1]:.4f}, {lonlat[row, 0]:.4f}"
        return table.problem(row, column, fault, expected)

    return problem


def _height_problems(tables: BlockTables) -> Iterator[Problem]:
    """Yield exposures below their highest control point; without any, below all of the block."""
    measured = measured_control(tables)
    if not measured.any():
        return
    height = tables.control.numbers["height_m"]
    lowest = int(np.flatnonzero(measured)[np.argmin(height[measured])])
    highest = _highest_seen(tables)
    trajectory = tables.trajectory
    above = [highest.get(name, lowest) for name in trajectory.text["exposure"]]
    below = trajectory.numbers["height_m"] <= height[above]
    expected = f"must lie above the control points of {tables.control.file}"
    above_in_feet = trajectory.numbers["height_m"] > FOOT * height[above]
    feet = " (in feet?)" if below.mean() > 0.5 and above_in_feet.all() else ""

    def problem(row: int) -> Problem:
        fault = (
            f"{trajectory.text['height_m'][row].strip()} is below control point "
            f"{quoted(tables.control.text['point'][above[row]])} at {height[above[row]]:g}{feet}"
        )
        return trajectory.problem(row, "height_m", fault, expected)

    yield from counted(np.flatnonzero(used_exposures(tables) & below), problem)


def _highest_seen(tables: BlockTables) -> dict[str, int]:
    """Return the row of the highest control point in the images of each exposure."""
    exposure = dict(zip(tables.images.text["image"], tables.images.text["exposure"], strict=True))
    height = tables.control.numbers["height_m"]
    highest: dict[str, int] = {}
    text = tables.image_points.text
    rows = index_of(text["point"], tables.control.text["point"])
    for i in np.flatnonzero(rows >= 0).tolist():
        name, row = exposure[text["image"][i]], int(rows[i])
        if height[row] > height[highest.setdefault(name, row)]:
            highest[name] = row
    return highest


# --- Notes on strange positions of points; they are no reason to refuse the flight


ABSURD = 4.0
"""Distance from the measurements, in quarters of the image diagonal: far outside the image."""

SHARE, ENOUGH = 10, 3
"""At most one row in `SHARE`, or one row, is single; at least `ENOUGH` others must remain."""

NAMED = 5
"""Number of points that a note names."""

BESIDE_DEG = 3.0
"""Allowed distance from the area of use of a CRS: zones are used beyond their borders."""


def _without_single_rows(tables: BlockTables, grid: GridSystem) -> BlockTables:
    """Drop single control points outside the CRS, or above all exposures that see them.

    A mistake in one row of many is a gross error; the adjustment will find it. Mistakes in many
    rows are a mistake of the table; then all rows stay.
    """
    rows = np.flatnonzero(measured_control(tables))
    lonlat = lonlat_of(tables.control, grid)[rows]
    on_earth = np.flatnonzero(np.isfinite(lonlat).all(axis=1))
    wrong = np.ones(len(rows), dtype=bool)
    wrong[on_earth] = ~np.isfinite(grid.undulation(lonlat[on_earth]))
    height = tables.control.numbers["height_m"][rows]
    lowest = tables.trajectory.numbers["height_m"][used_exposures(tables)].min(initial=np.inf)
    if np.any(height >= lowest):
        wrong |= height >= _highest_below(tables)[rows]
    n = int(wrong.sum())
    if n > max(1, len(rows) // SHARE) or len(rows) - n < ENOUGH:
        return tables
    keep = np.ones(len(tables.control), dtype=bool)
    keep[rows[wrong]] = False
    return replace(tables, control=tables.control.select(keep))


def _highest_below(tables: BlockTables) -> Array:
    """Return the lowest impossible height of every control point, m, shape (n,).

    It is above all exposures that see the point, and above half of the block's exposures,
    because a single exposure may be too low itself.
    """
    trajectory = tables.trajectory
    used = trajectory.numbers["height_m"][used_exposures(tables)]
    height = dict(zip(trajectory.text["exposure"], trajectory.numbers["height_m"], strict=True))
    exposure = dict(zip(tables.images.text["image"], tables.images.text["exposure"], strict=True))
    highest = dict.fromkeys(tables.control.text["point"], float(np.median(used)))
    text = tables.image_points.text
    for i in np.flatnonzero(index_of(text["point"], [*highest]) >= 0).tolist():
        point = text["point"][i]
        highest[point] = max(highest[point], float(height[exposure[text["image"][i]]]))
    return np.array(list(highest.values()))


def _control_notes(tables: BlockTables, block: Block) -> Iterator[str]:
    """Yield notes on surveyed points that project far from their measurements."""
    misfits = misfit(block)
    ratio = medians(misfits.distance_px / misfits.allowed_px, misfits.point_idx, len(block.points))
    absurd = {block.points[i] for i in np.flatnonzero(ratio > ABSURD)}
    line = dict(zip(tables.control.text["point"], tables.control.lines, strict=True))
    far = [name for name in line if name in absurd]
    if far:
        listed = ", ".join(
            f"{name!r} ({tables.control.counts} {line[name]})" for name in far[:NAMED]
        )
        more = ", …" if len(far) > NAMED else ""
        yield (
            f"{tables.name}: {len(far)} of {len(np.unique(misfits.point_idx))} surveyed points of "
            f"{tables.control.file} lie nowhere near where they were measured, and will be "
            f"rejected as gross errors if the others fit: {listed}{more}"
        )


def _unobserved_parts(block: Block | None) -> tuple[str, ...]:
    """Return the mounting parts that the trajectory does not observe, named as in `fix`."""
    if block is None or not block.frame.grid.is_local:
        return ()
    trajectory = block.trajectory
    positions, attitudes = (
        np.isfinite(sigma).all(axis=1).any()
        for sigma in (trajectory.sigma_position, trajectory.sigma_attitude)
    )
    return (
        *(() if positions and attitudes else ("lever_arm",)),
        *(() if attitudes else ("boresight",)),
    )


def _held_notes(setup: Setup) -> Iterator[str]:
    """Yield notes on laboratory sigma of parameters that a stage holds."""
    heads = setup.synthetic.heads if setup.synthetic else ()
    for name, camera in setup.cameras.items():
        stage = "heads" if name in heads else "mounting"
        estimated = setup.estimate_heads if name in heads else setup.estimate_mounting
        known = zip(KNOWN.items(), INTERIOR, camera.prior.interior, strict=False)
        for (key, value), parameter, sigma in known:
            if np.isfinite(sigma) and parameter not in estimated:
                yield f"{name}: stage {stage} holds {value}, {key} takes no part in it"


def _datum_notes(block: Block) -> Iterator[str]:
    """Yield notes on the datum of a block on no map: parts held, position and scale."""
    if not block.frame.grid.is_local:
        return
    if block.name == "calibration" and (held := _unobserved_parts(block)):
        unknown = "positions nor attitudes" if not _observed(block) else "attitudes"
        lack = "has neither sigma of" if not _observed(block) else "has no sigma of"
        parts = " and ".join(name.replace("_", " ") for name in held)
        yield (
            f"{block.name}: the trajectory {lack} {unknown}, which are start values alone; "
            f"{parts} are held"
        )
    if len(block.control) < ENOUGH and not _observed(block):
        scale = shown.count(len(block.distances), "distance")
        yield (
            f"{block.name}: neither three control points nor positions with sigma fix where the "
            "block lies: it is a free network, "
            + (f"whose scale is that of {scale}" if len(block.distances) else "of unknown scale")
        )


def _observed(block: Block) -> bool:
    """Tell whether positions are observed."""
    return bool(np.isfinite(block.trajectory.sigma_position).all(axis=1).any())


def _refraction_notes(setup: Setup, blocks: Mapping[str, Block]) -> Iterator[str]:
    """Yield a note on what it costs that flight.toml says nothing of refraction."""
    block = next(blocks[name] for name in ("calibration", "heads", "validation") if name in blocks)
    above, camera = flying_heights(block), block.cameras[0]
    if not above.min() > 0:
        return
    at_heights = above.max() > (1 + SAME_HEIGHT) * above.min()
    height = block.frame.to_geographic(block.trajectory.T_m_b.r)[:, 2]
    f_mm, z_m = refraction_taken_up(
        camera.interior.f,
        0.5 * camera.pixel_mm * float(np.hypot(camera.width_px, camera.height_px)),
        height,
        float(height[0] - above[0]),
        lever_arm=at_heights and "lever_arm" not in setup.fix,
    )
    lever = f" and the lever arm's z {100 * z_m:.2g} cm" if z_m else ""
    yield (
        "flight.toml says nothing of refraction, so rays are taken for straight; from "
        f"{np.median(above):.0f} m this makes f {1000 * f_mm:.2g} µm{lever} too large in vertical "
        'images: write refraction = "standard", or "none" to keep straight rays'
    )


def _vertical_notes(grid: GridSystem) -> Iterator[str]:
    """Yield a note on a CRS with heights of its own, where the flight's are ellipsoidal."""
    if grid.is_local or grid.heights != "ellipsoidal":
        return
    crs = pyproj.CRS.from_user_input(grid.crs)
    if crs.is_compound:
        yield (
            "heights are ellipsoidal, as heights in flight.toml says, and not those of "
            f"{grid.crs}, {crs.sub_crs_list[1].name}"
        )


def area_notes(grid: GridSystem, blocks: dict[str, Block]) -> Iterator[str]:
    """Yield a note on each block far outside the area of use of its CRS."""
    if grid.is_local:
        return
    crs = pyproj.CRS.from_user_input(grid.crs)
    area = crs.area_of_use
    if area is None:
        return
    for name, block in blocks.items():
        lon, lat = block.frame.origin
        lon += 0.0 if crs.prime_meridian is None else crs.prime_meridian.longitude
        if not holds(area.bounds, lon, lat):
            area_name = shorten(area.name.rstrip("."), 80, placeholder=" …")
            yield (
                f"{name}: the exposures are at {_place(lon, lat)}, but {grid.crs} ({crs.name}) is "
                f"meant for {_place(area.west, area.south)} to {_place(area.east, area.north)}, "
                f"{area_name}: is it the right CRS?"
            )


def of_degrees(grid: GridSystem, east: Array, north: Array) -> bool:
    """Tell whether map coordinates are longitudes and latitudes in degrees, not metres.

    No value exceeds 180 and 90, and the first, as metres, lies outside the area of use of the CRS.

    Parameters
    ----------
    grid : GridSystem
    east, north : ndarray, shape (n,)
        As they were given.
    """
    area = pyproj.CRS.from_user_input(grid.crs).area_of_use
    if area is None or not len(east) or np.any(np.abs(east) > 180) or np.any(np.abs(north) > 90):
        return False
    lon, lat = grid.lonlat_from_grid(np.array([[east[0], north[0]]]))[0]
    return not holds(area.bounds, lon, lat, beside_deg=0.0)


def holds(
    bounds: tuple[float, float, float, float],
    lon: float,
    lat: float,
    *,
    beside_deg: float = BESIDE_DEG,
) -> bool:
    """Tell whether a position lies in an area or near it; the area may cross the date line."""
    west, south, east, north = bounds
    wide = (east - west) % 360 or 360.0
    along = (lon - west + beside_deg) % 360
    near_north = south - beside_deg <= lat <= north + beside_deg
    return near_north and along <= wide + 2 * beside_deg


def _place(lon: float, lat: float) -> str:
    """Return a position as text, such as 25.4 S 49.3 W."""
    return f"{abs(lat):.1f} {'S' if lat < 0 else 'N'} {abs(lon):.1f} {'W' if lon < 0 else 'E'}"
