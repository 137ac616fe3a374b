"""``acx4 import opensfm | micmac | bundler | visualsfm | bingo | …``: other adjustments."""

from __future__ import annotations

import re
from typing import Annotated, Literal

import typer

from acx4book.command import terminal
from acx4book.command.exchange import bring
from acx4book.command.exchange.projects import Block, Camera, Crs, Orientations, OwnCrs, Source

NeededPixelUm = Annotated[
    float, typer.Option(metavar="UM", min=0.1, max=1000.0, show_default=False, help="Pixel size.")
]


def width_height(text: str) -> tuple[int, int]:
    """Return the two numbers of a size, or end the command."""
    found = re.fullmatch(r"(\d{1,6})[x×](\d{1,6})", text.strip(), re.ASCII | re.I)
    if found is None or "0" in (found[1].lstrip("0") or "0", found[2].lstrip("0") or "0"):
        terminal.refuse(f"--size {text}: must be width x height in pixels, such as 4000x3000")
    return int(found[1]), int(found[2])


Size = Annotated[
    str,
    typer.Option(
        metavar="WxH",
        show_default=False,
        callback=width_height,
        help="Size of the pictures: 4000x3000.",
    ),
]

OPENSFM = """Read a project of OpenSfM, ODM or WebODM: cameras, images, tracks, rigs, control.

SOURCE is the folder with reconstruction.json and tracks.csv, the folder of an ODM project, or one
file reconstruction.json, camera_models.json or cameras.json. Where a reconstruction by ODM has the
axes of UTM, the measured positions tell.

\b
Examples:
  acx4 import opensfm my_project --out my_flight
  acx4 import opensfm my_project --orientations adjusted --crs EPSG:25833 --out my_flight
"""


@bring.read_by("opensfm", of_flight=("crs",))
def opensfm(  # noqa: PLR0913, PLR0917 options of a command
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: Crs = None,
    camera: Camera = "adjusted",
    orientations: Orientations = "initial",
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a project of OpenSfM has of a flight."""


MICMAC = """Read MicMac's XML, version 1 or 2: calibration, orientations, measured, surveyed points.

SOURCE is the folder that holds Ori-* and the points (SetOfMesureAppuisFlottants,
DicoAppuisFlottant), one of several Ori-* in it, or one of these files. Distortion models ModRad,
ModPhgrStd, ModNoDist and the three fisheyes are read; others are refused by name. Of version 2
(MMVII) it is the folder with MMVII-PhgrProj, or one of Ori/* in that.

\b
Examples:
  acx4 import micmac my_project --out my_flight
  acx4 import micmac my_project/Ori-Ground --orientations adjusted --crs EPSG:2154 --out my_flight
"""

VISUALSFM = """Read VisualSFM's .nvm (NVM_V3): images, lenses, tie points.

Its coordinates are in no CRS: without --crs local its orientations are left out. The formulas are
those of its documentation; it is untried on a file that VisualSFM wrote.

\b
Example:
  acx4 import visualsfm model.nvm --size 4000x3000 --crs local --out my_flight
"""

BUNDLER = """Read Bundler's bundle.out (v0.3): images, lenses, tie points; many programs write it.

Names come from list.txt beside it. Its coordinates are in no CRS: without --crs local its
orientations are left out.

\b
Example:
  acx4 import bundler bundle.out --size 4000x3000 --crs local --out my_flight
"""

BINGO = """Read BINGO's image.dat, or *_bingo.txt of Pix4D; control points of geoin.dat beside it.

Image coordinates are in mm from the middle of the image. The layout is that which Pix4D documents;
it is untried on files that BINGO itself wrote.

\b
Example:
  acx4 import bingo image.dat --size 4000x3000 --pixel-um 6 --out my_flight
"""

PATB = """Read PAT-B's image coordinates, .im: untried on a file that PAT-B wrote.

Blocks of an image, its points and -99. Control and orientations of PAT-B are not read.

\b
Example:
  acx4 import patb my_block.im --unit um --size 4000x3000 --pixel-um 6 --out my_flight
"""

ODM_CONTROL = """Read ODM's gcp_list.txt: surveyed points and their places in the pictures.

The first line is the CRS; a height NaN makes a tie point of a point. Longitudes and latitudes are
written in the UTM zone where they lie, or in --crs.

\b
Examples:
  acx4 import odm-control gcp_list.txt --out my_flight
  acx4 import odm-control gcp_list.txt --camera CAM --crs EPSG:25833 --out my_flight
"""


LocalCrs = Annotated[
    Literal["local"] | None,
    typer.Option(help="local takes its coordinates as they are.", show_default=False),
]


@bring.read_by("micmac")
def micmac(
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: OwnCrs = None,
    orientations: Orientations = "initial",
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a folder of MicMac has of a flight."""


@bring.read_by("bundler")
def bundler(
    source: Source,
    size: Size,
    out: bring.Out,
    block: Block = None,
    crs: LocalCrs = None,
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what bundle.out has of a flight."""


@bring.read_by("visualsfm")
def visualsfm(
    source: Source,
    size: Size,
    out: bring.Out,
    block: Block = None,
    crs: LocalCrs = None,
    pixel_um: bring.PixelUm = None,
    allow: bring.Allow = 2.0,
) -> None:
    """Write what a model of VisualSFM has of a flight."""


@bring.read_by("photo_lists", reader="read_bingo")
def bingo(
    source: Source, size: Size, pixel_um: NeededPixelUm, out: bring.Out, block: Block = None
) -> None:
    """Write what a list of BINGO has of a flight."""


@bring.read_by("photo_lists", reader="read_patb")
def patb(
    source: Source,
    unit: Annotated[Literal["um", "mm"], typer.Option(show_default=False, help="Of x and y.")],
    size: Size,
    pixel_um: NeededPixelUm,
    out: bring.Out,
    block: Block = None,
) -> None:
    """Write what a list of PAT-B has of a flight."""


@bring.read_by("odm", of_flight=("crs",))
def odm_control(
    source: Source,
    out: bring.Out,
    block: Block = None,
    crs: Crs = None,
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            show_default=False,
            help="Camera of all pictures: then images.csv is written, too.",
        ),
    ] = None,
) -> None:
    """Write the control points of ODM and their measurements."""
