"""Read a flight: the flight itself, or a list of all its problems.

Contradictions between the tables of a block and flight.toml are refused; oddities become notes.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path, PurePosixPath
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np
import pyproj

from acx4files.conventions import FOOT, contradictions, lonlat_of, misses
from acx4files.flight.block_from_tables import (
    BLOCKS,
    TABLES,
    BlockTables,
    assemble,
    index_of,
    measured_control,
    read_block,
    used_exposures,
)
from acx4files.flight.problems import (
    ABSENT,
    SHOWN,
    Problem,
    counted,
    did_you_mean,
    kind_of,
    lines_of,
    quoted,
    same_but_for_writing,
    whole,
)
from acx4files.flight.settings import KNOWN, Setup, flight_table, setup_of
from acx4files.flight.table_files import Columns, named_file, table_in_memory
from acx4files.flight.tables import SCHEMAS, Table
from acx4files.flight.toml_file import Toml, read_toml
from acx4lib import shown
from acx4lib.block import Block, block_row, no_datum, synthetic_images
from acx4lib.design import SAME_HEIGHT, flying_heights
from acx4lib.errors import FlightError, visible
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Camera, inside
from acx4lib.geometry.collinearity import refraction_taken_up
from acx4lib.geometry.geodesy import LOCAL, GridSystem
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
    folder = Path(path)
    if not os.path.isdir(folder):  # noqa: PTH112 no error for a name that no file can have
        cure = "must be the folder of a flight, with a flight.toml"
        raise FlightError(lines_of([whole(folder, "folder", "is no folder", cure)]))
    toml, blocks = read_toml(folder / "flight.toml"), _read_blocks(folder, Path(pictures or path))
    others = [
        whole(folder / name, "folder", "is no folder", "must be the folder of a block")
        for name in BLOCKS
        if os.path.lexists(folder / name) and not (folder / name).is_dir()
    ]
    strays = sorted(
        str(table.relative_to(folder))
        for table in (*folder.glob("images.csv"), *folder.glob("*/images.csv"))
        if table.parent.name not in BLOCKS or table.parent == folder
    )[:SHOWN]
    if not blocks:
        stray = "".join(f" ({name} is in none)" for name in strays)
        cure = f"needs at least one of the folders {', '.join(f'{name}/' for name in BLOCKS)}"
        others.insert(0, whole(folder, "folder", f"no block at all{stray}", cure))
    notes = [f"{name} is in no block and is not read" for name in strays]
    notes += [
        f"{table.relative_to(folder)} is not read: distances are no observations any more"
        for table in sorted(folder.glob("*/distances.csv"))
    ]
    return checked(toml, blocks, problems=others, notes=notes)


def checked(
    toml: Toml,
    blocks: Sequence[BlockTables],
    *,
    problems: Sequence[Problem] = (),
    notes: Sequence[str] = (),
    kept: bool = False,
) -> Flight:
    """Build a flight from settings and tables; FlightError with all their problems.

    Parameters
    ----------
    toml : Toml
    blocks : sequence of BlockTables
    problems, notes : sequence
        Further problems and notes, beside the tables' own.
    kept : bool
        Whether the tables were checked before: pictures, heights and the fit to control points
        are not looked at.
    """
    found = [*(toml.problems or flight_table(toml).problems(toml))]
    setup = None if found else setup_of(toml)
    found += problems
    for tables in blocks:
        found += _block_problems(tables, toml, setup, kept=kept)
    if setup is not None and not found and not kept:
        found = [*_uncalibrated_problems(blocks, setup)]
    if found or setup is None:
        raise FlightError(lines_of(found))
    return _flight(toml, setup, blocks, [*notes, *(note for t in blocks for note in _notes(t))])


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
    toml, blocks = read_toml(folder / "flight.toml"), _read_blocks(folder, folder)
    none = [] if blocks else [whole(folder, "folder", "no block at all", "needs one at least")]
    return checked(toml, blocks, problems=none, kept=True)


def table_files(flight: Flight) -> list[Path]:
    """Return the files from which a flight was read, except images, relative to its folder."""
    tables = [f"{name}.csv" for name in (*TABLES, "control_points")]
    names = [Path("flight.toml"), Path("control_points.csv")]
    names += [Path(block) / name for block in flight.blocks for name in tables]
    geoid, inside = Path(str(flight.grid.heights)), flight.path.resolve()
    if geoid.is_relative_to(inside):
        names.append(geoid.relative_to(inside))
    return [name for name in names if (flight.path / name).is_file()]


def _read_blocks(folder: Path, pictures: Path) -> list[BlockTables]:
    return [read_block(folder, n, pictures=pictures) for n in BLOCKS if (folder / n).is_dir()]


def _flight(
    toml: Toml, setup: Setup, blocks: Sequence[BlockTables], notes: Iterable[str]
) -> Flight:
    """Build the flight from blocks without problems."""
    assembled = {tables.name: assemble(tables, setup) for tables in blocks}
    local = setup.grid.is_local and "calibration" in assembled
    held = _unobserved_parts(assembled["calibration"]) if local else ()
    setup = replace(setup, fix=tuple(dict.fromkeys((*setup.fix, *held))))
    notes = [*notes, *crs_notes(setup.grid, assembled)]
    notes += [note for block in assembled.values() for note in _datum_notes(block)]
    notes += _held_notes(setup)
    for tables in blocks:
        notes += _control_notes(tables, assembled[tables.name])
    if not (setup.simulated or setup.grid.is_local or "refraction" in toml.table()):
        notes += _refraction_notes(setup, assembled)
    files: list[Table | Toml] = [*(t for tables in blocks for t in tables.tables), toml]
    return Flight(
        **{f.name: getattr(setup, f.name) for f in fields(setup)},
        path=toml.folder,
        pictures=blocks[0].pictures if blocks else toml.folder,
        sha256={Path(f.file).relative_to(toml.folder).as_posix(): f.sha256 for f in files},
        blocks=assembled,
        trajectories={tables.name: tables.trajectory for tables in blocks},
        image_files={tables.name: _image_files(tables) for tables in blocks},
        notes=tuple(dict.fromkeys(map(visible, notes))),
    )


def _block_problems(
    tables: BlockTables, toml: Toml, setup: Setup | None, *, kept: bool
) -> list[Problem]:
    """Return the problems of a block; its geometry is checked only if all else is right."""
    problems = [*tables.problems, *_name_problems(tables, toml)]
    problems += [] if kept else _file_problems(tables)
    if setup is None:
        return problems
    problems += _sensor_problems(tables, setup)
    if problems:
        return problems
    sane = tables if kept else _without_single_rows(tables, setup.grid)
    problems = [*_position_problems(sane, setup.grid)]
    if kept:
        return problems
    problems += [] if setup.grid.is_local else _height_problems(sane)
    return problems or [*_fit_problems(tables, setup, toml)]


def _fit_problems(tables: BlockTables, setup: Setup, toml: Toml) -> Iterator[Problem]:
    """Yield surveyed points that do not project near their measurements, and the likely mistake."""
    named = {"image_points": tables.image_points, "trajectory": tables.trajectory}
    named["control_points"] = tables.control
    if not measured_control(tables).any():
        return
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        block = assemble(tables, setup)
    rows = index_of(block.points, tables.control.text["point"])
    enh = tables.control.stack("east_m", "north_m", "height_m")[rows]  # noqa: PD013 a flight's table
    files = {name: table.file for name, table in named.items()}
    for found in contradictions(block, tables.trajectory, enh, files):
        if found.table == "mount":
            keys = ("cameras", found.camera, found.column)
            yield toml.problem(keys, found.found, found.expected)
        else:
            place = replace(named[found.table], lines=np.zeros(0, dtype=np.int64))
            yield place.problem(0, found.column, found.found, found.expected)


def _image_files(tables: BlockTables) -> tuple[Path | None, ...]:
    names = tables.images.text.get("file", ("",) * len(tables.images))
    inside, block = tables.pictures.resolve(), (tables.pictures / tables.name).resolve()
    return tuple(named_file(inside, block, name)[0] if name else None for name in names)


def _notes(tables: BlockTables) -> Iterator[str]:
    """Yield what is odd in the tables of a block, and allowed."""
    for table in tables.tables:
        yield from table.notes
    surveyed = tables.control.text["point"]
    ties = tables.rays.keys() - set(surveyed)
    count = Counter(tables.image_points.text["image"])
    empty = [name for name in tables.images.text["image"] if count and name not in count]
    orienting = 3  # measured points
    few = [name for name, n in count.items() if n < orienting and tables.name != "validation"]
    single = [name for name in ties if tables.rays[name] == 1]
    unused, lost = ~used_exposures(tables), ~measured_control(tables)
    pairs = same_but_for_writing([surveyed[row] for row in np.flatnonzero(lost).tolist()], ties)
    written = _some([f"{name!r} as {other!r}" for name, other in pairs.items()])
    of_images = f"of {len(tables.images)} images have"
    of_control = f"of {len(lost)} control points"
    for n, says in (
        (len(single), f"of {len(ties)} tie points are measured only once"),
        (len(empty), f"{of_images} no measurements: {_some(empty)}"),
        (
            len(few),
            f"{of_images} fewer than {orienting} measurements, which orient no image by "
            f"themselves: {_some(few)}",
        ),
        (unused.sum(), f"of {len(unused)} trajectory rows belong to no image"),
        (lost.sum(), f"{of_control} are not measured"),
        (
            len(pairs),
            f"{of_control} seem to be measured as tie points, under names that are written "
            f"otherwise: {written}",
        ),
    ):
        if n:
            yield f"{tables.name}: {n} {says}"


def _some(names: list[str]) -> str:
    return ", ".join(names[:5]) + (", …" if len(names) > 5 else "")


# --- A flight from tables in memory: the columns of the files, and the same checks and sentences


CONTROL = "control_points"
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
        ``images``, ``image_points``, ``trajectory``; if the block has its own,
        ``control_points``. A table is a DataFrame or a dict of arrays; its
        columns and units are those of the file of this name. Names may be whole numbers, a sigma
        may be infinite: not known.

    Raises
    ------
    FlightError
        With all problems, one line each, by table, row from 0, and column.
    """
    given_blocks = {"heads": heads, "calibration": calibration, "validation": validation}
    present = {name: tables for name, tables in given_blocks.items() if tables is not None}
    wrong = list(_missing(present, settings))
    if wrong:
        raise FlightError(lines_of(wrong))
    toml = Toml(folder=Path(), file="settings", values=_plain(settings), in_memory=True)
    none = dict.fromkeys(SCHEMAS[f"{CONTROL}.csv"].required, np.zeros(0))
    shared = none if control_points is None else control_points
    blocks = []
    for name, tables in present.items():
        made = {
            table: table_in_memory(columns, f"{name}.{table}", SCHEMAS[f"{table}.csv"])
            for table, columns in tables.items()
            if columns is not None or table != CONTROL
        }
        if CONTROL not in made:
            made[CONTROL] = table_in_memory(shared, CONTROL, SCHEMAS[f"{CONTROL}.csv"])
        control = made.pop(CONTROL)
        blocks.append(BlockTables(name=name, pictures=Path(), control=control, **made))
    flight = checked(toml, blocks)
    sums = {f"{b.name}/{t}.csv": getattr(b, t).sha256 for b in blocks for t in TABLES}
    return replace(flight, path=PLACE, pictures=PLACE, sha256=sums)


