"""Reading a flight: either the whole flight, or a list of everything that is wrong with it."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acx4lib import expected, shown
from acx4lib.errors import FlightError, visible
from acx4lib.expected import given
from acx4lib.flight.block import Block, block_row, synthetic_images
from acx4lib.flight.block_from_tables import (
    BLOCKS,
    TABLES,
    BlockTables,
    assemble,
    measured_control,
    read_block,
    used_exposures,
)
from acx4lib.flight.checks import (
    area_notes,
    control_notes,
    datum_notes,
    file_problems,
    height_problems,
    name_problems,
    position_problems,
    sensor_problems,
    uncalibrated_problems,
    unobserved_parts,
    without_single_rows,
)
from acx4lib.flight.problems import SHOWN, Problem, did_you_mean, lines_of
from acx4lib.flight.readings import fit_problems
from acx4lib.flight.settings import flight_table
from acx4lib.flight.setup import Setup, setup_of
from acx4lib.flight.table_files import Columns, named_file, table_in_memory
from acx4lib.flight.tables import SCHEMAS, Table
from acx4lib.flight.toml_file import Toml, read_toml
from acx4lib.geometry.camera import Camera

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight(Setup):
    """A flight, read and found consistent.

    Attributes
    ----------
    path : Path
        Its folder; a name that says so, where it was made of tables in memory.
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
        """Say in a line what is in it."""
        blocks = [
            f"{name} {shown.count(len(one.images), 'image')}" for name, one in self.blocks.items()
        ]
        cameras = shown.count(len(self.cameras), "camera")
        return shown.line(f"Flight {self.name!r}", cameras, *blocks)

    def table(self) -> pd.DataFrame:
        """Return what is in its blocks, a row for each."""
        rows = {name: block_row(block) for name, block in self.blocks.items()}
        return shown.row_table("block", rows)

    def block(self, name: str) -> Block:
        """Return one of the blocks; a FlightError says so where it is not there."""
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
        """Cameras of block heads that are heads: those of [synthetic] in its order, or all."""
        present = tuple(camera.name for camera in self.blocks["heads"].cameras)
        named = self.synthetic.heads if self.synthetic else present
        return tuple(name for name in named if name in present)

    @property
    def carried(self) -> tuple[str, ...]:
        """Blocks that are measured in heads and carried into the synthetic image."""
        here = [name for name in ("calibration", "validation") if name in self.blocks]
        return tuple(here) if self.measured_in_heads else ()

    def mounted(self, name: str) -> Block:
        """Return a block as its mounted camera exposed it.

        For a block that is carried these are its synthetic images, without measurements.
        """
        synthetic = self.synthetic_camera
        if name not in self.carried or synthetic is None:
            return self.block(name)
        return synthetic_images(self.block(name), synthetic)

    @property
    def synthetic_camera(self) -> Camera | None:
        """Camera of the synthetic image; None where flight.toml has no table [synthetic]."""
        return self.cameras[self.synthetic.camera] if self.synthetic else None


