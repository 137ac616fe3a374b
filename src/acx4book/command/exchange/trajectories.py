"""Kinds of ``acx4 import`` that bring where images were taken, and in which attitude."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from acx4book.command.exchange import bring

SBET_HELP = """Read an SBET trajectory of POSPac at the times of events.

EVENTS is a text with a row for each exposure: a name and a time. Its columns are named by its
heading, or by --columns. --time says on which clock the times are; where the trajectory counts GPS
time and the events UTC, or the reverse, --leap-seconds is needed: 18 since 2017.

\b
Examples:
  acx4 import sbet sbet.out --events events.csv --time gps-sow --smrmsg smrmsg.out --out flight
  acx4 import sbet sbet.out --events log.txt --columns "skip image time" --time iso-8601
      --leap-seconds 18 --out flight
"""


TABLE_HELP = """Read a table with a row for each image: its position and its attitude.

The columns are those of its heading, or of --columns: image, east, north, height or lat, lon,
height; omega, phi, kappa or roll, pitch, heading; camera, time, week, sigma_east, skip. An angle
may have its unit, as kappa_gon; else it is in --angles.

\b
Examples:
  acx4 import orientations eo.csv --crs EPSG:32633 --of camera --out flight
  acx4 import orientations ins.txt --columns "image lat lon height roll pitch heading" --out flight
"""

TEXT_HELP = """Read a text export of POSPac: exterior orientations, or the trajectory at events.

Columns and units are those of its heading. Omega, phi and kappa are the camera's: another
program's boresight is in them, and the flight has the camera in the place of the IMU. Roll, pitch
and heading are the IMU's: what a calibration needs.

\b
Example:
  acx4 import pospac-text event1.txt --crs EPSG:31982 --out flight
"""


Clock = Literal["gps-sow", "utc-sow"]
"""Of an SBET."""

Columns = Annotated[
    str,
    typer.Option(
        metavar="WORDS",
        show_default=False,
        help="Columns in their order, such as 'image time skip'; else its heading names them.",
    ),
]
Cells = Annotated[
    Literal["comma", "semicolon", "tab", "space"] | None,
    typer.Option(show_default=False, help="Between the cells; else found from the first line."),
]
Camera = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        show_default=False,
        help="Also write images.csv: one image of this camera for each exposure.",
    ),
]


def sbet(  # noqa: PLR0913 options of a command
    source: Annotated[Path, typer.Argument(metavar="SBET", show_default=False)],
    *,
    events: Annotated[
        Path,
        typer.Option(metavar="FILE", show_default=False, help="Names and times of exposures."),
    ],
    time: Annotated[
        Literal["gps-sow", "utc-sow", "gps-week-sow", "iso-8601", "iso-8601-utc", "iso-8601-gps"],
        typer.Option(show_default=False, help="Clock of the events."),
    ],
    out: bring.Out,
    smrmsg: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Standard deviations (SMRMSG)."),
    ] = None,
    trajectory_time: Annotated[Clock, typer.Option(help="Clock of the SBET.")] = "gps-sow",
    leap_seconds: Annotated[
        float | None,
        typer.Option(metavar="S", show_default=False, help="GPS time minus UTC; 18 since 2017."),
    ] = None,
    week: Annotated[
        int | None,
        typer.Option(
            metavar="N", show_default=False, help="GPS week in which the SBET begins; it says none."
        ),
    ] = None,
    gap: Annotated[
        float, typer.Option(metavar="S", help="Largest interval that is interpolated.")
    ] = 0.1,
    columns: Columns = "",
    separator: Cells = None,
    block: bring.Block = "calibration",
    camera: Camera = "",
    crs: bring.Crs = "",
    heights: bring.Heights = "",
) -> None:
    """Read an SBET at the times of events."""
    from acx4tools.exchange.trajectories import sbet as trajectories_sbet  # noqa: PLC0415 quick help
    from acx4tools.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = bring.system_of(out, crs, heights)
    options = trajectories_sbet.SbetOptions(
        time=time,
        columns=columns,
        separator=separator or "",
        trajectory_time=trajectory_time,
        leap_seconds=leap_seconds,
        week=week,
        gap_s=gap,
        block=block,
        camera=camera,
        meaning=Meaning(crs=crs, heights=system),
    )
    bring.place(trajectories_sbet.read(source, events, smrmsg, options), out)


def orientations(  # noqa: PLR0913 options of a command
    source: Annotated[Path, typer.Argument(metavar="TABLE", show_default=False)],
    *,
    out: bring.Out,
    columns: Columns = "",
    separator: Cells = None,
    angles: Annotated[
        Literal["deg", "gon", "rad"], typer.Option(help="Unit of angles that do not say it.")
    ] = "deg",
    order: Annotated[
        Literal["opk", "pok"], typer.Option(help="First rotation: omega (opk) or phi (pok).")
    ] = "opk",
    north: Annotated[
        Literal["grid", "true"] | None,
        typer.Option(show_default=False, help="Else kappa is from the grid, a heading from true."),
    ] = None,
    of: Annotated[
        Literal["imu", "camera"], typer.Option(help="Whose positions and attitudes they are.")
    ] = "imu",
    ellipsoidal: Annotated[
        bool, typer.Option("--ellipsoidal", help="Its heights are, whatever the flight's are.")
    ] = False,
    scaled_above: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            show_default=False,
            help="Heights above M have the map's scale, as IGN's; it is taken out.",
        ),
    ] = None,
    block: bring.Block = "calibration",
    camera: Camera = "",
    crs: bring.Crs = "",
    heights: bring.Heights = "",
) -> None:
    """Read a table of orientations with declared columns."""
    from acx4tools.exchange.trajectories import orientations as lists  # noqa: PLC0415 quick help
    from acx4tools.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = bring.system_of(out, crs, heights)
    meaning = Meaning(
        crs=crs,
        angle=angles,
        order=order,
        north=north or "",
        heights=system,
        ellipsoidal=ellipsoidal,
        ground_m=scaled_above,
    )
    options = lists.TableOptions(
        columns=columns,
        separator=separator or "",
        of=of,
        block=block,
        camera=camera,
    )
    bring.place(lists.read(source, meaning, options), out)


def pospac_text(
    source: Annotated[Path, typer.Argument(metavar="TEXT", show_default=False)],
    *,
    out: bring.Out,
    block: bring.Block = "calibration",
    camera: Camera = "",
    crs: bring.Crs = "",
    heights: bring.Heights = "",
) -> None:
    """Read a text export of POSPac."""
    from acx4tools.exchange.trajectories import orientations as lists  # noqa: PLC0415 quick help
    from acx4tools.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = bring.system_of(out, crs, heights)
    meaning = Meaning(crs=crs, heights=system)
    options = lists.TableOptions(block=block, camera=camera)
    bring.place(lists.read_applanix(source, meaning, options), out)