def _missing(blocks: Mapping[str, Tables], settings: object) -> Iterator[Problem]:
    """Yield missing blocks, and blocks and tables of a wrong type or name."""
    if not isinstance(settings, Mapping):
        yield whole("settings", "settings", f"is {kind_of(settings)}", "must be a dict")
    if not blocks:
        cure = "must have one at least: heads, calibration or validation"
        yield whole("flight", "blocks", "no block at all", cure)
    known = (*TABLES, CONTROL)
    for block, tables in blocks.items():
        if not isinstance(tables, Mapping):
            cure = f"must be a dict of the tables {', '.join(TABLES)}"
            yield whole(block, "tables", f"is {kind_of(tables)}", cure)
            continue
        for table in (table for table in tables if table not in known):
            fault = f"unknown table{did_you_mean(table, known)}"
            yield whole(block, str(table), fault, f"must be one of {', '.join(known)}")
        for table in (table for table in TABLES if table not in tables):
            yield whole(block, table, "missing", "required")


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
    images, measured = tables.images, tables.image_points
    if cameras := toml.table("cameras"):
        yield from _unknown(images, "camera", cameras, f"must be a camera of {toml.file}")
    row_in = "must have a row in {}"
    for table, column, other in (
        (images, "exposure", tables.trajectory),
        (measured, "image", images),
    ):
        if len(other) and other.whole and column in other.text:
            yield from _unknown(table, column, other.text[column], row_in.format(other.file))
    yield from _unknown(tables.control, "role", ("control", "check"), "must be control or check")
    yield from _time_problems(tables, toml)
    if tables.name == "heads":
        yield from _head_problems(images, toml)
    elif toml.get("synthetic", "measured_in") == "heads":
        yield from _other_cameras(images, toml, ", since measured_in is 'heads'")


