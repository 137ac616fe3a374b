"""Read a flight whose image points are not measured yet, and write it with them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.flight.block_from_tables import BLOCKS, BlockTables, read_block, without_points
from acx4lib.flight.reader import Flight, checked, table_files
from acx4lib.flight.toml_file import read_toml
from acx4lib.opening import opened, text_of
from acx4lib.results import whole_files
from acx4lib.results.own_folder import OwnFolder

SETTINGS = "flight.toml"
"""The file that is written last: it makes the folder a flight, into which no command writes."""


@dataclass(frozen=True, kw_only=True)
class Measured:
    """One measurement for image_points.csv."""

    image: str
    point: str
    col_px: float
    row_px: float
    sigma_px: float


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
    folder = expected.folder("path", path, "the folder of a flight, with a flight.toml")
    names = [name for name in BLOCKS if (folder / name).is_dir()]
    if not names:
        problem = (
            f"{folder}: no block to measure; a flight has {', '.join(f'{n}/' for n in BLOCKS)}"
        )
        raise FlightError([problem])
    toml = read_toml(folder / "flight.toml")
    tables = {
        name: without_points(read_block(folder, name, pictures=folder), folder) for name in names
    }
    flight = checked(toml, list(tables.values()))
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


# --- the measured flight ---------------------------------------------------------------------


def copied(unmeasured: Unmeasured, own: OwnFolder) -> None:
    """Copy a flight's tables and pictures; image points and settings follow later.

    Pictures are linked where the file system can, so that they take no more space. Images without
    a picture and without measurements are left out.

    Parameters
    ----------
    unmeasured : Unmeasured
    own : OwnFolder
        Claimed for the measured flight.
    """
    flight = unmeasured.flight
    names = [name.as_posix() for name in table_files(flight)]
    pictures = dict(_pictures(flight))
    own_control = (f"{block}/control_points.csv" in names for block in flight.blocks)
    has_control = "control_points.csv" in names or all(own_control)
    missing = [] if has_control else ["control_points.csv"]
    own.expect([*names, *pictures, *missing])
    made = {
        f"{block}/images.csv": _used_images(unmeasured, block, tables)
        for block, tables in unmeasured.tables.items()
    } | dict.fromkeys(missing, b"point,east_m,north_m,height_m\n")
    for name in names:
        if name != SETTINGS and name not in made:
            _put(own.path / name, _content(flight.path / name))
    for name, content in made.items():
        _put(own.path / name, content)
    for name, source in pictures.items():
        target = own.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if not target.exists():
            whole_files.link(source, target)


def _used_images(unmeasured: Unmeasured, block: str, tables: BlockTables) -> bytes:
    """Return images.csv of a block with the images that have a picture or measurements."""
    files = unmeasured.flight.image_files[block]
    used = {*tables.image_points.text["image"]}
    used |= {n for n, path in zip(tables.images.text["image"], files, strict=True) if path}
    source = text_of(unmeasured.flight.path / block / "images.csv")
    rows = list(csv.reader(io.StringIO(source, newline="")))
    column = [name.strip() for name in rows[0]].index("image")
    kept = [rows[0], *(row for row in rows[1:] if row and row[column].strip() in used)]
    return _csv(kept)


def _csv(rows: Sequence[Sequence[str]]) -> bytes:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def _pictures(flight: Flight) -> Iterator[tuple[str, Path]]:
    """Yield the files of the flight's pictures, by their place below its folder."""
    for block, files in flight.image_files.items():
        names = _names_of(flight, block)
        for name, path in zip(names, files, strict=True):
            if path is not None and name:
                yield (PurePosixPath(block) / name).as_posix(), path


def _names_of(flight: Flight, block: str) -> Sequence[str]:
    """Return the cells of the column ``file`` of a block, empty where there is none."""
    inside = flight.pictures.resolve() / block
    return [
        "" if path is None else path.relative_to(inside).as_posix()
        for path in flight.image_files[block]
    ]


def finished(unmeasured: Unmeasured, own: OwnFolder) -> None:
    """Make a flight of a folder that has all tables, by its settings."""
    _put(own.path / SETTINGS, _content(unmeasured.flight.path / SETTINGS))
    own.seal()


def write_points(own: OwnFolder, block: str, rows: Sequence[Measured]) -> None:
    """Write the image points of a block."""
    name = f"{block}/image_points.csv"
    own.expect([name])
    header = ["image", "point", "col_px", "row_px", "sigma_px"]
    numbers = ([row.col_px, row.row_px, row.sigma_px] for row in rows)
    places = ([f"{number:.4f}" for number in three] for three in numbers)
    lines = ([row.image, row.point, *place] for row, place in zip(rows, places, strict=True))
    _put(own.path / name, _csv([header, *lines]))


def _content(path: Path) -> bytes:
    with opened(path) as file:
        return file.read()


def _put(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    whole_files.write(path, content)


def given(tables: BlockTables, sigma_px: float) -> list[Measured]:
    """Return the measurements that a block has already."""
    table = tables.image_points
    sigma = table.numbers.get("sigma_px", np.full(len(table), sigma_px))
    columns: Mapping[str, Sequence[str]] = table.text
    places = zip(table.numbers["col_px"], table.numbers["row_px"], sigma, strict=True)
    names = zip(columns["image"], columns["point"], strict=True)
    return [
        Measured(image=image, point=point, col_px=float(c), row_px=float(r), sigma_px=float(s))
        for (image, point), (c, r, s) in zip(names, places, strict=True)
    ]
