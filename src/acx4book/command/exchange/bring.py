"""What all kinds of ``acx4 import`` have in common: options, the flight written, what is said."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4lib.exchange.brought import Brought

Out = Annotated[
    Path,
    typer.Option(
        metavar="FLIGHT",
        show_default=False,
        help="The flight: a new folder, or one that an import began, to which this is added.",
    ),
]
Block = Annotated[
    str, typer.Option(metavar="NAME", help="heads, calibration or validation: where it belongs.")
]
Crs = Annotated[
    str,
    typer.Option(
        metavar="EPSG:N", show_default=False, help="Projected CRS of the flight, in metres."
    ),
]
Heights = Annotated[
    str,
    typer.Option(
        metavar="SYSTEM",
        help="Of the flight: ellipsoidal, a vertical CRS, a geoid grid file, an undulation in m.",
    ),
]

TO_DO = 8
"""Lines on what a flight still lacks that are shown."""


def heights_of(text: str) -> str | float:
    """Return the heights of a flight by the text of an option: a number is an undulation."""
    try:
        return float(text)
    except ValueError:
        return text


def place(brought: Brought, out: Path) -> None:
    """Write what was brought, and say what was assumed, found and left out, and what is missing."""
    from acx4lib.exchange import flight_folder  # noqa: PLC0415 quick help

    remarks = flight_folder.write(brought, out)
    terminal.show(brought.source)
    for title, sentences in (
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