def _time_problems(tables: BlockTables, toml: Toml) -> Iterator[Problem]:
    """Yield requested drifts, delays or correlations for which strips or times are missing."""
    keys, apriori = ("stages", "mounting", "gnss"), toml.table("apriori")
    asked = toml.get(*keys) if tables.name == "calibration" else None
    asked = asked if isinstance(asked, list) else []
    if not any(tables.images.text.get("strip", ())):
        cure = f"needs strips in {tables.images.file}, column strip"
        for name in (name for name in asked if name in ("drift", "delay")):
            yield toml.problem(keys, repr(name), cure)
    if len(tables.trajectory) and not tables.trajectory.has("time_s"):
        cure = f"needs times in {tables.trajectory.file}, column time_s"
        if "delay" in asked:
            yield toml.problem(keys, repr("delay"), cure)
        for key in (key for key in apriori if key.endswith("_correlation_s")):
            yield toml.problem(("apriori", key), quoted(apriori[key]), cure)


def _unknown(table: Table, column: str, known: Collection[str], cure: str) -> Iterator[Problem]:
    names, known = table.text.get(column, ()), dict.fromkeys(known)
    unknown = set(names) - known.keys() - {""}

    def problem(row: int) -> Problem:
        fault = f"{quoted(names[row])} is unknown{did_you_mean(names[row], known)}"
        return table.problem(row, column, fault, cure)

    rows = [row for row, name in enumerate(names) if name in unknown] if unknown else []
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
        hint = _other_file(inside, block, names[row]) if faults[names[row]] == ABSENT else ""
        return images.problem(row, "file", f"{fault}{hint}", expected)

    yield from counted(rows, wrong)