def read(path: str | Path, *, pictures: str | Path = "") -> Flight:
    """Return the flight in a folder.

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
    """Return the flight of settings and tables; FlightError with all that is wrong with them.

    Parameters
    ----------
    toml : Toml
    blocks : sequence of BlockTables
    problems, notes : sequence
        What was found before, beside the tables' own.
    """
    found = [*_toml_problems(toml)]
    setup = None if found else setup_of(toml)
    found += problems
    for tables in blocks:
        found += _block_problems(tables, toml, setup)
    if setup is not None and not found:
        found = [*uncalibrated_problems(blocks, setup)]
    if found or setup is None:
        raise FlightError(lines_of(found))
    own = [note for tables in blocks for note in _notes(tables)]
    return _flight(toml, setup, blocks, [*notes, *own])


def _toml_problems(toml: Toml) -> Iterator[Problem]:
    """Yield what is wrong with flight.toml; if it could not be read, only that."""
    yield from toml.problems or flight_table(toml).problems(toml)


def read_kept(path: str | Path) -> Flight:
    """Return a flight from tables kept by a run.

    How they fit together was judged when they were first read, perhaps by an earlier version.

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
        problems += [*tables.problems, *name_problems(tables, toml)]
    if problems:
        raise FlightError(lines_of(problems))
    setup = setup_of(toml)
    problems = [
        problem
        for tables in blocks
        for problem in (*sensor_problems(tables, setup), *position_problems(tables, setup.grid))
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
    """Return the flight made from blocks without problems."""
    assembled = {tables.name: assemble(tables, setup) for tables in blocks}
    held = unobserved_parts(assembled.get("calibration"))
    setup = replace(setup, fix=tuple(dict.fromkeys((*setup.fix, *held))))
    notes = [*notes, *area_notes(setup.grid, assembled)]
    notes += [note for block in assembled.values() for note in datum_notes(block)]
    for tables in blocks:
        notes += control_notes(tables, assembled[tables.name])
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
    found, expected = "reading it takes more memory than there is", "must fit into free memory"
    return Problem(file=str(folder), line=1, column="folder", found=found, expected=expected)


def _is_other(path: Path) -> bool:
    """Tell whether a path with the name of a block exists and is no folder."""
    return os.path.lexists(path) and not _is_folder(path)


def _no_block_folder(path: Path) -> Problem:
    expected = "must be the folder of a block"
    return Problem(file=str(path), line=1, column="folder", found="is no folder", expected=expected)


def _no_block(folder: Path) -> Problem:
    expected = f"needs at least one of the folders {', '.join(f'{name}/' for name in BLOCKS)}"
    stray = "".join(f" ({path} is in none)" for path in _strays(folder))
    found = f"no block at all{stray}"
    return Problem(file=str(folder), line=1, column="folder", found=found, expected=expected)


def _strays(folder: Path) -> list[str]:
    """Return the tables of images outside all blocks: a block's folder may be misspelt."""
    paths = [*folder.glob("images.csv"), *folder.glob("*/images.csv")]
    below = [path.relative_to(folder) for path in paths]
    return sorted(str(path) for path in below if path.parent.name not in BLOCKS)[:SHOWN]


def _block_problems(tables: BlockTables, toml: Toml, setup: Setup | None) -> list[Problem]:
    """Return what is wrong with a block; its geometry is checked only if all else is right."""
    problems = [*tables.problems]
    problems += name_problems(tables, toml)
    problems += file_problems(tables)
    if setup is None:
        return problems
    problems += sensor_problems(tables, setup)
    if not problems:
        sane = without_single_rows(tables, setup.grid)
        problems = [*position_problems(sane, setup.grid)]
        problems += [] if setup.grid.is_local else height_problems(sane)
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
    for n, says in (
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
            yield f"{tables.name}: {n} {says}"


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
    """Return the flight of tables in memory; nothing is read from files but a geoid grid.

    Parameters
    ----------
    settings : mapping
        The keys of flight.toml, nested as there: name, crs, heights, cameras and so on.
    control_points : table, optional
        Of all blocks that have none of their own.
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
    """Yield what is no table, lacks, or has a name that no table has."""
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
    """Yield the names of a block's tables that no table has, and those that are missing."""
    known = (*TABLES, CONTROL, DISTANCES)
    for table in tables:
        if table not in known:
            found = f"unknown table{did_you_mean(str(table), known)}"
            yield _problem(block, str(table), found, f"must be one of {', '.join(known)}")
    for table in TABLES:
        if table not in tables:
            yield _problem(block, table, "missing", "required")


def _problem(table: str, column: str, found: str, expected: str) -> Problem:
    return Problem(
        file=table, line=-1, column=column, found=found, expected=expected, in_memory=True
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
    own = tables.get(CONTROL)
    columns = shared if own is None else own
    if columns is None:
        columns = dict.fromkeys(("point", "east_m", "north_m", "height_m"), np.zeros(0))
    label = CONTROL if own is None else f"{name}.{CONTROL}"
    return table_in_memory(columns, label, SCHEMAS[f"{CONTROL}.csv"])


def _plain(value: Any) -> Any:
    """Return settings as flight.toml would hold them: None is left out, as are numpy's types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items() if one is not None}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value
