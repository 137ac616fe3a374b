"""Kinds of ``acx4 import`` that bring where images were taken, and in which attitude."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from acx4book.command.exchange import bring

SBET_HELP = """Read an SBET trajectory of POSPac at the times of events.

EVENTS is a text with a row for each exposure: a name and a time. Its columns are named by its
heading, or by --columns. --time says on which clock the times are; where the trajectory counts GPS
time and the events UTC, or the reverse, --leap-seconds is needed: 18 since 2017.

\b
Examples:
  acx4 import sbet sbet_m1.out --events events.csv --time gps-sow --smrmsg smrmsg_m1.out --out flight
  acx4 import sbet sbet.out --events log.txt --columns "skip image time" --time iso-8601
      --leap-seconds 18 --out flight
"""


class Time(StrEnum):
    """Clocks of events; the values of `times.BASES`."""

    GPS_SOW = "gps-sow"
    UTC_SOW = "utc-sow"
    GPS_WEEK_SOW = "gps-week-sow"
    ISO_8601 = "iso-8601"
    ISO_8601_UTC = "iso-8601-utc"
    ISO_8601_GPS = "iso-8601-gps"


class Clock(StrEnum):
    """Clocks of an SBET."""

    GPS_SOW = "gps-sow"
    UTC_SOW = "utc-sow"


class Separator(StrEnum):
    """What stands between cells."""

    COMMA = "comma"
    SEMICOLON = "semicolon"
    TAB = "tab"
    SPACE = "space"


Columns = Annotated[
    str,
    typer.Option(
        metavar="WORDS",
        show_default=False,
        help="Columns in their order, such as 'image time skip'; else its heading names them.",
    ),
]
Cells = Annotated[
    Separator | None,
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
    events: Annotated[
        Path,
        typer.Option(metavar="FILE", show_default=False, help="Names and times of exposures."),
    ],
    time: Annotated[Time, typer.Option(show_default=False, help="Clock of the events.")],
    out: bring.Out,
    smrmsg: Annotated[
        Path | None,
        typer.Option(metavar="FILE", show_default=False, help="Standard deviations (SMRMSG)."),
    ] = None,
    trajectory_time: Annotated[Clock, typer.Option(help="Clock of the SBET.")] = Clock.GPS_SOW,
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
) -> None:
    """Read an SBET at the times of events."""
    from acx4lib.exchange.trajectories import pospac  # noqa: PLC0415 quick help

    options = pospac.Options(
        time=time.value,
        columns=columns,
        separator=separator.value if separator else "",
        trajectory_time=trajectory_time.value,
        leap_seconds=leap_seconds,
        week=week,
        gap_s=gap,
        block=block,
        camera=camera,
        crs=crs,
    )
    bring.place(pospac.read(source, events, smrmsg, options), out)