def _other_file(inside: Path, block: Path, name: str) -> str:
    """Return " (did you mean 'x'?)" where only case, slashes or the folder are others."""
    path = PurePosixPath(name.replace("\\", "/"))
    if path.is_absolute() or ".." in path.parts:
        return ""
    for folder in dict.fromkeys((path.parent, PurePosixPath("images"), PurePosixPath())):
        there = sorted((block / folder).glob("*")) if (block / folder).is_dir() else []
        for one in there:
            other = str(folder / one.name)
            if one.name.casefold() == path.name.casefold() and named_file(inside, block, other)[0]:
                return f" (did you mean {other!r}?)"
    return ""


def _head_problems(images: Table, toml: Toml) -> Iterator[Problem]:
    """Yield contradictions between the heads' images and the declared heads."""
    heads, cameras = toml.get("synthetic", "heads"), toml.table("cameras")
    if (settings := toml.table()) and "synthetic" not in settings:
        yield toml.problem(("synthetic",), "missing", "required, since there is a block heads")
    yield from _other_cameras(images, toml, "")
    if isinstance(heads, list) and images.whole and "camera" in images.text:
        for head in (h for h in heads if isinstance(h, str) and h in cameras):
            if head not in images.text["camera"]:
                cure = f"every head needs images in {images.file}"
                yield toml.problem(("synthetic", "heads"), f"{head!r} took no image", cure)


