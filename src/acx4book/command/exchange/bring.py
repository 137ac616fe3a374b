"""What all kinds of ``acx4 import`` have in common: options, the flight written, what is said."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4tools.exchange.flight_folder import Brought

Out = Annotated[
    Path,
    typer.Option(
        metavar="FLIGHT",
        show_default=False,
        help="The flight: a new folder, or one that an import began, to which this is added.",
    ),
]
BLOCKS = ("heads", "calibration", "validation")


def known_block(name: str | None) -> str | None:
    """Return the name of a block of a flight, or none, or end the command."""
    if name not in {*BLOCKS, None}:
        terminal.refuse(f"--block: {name!r}: must be one of {', '.join(BLOCKS)}")
    return name


Block = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=known_block,
        help="heads, calibration or validation: where it belongs.",
    ),
]
Crs = Annotated[
    str,
    typer.Option(
        metavar="EPSG:N",
        show_default=False,
        help="Projected CRS of the flight, in metres; else that in its flight.toml.",
    ),
]
Heights = Annotated[
    str,
    typer.Option(
        metavar="SYSTEM",
        show_default=False,
        help="Of the flight: ellipsoidal, a vertical CRS, a geoid grid file or an undulation in m; "
        "else those in its flight.toml, or ellipsoidal.",
    ),
]

PixelUm = Annotated[
    float | None,
    typer.Option(
        "--pixel-um",
        metavar="UM",
        show_default=False,
        min=0.1,
        max=1000,
        help="Pixel size, where the files do not have it; by default 5, and only millimetres "
        "depend on it.",
    ),
]

Allow = Annotated[
    float,
    typer.Option(
        "--allow",
        metavar="PX",
        min=0.0,
        help="Largest difference of a lens that is refitted as a camera of a flight.",
    ),
]

LARGEST_UNDULATION_M = 200.0

TO_DO = 8
"""Lines on what a flight still lacks that are shown."""


def heights_of(text: str) -> str | float:
    """Return the heights of a flight by the text of an option: a number is an undulation."""
    try:
        undulation = float(text)
    except ValueError:
        file = Path(text)  # PROJ finds a grid by its whole path alone
        return str(file.absolute()) if file.is_file() else text
    if not abs(undulation) <= LARGEST_UNDULATION_M:
        terminal.refuse(f"--heights: {text}: must be at most {LARGEST_UNDULATION_M:g} m either way")
    return undulation


def system_of(out: Path, crs: str, heights: str) -> tuple[str, str | float]:
    """Return CRS and heights of a flight: what the options say, else its flight.toml.

    Parameters
    ----------
    out : Path
        Folder of the flight, which need not be there, nor have a flight.toml that is finished.
    crs, heights : str
        Options; empty where not given.

    Raises
    ------
    FlightError
        Where flight.toml cannot be read, or one of them can be no such thing.
    """
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help
    from acx4lib.flight.problems import lines_of  # noqa: PLC0415 quick help
    from acx4lib.flight.settings import FLIGHT  # noqa: PLC0415 quick help
    from acx4lib.flight.toml_file import read_toml  # noqa: PLC0415 quick help

    path = out / "flight.toml"
    toml = read_toml(path)
    known = toml.values
    problems = [one for one in toml.problems if one.column == "file" and path.exists()]
    for key in ("crs", "heights"):
        if known.get(key, "") != "":
            problems += FLIGHT.keys[key].problems(toml, (key,))
    if problems:
        raise FlightError(lines_of(problems))
    named = known.get("heights", "ellipsoidal")
    if isinstance(named, str) and (out / named).is_file():
        named = str((out / named).absolute())
    return crs or str(known.get("crs", "")), heights_of(heights) if heights else named


def read_by(
    module: str, *, of_flight: Sequence[str] = (), reader: str = "read"
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a declaration of options, which are those of a reader.

    The reader is imported when the command is called, so that help is quick.

    Parameters
    ----------
    module : str
        Of the reader, below `acx4tools.exchange.programs`.
    of_flight : sequence of str
        What a flight that was begun says where no option does: crs, or crs and heights.
    reader : str
        Function of the module.
    """

    def command_of(declared: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(declared)
        def command(source: Path, out: Path, **options: Any) -> None:
            begun, heights = system_of(out, "", "")
            if begun:
                known = {"crs": options.get("crs") or begun, "heights": heights}
                options |= {name: known[name] for name in of_flight}
            found = importlib.import_module(f"acx4tools.exchange.programs.{module}")
            place(getattr(found, reader)(source, **options), out)

        return command

    return command_of


def place(brought: Brought, out: Path) -> None:
    """Write what was brought, and say what was assumed, found and left out, and what is missing."""
    from acx4tools.exchange import flight_folder  # noqa: PLC0415 quick help

    if brought.settings and not (out / flight_folder.SETTINGS).is_file():
        named = {"name": out.resolve().name} | dict(brought.settings)
        brought = replace(brought, settings=named)
    brought = flight_folder.with_no_control(flight_folder.with_synthetic(brought), out)
    remarks = flight_folder.write(brought, out)
    terminal.show(brought.source)
    for title, sentences in (
        ("warning", brought.warnings),
        ("assumed", brought.assumed),
        ("found", (*brought.found, *remarks)),
        ("left out", brought.left_out),
    ):
        for sentence in sentences:
            terminal.show(f"  {title}: {sentence}")
    for line in missing(out):
        terminal.show(f"  {line}")
    terminal.show(out)


def missing(flight: Path) -> list[str]:
    """Return what a folder still lacks to be a flight, or what the readings of a flight say."""
    from acx4lib.conventions.search import notes  # noqa: PLC0415 quick help
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help
    from acx4lib.flight.reader import read  # noqa: PLC0415 quick help

    try:
        found = read(flight)
    except FlightError as error:
        lines = [f"still to do: {line}" for line in error.problems]
        more = [f"still to do: {len(lines) - TO_DO} more: acx4 check"] * (len(lines) > TO_DO)
        return lines[:TO_DO] + more
    return [f"check: {note}" for note in (*found.notes, *notes(found))]
