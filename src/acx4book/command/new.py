"""The command ``acx4 new``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from acx4book.command import importing, terminal

HELP = """Write a new flight to be filled in: a flight.toml with remarks, tables with their headers.

On a terminal it asks three questions, unless the options answer them. `acx4 import` adds to the
folder: its tables take the place of the empty ones, its settings are put into flight.toml. `acx4
check` names what is still to be filled in.

\b
Examples:
  acx4 new my_flight
  acx4 new my_flight --cameras RGB --crs EPSG:31982 --heights ellipsoidal
  acx4 new my_rig --cameras RED,GREEN,BLUE,NIR --crs EPSG:32633 --heights EPSG:5773
"""

QUESTIONS = {
    "cameras": ("Names of the cameras, commas between; several are heads of one rig", "CAM"),
    "crs": ("Projected CRS in metres, such as EPSG:31982", ""),
    "heights": (
        "Heights: ellipsoidal, a vertical CRS (EPSG:5773), a geoid grid file, an undulation in m",
        "ellipsoidal",
    ),
}


def new(
    folder: Annotated[Path, terminal.argument("FLIGHT", "New folder for the flight.")],
    *,
    cameras: Annotated[str, terminal.option("A,B", "One camera, or the heads of a rig.")] = "",
    crs: importing.Crs = "",
    heights: Annotated[
        str,
        terminal.option(
            "SYSTEM", "ellipsoidal, a vertical CRS, a geoid grid file, or an undulation in m."
        ),
    ] = "",
) -> None:
    """Write a new flight to be filled in."""
    answers = _answers({"cameras": cameras, "crs": crs, "heights": heights})
    from acx4lib.flight.tables import name_fault  # noqa: PLC0415 quick help
    from acx4lib.geometry.geodesy import grid_system  # noqa: PLC0415 quick help
    from acx4tools.exchange import flight_folder  # noqa: PLC0415 quick help
    from acx4tools.exchange.trajectories import orientations  # noqa: PLC0415 quick help
    from acx4tools.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    heads = [name.strip() for name in answers["cameras"].split(",") if name.strip()]
    name = folder.resolve().name
    for entered in (name, *heads):
        if fault := name_fault(entered):
            terminal.refuse(f"{fault[0]}; {fault[1]}")
    if len(set(heads)) != len(heads) or not heads:
        terminal.refuse(f"--cameras: {answers['cameras']!r}: must be names that are all different")
    try:
        _ = grid_system(answers["crs"])
    except ValueError as error:
        terminal.refuse(f"--crs: {error}; must be a projected CRS in metres")
    system = Meaning(crs=answers["crs"], heights=importing.heights_of(answers["heights"]))
    texts = flight_folder.files(name, cameras=heads, **orientations.settings(system))
    flight_folder.begin(folder, texts, orientations.grid_file(system))
    for line in importing.missing(folder):
        terminal.show(f"  {line}")
    terminal.show(folder)


def _answers(given: dict[str, str]) -> dict[str, str]:
    """Return the given options, and the answers to questions for the others."""
    unanswered = [name for name, value in given.items() if not value]
    if unanswered and not sys.stdin.isatty():
        options = ", ".join(f"--{name}" for name in unanswered)
        terminal.refuse(f"{options}: missing; on a terminal the command asks for them")
    asked = {
        name: typer.prompt(QUESTIONS[name][0], default=QUESTIONS[name][1] or None, err=True)
        for name in unanswered
    }
    return given | {name: str(answer).strip() for name, answer in asked.items()}