def _other_cameras(images: Table, toml: Toml, since: str) -> Iterator[Problem]:
    """Yield the images of declared cameras that are no heads."""
    heads, names = toml.get("synthetic", "heads"), images.text.get("camera", ())
    if isinstance(heads, list):
        others = {name for name in toml.table("cameras") if name not in heads}
        cure = f"must be one of synthetic.heads in {toml.file}{since}"
        yield from counted(
            [row for row, name in enumerate(names) if name in others],
            lambda row: images.problem(row, "camera", f"{names[row]!r} is no head", cure),
        )


def _uncalibrated_problems(blocks: Sequence[BlockTables], setup: Setup) -> Iterator[Problem]:
    """Yield cameras of the validation block that are not in the calibration block.

    Where both are transferred into the synthetic image, its camera is calibrated.
    """
    images = {tables.name: tables.images for tables in blocks}
    if setup.measured_in_heads or not {"calibration", "validation"} <= images.keys():
        return
    calibrated, validated = (images[name] for name in ("calibration", "validation"))
    for name in dict.fromkeys(validated.text["camera"]):
        if name not in calibrated.text["camera"]:
            row = validated.text["camera"].index(name)
            cure = f"must be a camera with images in {calibrated.file}"
            yield validated.problem(row, "camera", f"{name!r} is not calibrated", cure)


def _sensor_problems(tables: BlockTables, setup: Setup) -> Iterator[Problem]:
    """Yield measurements outside the sensor; rows with unknown names are not checked."""
    images, measured = tables.images, tables.image_points
    if images.has("image", "camera") and measured.has("image", "col_px", "row_px"):
        image_idx = index_of(measured.text["image"], images.text["image"])
        camera_idx = np.append(index_of(images.text["camera"], [*setup.cameras]), -1)[image_idx]
        for i, camera in enumerate(setup.cameras.values()):
            yield from _outside(measured, camera, np.flatnonzero(camera_idx == i))


def _outside(measured: Table, camera: Camera, rows: Index) -> Iterator[Problem]:
    """Yield the measurements of a camera outside its sensor."""
    colrow = measured.stack("col_px", "row_px")  # noqa: PD013 a flight's table
    rows = rows[np.isfinite(colrow[rows].sum(axis=1))]
    sides = np.array([camera.width_px, camera.height_px])
    in_mm = bool(np.all(np.abs(colrow[rows]) <= (sides + 1) / 2 * camera.pixel_mm))
    beyond = np.abs(colrow - (sides - 1) / 2) > sides / 2

    def wrong(row: int) -> Problem:
        axis = 0 if beyond[row, 0] else 1
        swapped = bool(inside(camera, colrow[row, ::-1]))
        hint = " (in mm from the middle?)" if in_mm else " (col and row swapped?)" * swapped
        cure = f"must lie on the sensor of {camera.name}, from -0.5 to {sides[axis] - 0.5}"
        fault = f"{colrow[row, axis]:.12g}{hint}"
        return measured.problem(row, ("col_px", "row_px")[axis], fault, cure)

    rows = rows[~inside(camera, colrow[rows])]
    yield from counted(rows[beyond[rows, 0]], wrong)
    yield from counted(rows[~beyond[rows, 0]], wrong)


