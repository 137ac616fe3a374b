"""``acx4 import metashape | colmap | opf``: projects of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from acx4book.command.exchange import bring

METASHAPE = """Read a project of Metashape: cameras, images, measured markers, control, orientations.

SOURCE is an XML file that Metashape exported (File > Export > Export Cameras, or Export Markers),
a project's .psx with its folder .files beside it, or a chunk.zip of that folder.

Only marker locations that were measured are taken, not those that Metashape computed itself. Tie
points are not in these files. The trajectory is what was measured of the cameras, where position
and angles are there; with --orientations adjusted it is Metashape's own adjustment, and then a
boresight means nothing.

\\b
Example:
  acx4 import metashape cameras.xml --out my_flight
  acx4 import metashape survey.psx --orientations adjusted --out my_flight
"""

Source = Annotated[
    Path, typer.Argument(metavar="SOURCE", show_default=False, help="What the program wrote.")
]
Block = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        show_default=False,
        help="heads, calibration or validation; by default heads for a rig, else calibration.",
    ),
]
Crs = Annotated[
    str | None,
    typer.Option(
        metavar="EPSG:N",
        show_default=False,
        help="Projected CRS of the flight, in metres; by default the project's own.",
    ),
]
Camera = Annotated[
    Literal["adjusted", "initial"],
    typer.Option(help="Which calibration is taken where the project has both."),
]
Orientations = Annotated[
    Literal["initial", "adjusted", "none"],
    typer.Option(help="Trajectory: what was measured of the cameras, what was adjusted, or none."),
]


def metashape(
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: Crs = None,
    camera: Camera = "adjusted",
    orientations: Orientations = "initial",
    chunk: Annotated[
        str | None,
        typer.Option(
            metavar="LABEL", show_default=False, help="Which chunk; by default the active one."
        ),
    ] = None,
) -> None:
    """Write what a project of Metashape has of a flight."""
    from acx4lib.exchange.programs.metashape import reading  # noqa: PLC0415 quick help

    brought = reading.read(
        source, camera=camera, orientations=orientations, block=block, crs=crs, chunk=chunk
    )
    bring.place(brought, out)
