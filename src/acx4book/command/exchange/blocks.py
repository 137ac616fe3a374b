"""``acx4 import opensfm | micmac | bundler | bingo | patb | odm-…``: other adjustments."""

from __future__ import annotations

from typing import Annotated

import typer

from acx4book.command.exchange import bring
from acx4book.command.exchange.projects import Block, Camera, Crs, Orientations, Source

PixelUm = Annotated[
    float | None,
    typer.Option(
        metavar="UM",
        min=0.1,
        max=1000.0,
        show_default=False,
        help="Pixel size; without it 5 um, and only millimetres depend on it.",
    ),
]

OPENSFM = """Read a project of OpenSfM, ODM or WebODM: cameras, images, tracks, rigs, control.

SOURCE is the folder with reconstruction.json and tracks.csv, the folder of an ODM project, or one
file reconstruction.json, camera_models.json or cameras.json. Where a reconstruction by ODM has the
axes of UTM, the measured positions tell.

\\b
Examples:
  acx4 import opensfm my_project --out my_flight
  acx4 import opensfm my_project --orientations adjusted --crs EPSG:25833 --out my_flight
"""


def opensfm(
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: Crs = None,
    camera: Camera = "adjusted",
    orientations: Orientations = "initial",
    pixel_um: PixelUm = None,
) -> None:
    """Write what a project of OpenSfM has of a flight."""
    from acx4lib.exchange.programs.opensfm import reading  # noqa: PLC0415 quick help

    brought = reading.read(
        source, camera=camera, orientations=orientations, block=block, crs=crs, pixel_um=pixel_um
    )
    bring.place(brought, out)