def _position_problems(tables: BlockTables, grid: GridSystem) -> Iterator[Problem]:
    """Yield positions that the CRS or the geoid grid does not cover."""
    if not grid.is_local:
        yield from _off_map(tables.trajectory, np.flatnonzero(used_exposures(tables)), grid)
        yield from _off_map(tables.control, np.flatnonzero(measured_control(tables)), grid)
    elif "lat_deg" in tables.trajectory.numbers:
        cure = f"must be east_m, north_m, … kappa_deg, since crs is {LOCAL!r}"
        fault = "longitudes and latitudes of a flight on no map"
        yield tables.trajectory.problem(0, "lat_deg", fault, cure)


def _off_map(table: Table, rows: Index, grid: GridSystem) -> Iterator[Problem]:
    """Yield rows in degrees where metres are meant, and rows outside the CRS or the geoid grid."""
    crs, lonlat, column = quoted(grid.crs)[1:-1], lonlat_of(table.numbers, grid), "lat_deg"
    on_earth = np.isfinite(lonlat.sum(axis=1))
    if "east_m" in table.numbers:
        column, xy = "east_m", table.stack("east_m", "north_m")  # noqa: PD013 a flight's table
        on_earth[on_earth] = np.isfinite(grid.convergence(lonlat[on_earth]))

        def shown(row: int) -> str:
            return f"{xy[row, 0]:.12g}, {xy[row, 1]:.12g}"

        if of_degrees(grid, *xy.T):
            fault = f"{shown(0)} (longitude, latitude in degrees?)"
            yield table.problem(0, column, fault, f"must be metres where {crs} is meant for")
        cure = f"must be a position that {crs} covers, easting first"
        yield from counted(
            rows[~on_earth[rows]],
            lambda row: table.problem(row, column, f"{shown(row)} is nowhere", cure),
        )
    rows = rows[on_earth[rows]]

    def no_height(row: int) -> Problem:
        fault = f"no height is known at {lonlat[row, 1]:.4f}, {lonlat[row, 0]:.4f}"
        return table.problem(
            row, column, fault, f"must lie inside the geoid grid {grid.height_system}"
        )

    yield from counted(rows[~np.isfinite(grid.undulation(lonlat[rows]))], no_height)


def _height_problems(tables: BlockTables) -> Iterator[Problem]:
    """Yield exposures below their highest control point; without any, below all of the block."""
    measured = measured_control(tables)
    if not measured.any():
        return
    control, trajectory = tables.control, tables.trajectory
    height, flown = control.numbers["height_m"], trajectory.numbers["height_m"]
    point, exposure = _surveyed_rays(tables)
    rising = np.argsort(-height[point], kind="stable")[::-1]  # of equal heights the first is last
    above = np.full(len(flown), np.flatnonzero(measured)[np.argmin(height[measured])])
    above[exposure[rising]] = point[rising]
    below = flown <= height[above]
    feet = below.mean() > 0.5 and (flown > FOOT * height[above]).all()

    def problem(row: int) -> Problem:
        point = quoted(control.text["point"][above[row]])
        fault = f"{flown[row]:.12g} is below control point {point} at {height[above[row]]:g}"
        cure = f"must lie above the control points of {control.file}"
        return trajectory.problem(row, "height_m", fault + " (in feet?)" * bool(feet), cure)

    yield from counted(np.flatnonzero(used_exposures(tables) & below), problem)


def _surveyed_rays(tables: BlockTables) -> tuple[Index, Index]:
    """Return the rows of the surveyed point and of the exposure of each of its measurements."""
    images, measured = tables.images.text, tables.image_points.text
    point = index_of(measured["point"], tables.control.text["point"])
    flown = index_of(images["exposure"], tables.trajectory.text["exposure"])
    exposure = flown[index_of(measured["image"], images["image"])]
    return point[point >= 0], exposure[point >= 0]


# --- Notes on strange positions of points; they are no reason to refuse the flight


