"""Reading a flight: everything that is wrong with it at once, or the whole flight."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from acx4lib import expected
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.flight.blocks import (
    BLOCKS,
    BlockTables,
    assemble,
    measured_control,
    read_block,
    used_exposures,
)
from acx4lib.flight.document import Toml, read_toml
from acx4lib.flight.fit import fit_problems
from acx4lib.flight.problems import Problem, lines_of
from acx4lib.flight.setup import Setup, named_file, setup_of
from acx4lib.flight.table_checks import (
    height_problems,
    name_problems,
    position_problems,
    sensor_problems,
    uncalibrated_problems,
)
from acx4lib.flight.toml_checks import toml_problems


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight(Setup):
    """A flight, read and found consistent.

    Attributes
    ----------
    path : Path
        Its folder.
    blocks : dict of str to Block
        Those of heads, calibration and validation that are there.
    image_files : dict of str to tuple of Path or None
        For every block the pixels of every image, where there are any.
    notes : tuple of str
        What is odd but allowed, a sentence each.
    """

    path: Path
    blocks: dict[str, Block]
    image_files: dict[str, tuple[Path | None, ...]]
    notes: tuple[str, ...]

    @property
    def heads(self) -> Block | None:
        """Block 1, every camera head on its own, where it is there."""
        return self.blocks.get("heads")

    @property
    def calibration(self) -> Block | None:
        """Block 2, synthetic or single-head images, where it is there."""
        return self.blocks.get("calibration")

    @property
    def validation(self) -> Block | None:
        """Block 3, the independent one, where it is there."""
        return self.blocks.get("validation")


def read(path: str | Path) -> Flight:
    """Return the flight in a folder.

    Parameters
    ----------
    path : str or Path
        Folder with a flight.toml.

    Returns
    -------
    Flight

    Raises
    ------
    FlightError
        With everything that is wrong, one line each, files named below `path` as it was given.
    """
    folder = expected.path("path", path)
    if not _is_folder(folder):
        raise FlightError(lines_of([_no_folder(folder)]))
    toml = read_toml(folder)
    blocks = [read_block(folder, name) for name in BLOCKS if (folder / name).is_dir()]
    problems = [*toml_problems(toml)]
    setup = None if problems else setup_of(toml)
    problems += [] if blocks else [_no_block(folder)]
    for tables in blocks:
        problems += _block_problems(tables, toml, setup)
    problems = problems or [*uncalibrated_problems(blocks)]
    if problems or setup is None:
        raise FlightError(lines_of(problems))
    notes = [f"{path} is in no block and is not read" for path in _strays(folder)]
    notes += [note for tables in blocks for note in _notes(tables)]
    return _flight(folder, setup, blocks, notes)


def read_kept(path: str | Path) -> Flight:
    """Return a flight whose tables a run has kept, checked when they were read first.

    Parameters
    ----------
    path : str or Path
        Folder with a flight.toml; the pixels need not be there.

    Raises
    ------
    FlightError
        Where a table cannot be read.
    """
    folder = Path(path)
    toml = read_toml(folder)
    blocks = [read_block(folder, name) for name in BLOCKS if (folder / name).is_dir()]
    problems = [*toml_problems(toml), *(p for b in blocks for t in b.tables for p in t.problems)]
    if problems:
        raise FlightError(lines_of(problems))
    return _flight(folder, setup_of(toml), blocks, [n for tables in blocks for n in _notes(tables)])


def table_files(flight: Flight) -> list[Path]:
    """Return the files that a flight was read from, but no pixels, below its folder."""
    tables = ("images.csv", "image_points.csv", "trajectory.csv", "control_points.csv")
    names = [Path("flight.toml"), Path("control_points.csv")]
    names += [Path(block) / name for block in flight.blocks for name in tables]
    geoid, inside = Path(flight.grid.heights), flight.path.resolve()
    if geoid.is_relative_to(inside):
        names.append(geoid.relative_to(inside))
    return [name for name in names if (flight.path / name).is_file()]


def _flight(
    folder: Path, setup: Setup, blocks: Sequence[BlockTables], notes: Iterable[str]
) -> Flight:
    """Put together what was found good."""
    return Flight(
        **{f.name: getattr(setup, f.name) for f in fields(setup)},
        path=folder,
        blocks={tables.name: assemble(tables, setup) for tables in blocks},
        image_files={tables.name: _image_files(tables, folder) for tables in blocks},
        notes=tuple(dict.fromkeys(notes)),
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


def _no_block(folder: Path) -> Problem:
    expected = f"needs at least one of the folders {', '.join(f'{name}/' for name in BLOCKS)}"
    stray = "".join(f" ({path} is in none)" for path in _strays(folder))
    found = f"no block at all{stray}"
    return Problem(file=str(folder), line=1, column="folder", found=found, expected=expected)


def _strays(folder: Path) -> list[str]:
    """Return the tables of images that stand in no block: its folder may be misspelt."""
    paths = [*folder.glob("images.csv"), *folder.glob("*/images.csv")]
    below = [path.relative_to(folder) for path in paths]
    return sorted(str(path) for path in below if path.parent.name not in BLOCKS)


def _block_problems(tables: BlockTables, toml: Toml, setup: Setup | None) -> list[Problem]:
    """Return what is wrong with a block; its geometry only where nothing else is."""
    problems = [problem for table in tables.tables for problem in table.problems]
    problems += name_problems(tables, toml)
    if setup is None:
        return problems
    problems += sensor_problems(tables, setup)
    problems = problems or [*position_problems(tables, setup.grid), *height_problems(tables)]
    return problems or [*fit_problems(tables, setup, toml)]


def _image_files(tables: BlockTables, folder: Path) -> tuple[Path | None, ...]:
    names = tables.images.text.get("file", ("",) * len(tables.images))
    return tuple(named_file(folder, folder / tables.name, n)[0] if n else None for n in names)


def _notes(tables: BlockTables) -> Iterator[str]:
    for table in tables.tables:
        yield from table.notes
    rays = Counter(tables.image_points.text["point"])
    ties = set(rays) - set(tables.control.text["point"])
    measured = set(tables.image_points.text["image"])
    images = [name for name in tables.images.text["image"] if name not in measured]
    rows, control = len(tables.trajectory), len(tables.control)
    for n, says in (
        (
            sum(rays[name] == 1 for name in ties),
            f"of {len(ties)} tie points are measured only once",
        ),
        (len(images), f"of {len(tables.images)} images have no measurements: {_some(images)}"),
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
