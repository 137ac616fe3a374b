"""Kinds of ``acx4 import`` that bring tables of points: measured in images, or surveyed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from acx4book.command.exchange import bring
from acx4book.command.exchange.trajectories import Camera, Cells, Columns

MEASURED = """Read tables with a row for each point measured in an image, such as IGN's .mes.

The columns are those of its heading, or of --columns, in any order: point, image, col, row; sigma,
skip. They are pixels; --first says what the table calls the middle of the first pixel. Lines before
a heading are not read. What several tables have is put together.

\b
Examples:
  acx4 import image-points points.csv --first 0.5 --out flight
  acx4 import image-points ties.mes control.mes --columns "point image col row" --out flight
"""

SURVEYED = """Read a table with a row for each surveyed point, such as IGN's .app.

The columns are those of its heading, or of --columns, in any order: point, east, north, height or
lat, lon, height; sigma_east, sigma_north, sigma_height, role (control or check), skip.

\b
Examples:
  acx4 import control-points control.csv --crs EPSG:32633 --out flight
  acx4 import control-points block.app --columns "point skip x y z" --role check --out flight
"""


def image_points(
    sources: Annotated[list[Path], typer.Argument(metavar="TABLE...", show_default=False)],
    *,
    out: bring.Out,
    columns: Columns = "",
    separator: Cells = None,
    first: Annotated[
        Literal["0", "0.5", "1"],
        typer.Option(help="Column and row that it gives the middle of the first pixel."),
    ] = "0",
    block: bring.Block = "calibration",
    camera: Camera = "",
) -> None:
    """Read a table of measurements with declared columns."""
    from acx4tools.exchange.trajectories import point_tables  # noqa: PLC0415 quick help

    options = point_tables.MeasuredOptions(
        columns=columns,
        separator=separator or "",
        first=float(first),
        block=block,
        camera=camera,
    )
    bring.place(point_tables.measured(sources, options), out)


def control_points(  # noqa: PLR0913 options of a command
    source: Annotated[Path, typer.Argument(metavar="TABLE", show_default=False)],
    *,
    out: bring.Out,
    columns: Columns = "",
    separator: Cells = None,
    role: Annotated[
        Literal["control", "check"] | None,
        typer.Option(show_default=False, help="Of points whose role no column says; else control."),
    ] = None,
    ellipsoidal: Annotated[
        bool, typer.Option("--ellipsoidal", help="Its heights are, whatever the flight's are.")
    ] = False,
    crs: bring.Crs = "",
    heights: bring.Heights = "",
) -> None:
    """Read a table of surveyed points with declared columns."""
    from acx4tools.exchange.trajectories import point_tables  # noqa: PLC0415 quick help
    from acx4tools.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = bring.system_of(out, crs, heights)
    meaning = Meaning(crs=crs, heights=system, ellipsoidal=ellipsoidal)
    brought = point_tables.surveyed(
        source, meaning, columns=columns, separator=separator or "", role=role or ""
    )
    bring.place(brought, out)
