"""``acx4 import pictures``: a flight of pictures alone."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acx4book.command.exchange import bring

HELP = """Make a flight of a folder of pictures: what their EXIF and XMP say, no point is measured.

TIFF or JPEG of MicaSense, DJI and others: cameras with their factory's calibration, how the heads
are turned to each other, exposures, positions, attitudes, times. The pictures are linked into the
flight, or copied to another disk. Of several heads, `acx4 run --stages synthetic` finds tie points
in the pictures, and `acx4 render --blend stack` lays their bands over each other.

\b
Examples:
  acx4 import pictures my_pictures --out my_flight
  acx4 import pictures my_pictures --hold-out 2 --out my_flight
"""


def pictures(
    source: Annotated[
        Path, typer.Argument(metavar="FOLDER", show_default=False, help="Folder of the pictures.")
    ],
    out: bring.Out,
    crs: bring.Crs = "",
    pixel_um: Annotated[
        float | None,
        typer.Option(
            metavar="UM", min=0.1, max=100.0, show_default=False, help="Size of a pixel, if unsaid."
        ),
    ] = None,
    allow: bring.Allow = 2.0,
    hold_out: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=2,
            show_default=False,
            help="Every N exposures one is held out as block validation; the others are heads and "
            "calibration.",
        ),
    ] = None,
) -> None:
    """Make a flight of a folder of pictures."""
    from acx4tools.exchange.pictures import folder  # noqa: PLC0415 quick help

    crs, _ = bring.system_of(out, crs, "")
    brought = folder.bring(source, crs=crs, pixel_um=pixel_um, allow=allow, hold_out=hold_out)
    bring.place(brought, out)