def _without_single_rows(tables: BlockTables, grid: GridSystem) -> BlockTables:
    """Drop single control points outside the CRS, or above all exposures that see them.

    A mistake in one row of many is a gross error; the adjustment will find it. Mistakes in many
    rows are a mistake of the table; then all rows stay. A point is too high if it is above half
    of the block's exposures as well, because a single exposure may be too low itself.
    """
    rows = np.flatnonzero(measured_control(tables))
    lonlat = lonlat_of(tables.control.numbers, grid)[rows]
    wrong = ~np.isfinite(lonlat.sum(axis=1))
    wrong[~wrong] = ~np.isfinite(grid.undulation(lonlat[~wrong]))
    height, flown = tables.control.numbers["height_m"], tables.trajectory.numbers["height_m"]
    point, exposure = _surveyed_rays(tables)
    highest = np.full(len(height), np.median(flown[used_exposures(tables)]))
    np.maximum.at(highest, point, flown[exposure])
    wrong |= height[rows] >= highest[rows]
    n = int(wrong.sum())
    if n > max(1, len(rows) // 10) or len(rows) - n < 3:
        return tables
    keep = np.ones(len(tables.control), dtype=bool)
    keep[rows[wrong]] = False
    return replace(tables, control=tables.control.select(keep))


def _control_notes(tables: BlockTables, block: Block) -> Iterator[str]:
    """Yield a note on surveyed points that project far from their measurements."""
    seen, ratio = misses(block)
    absurd = medians(ratio, seen.point_idx, len(seen.points)) > 4.0  # far outside the image
    far = {block.points[i] for i in seen.points[absurd]}
    control = tables.control
    line = {p: n for p, n in zip(control.text["point"], control.lines, strict=True) if p in far}
    if line:
        listed = _some([f"{name!r} ({control.counts} {n})" for name, n in line.items()])
        yield (
            f"{tables.name}: {len(line)} of {len(seen.points)} surveyed points of "
            f"{control.file} lie nowhere near where they were measured, and will be "
            f"rejected as gross errors if the others fit: {listed}"
        )


def _unobserved_parts(block: Block) -> tuple[str, ...]:
    """Return the mounting parts that the trajectory does not observe, named as in `fix`."""
    positions, attitudes = _observed(block)
    lever = () if positions and attitudes else ("lever_arm",)
    return lever if attitudes else (*lever, "boresight")


def _observed(block: Block) -> tuple[bool, bool]:
    """Tell whether positions and attitudes are observed at any exposure."""
    sigmas = (block.trajectory.sigma_position, block.trajectory.sigma_attitude)
    positions, attitudes = (bool(np.isfinite(sigma).all(axis=1).any()) for sigma in sigmas)
    return positions, attitudes


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
        lack = "no sigma of" if _observed(block)[0] else "neither sigma of positions nor"
        parts = " and ".join(name.replace("_", " ") for name in held)
        yield (
            f"{block.name}: the trajectory has {lack} attitudes, which are start values alone; "
            f"{parts} are held"
        )
    if lack := no_datum(block):
        yield lack


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


def crs_notes(grid: GridSystem, blocks: dict[str, Block]) -> Iterator[str]:
    """Yield notes on a CRS with heights of its own, and on blocks far outside its area of use."""
    if grid.is_local:
        return
    crs = pyproj.CRS.from_user_input(grid.crs)
    if crs.is_compound and grid.heights == "ellipsoidal":
        yield (
            "heights are ellipsoidal, as heights in flight.toml says, and not those of "
            f"{grid.crs}, {crs.sub_crs_list[1].name}"
        )
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
    beside_deg: float = 3.0,
) -> bool:
    """Tell whether a position lies in an area or near it; the area may cross the date line.

    Zones are used beyond their borders.
    """
    west, south, east, north = bounds
    wide = (east - west) % 360 or 360.0
    along = (lon - west + beside_deg) % 360
    near_north = south - beside_deg <= lat <= north + beside_deg
    return near_north and along <= wide + 2 * beside_deg


def _place(lon: float, lat: float) -> str:
    """Return a position as text, such as 25.4 S 49.3 W."""
    return f"{abs(lat):.1f} {'S' if lat < 0 else 'N'} {abs(lon):.1f} {'W' if lon < 0 else 'E'}"
