"""``acx4 import metashape | colmap | opf | pix4d``: projects of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from acx4book.command.exchange import bring

METASHAPE = """Read a project of Metashape: cameras, images, markers, control, orientations.

SOURCE is an XML file that Metashape exported (File > Export > Export Cameras, or Export Markers),
a calibration that it saved, a project's .psx with its folder .files beside it, or a chunk.zip of
that folder.

Only marker locations that were measured are taken, not those that Metashape computed itself. Tie
points are not in these files. The trajectory is what was measured of the cameras, where position
and angles are there; with --orientations adjusted it is Metashape's own adjustment, and then a
boresight means nothing.

\b
Examples:
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
        callback=bring.known_block,
        help="heads, calibration or validation; by default heads for a rig, else calibration.",
    ),
]
Crs = Annotated[
    str | None,
    typer.Option(
        metavar="EPSG:N",
        show_default=False,
        help="Projected CRS of the flight, in metres; by default that of its flight.toml, else the "
        "project's own.",
    ),
]
OwnCrs = Annotated[
    str | None,
    typer.Option(
        metavar="EPSG:N",
        show_default=False,
        help="Projected CRS, in metres, of the files' coordinates, which they do not say; local: "
        "as they are, on no map.",
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


@bring.read_by("metashape", of_flight=("crs", "heights"))
def metashape(  # noqa: PLR0913, PLR0917 options of a command
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
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a project of Metashape has of a flight."""


COLMAP = """Read a model of COLMAP: cameras, rigs, images and tie points, text or binary.

SOURCE is the folder of a model, often sparse/0, with cameras, images and points3D as .bin or .txt;
rigs and frames of COLMAP 3.12 and later are read, too. Measurements that belong to no point are
left out. A model has no coordinate system: with --crs its x, y, z are east, north and height of
that system, or its earth-centred coordinates, and --orientations adjusted makes a trajectory of
its poses, on which a boresight means nothing. With --crs local they are taken as they are, and
`acx4 run` calibrates the cameras in a free network; a distances.csv gives it metres.

\b
Examples:
  acx4 import colmap sparse/0 --out my_flight
  acx4 import colmap sparse/0 --crs local --out my_flight
  acx4 import colmap aligned --crs EPSG:31982 --orientations adjusted --out my_flight
"""


@bring.read_by("colmap")
def colmap(
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: OwnCrs = None,
    orientations: Annotated[
        Literal["adjusted", "none"], typer.Option(help="Trajectory: what was adjusted, or none.")
    ] = "none",
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a model of COLMAP has of a flight."""


OPF = """Read a project in Pix4D's open photogrammetry format (OPF).

SOURCE is a file .opf, or a folder with it or with JSON files of OPF. Sensors with rig relatives,
images, tie points, control points with their marks and the measured orientations are taken; with
--orientations adjusted the trajectory is the calibrated cameras, and then a boresight means
nothing.

\b
Example:
  acx4 import opf project.opf --out my_flight
"""


@bring.read_by("opf", of_flight=("crs", "heights"))
def opf(  # noqa: PLR0913, PLR0917 options of a command
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: Crs = None,
    camera: Camera = "adjusted",
    orientations: Orientations = "initial",
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a project of OPF has of a flight."""


PIX4D = """Read the folder params of Pix4Dmapper: lenses, and the adjusted orientations.

SOURCE is that folder (1_initial/params), or the project's folder. From its files
*_calibrated_camera_parameters.txt and *_offset.xyz come lenses and poses, from *_wkt.prj the CRS.
*_pmatrix.txt and *_calibrated_external_camera_parameters.txt must agree with them: the differences
are told. A boresight on this trajectory means nothing. Tie points: acx4 import bingo.

\b
Example:
  acx4 import pix4d my_project/1_initial/params --out my_flight
"""


@bring.read_by("pix4d", of_flight=("crs", "heights"))
def pix4d(
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: Crs = None,
    orientations: Annotated[
        Literal["adjusted", "none"], typer.Option(help="Trajectory: what was adjusted, or none.")
    ] = "adjusted",
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a folder of Pix4D has of a flight."""
