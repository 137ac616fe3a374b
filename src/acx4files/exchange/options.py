"""What a reader of other programs' files can be told, declared once: at its own parameters.

A parameter that is annotated with an `Option` stands on the command line as well, with its type and
its default: ``crs: Crs = ""`` is ``--crs``. One without is for calls from Python alone. The first
paragraphs of the reader's docstring, and its examples, are the help of its command.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal


@dataclass(frozen=True)
class Option:
    """How a parameter of a reader stands on the command line.

    Attributes
    ----------
    metavar : str
        Placeholder of its value; empty: its type says it.
    help : str
        Its line of help.
    low, high : float, optional
        Least and largest value.
    of_flight : bool
        Whether a flight that is there already gives it where it is not given.
    """

    metavar: str
    help: str
    low: float | None = None
    high: float | None = None
    of_flight: bool = False


Source = Option("SOURCE", "What the program wrote.")

BlockName = Literal["heads", "calibration", "validation"]

Block = Annotated[BlockName, Option("NAME", "heads, calibration or validation: where it belongs.")]
BlockOfProject = Annotated[
    BlockName | None,
    Option(
        "NAME", "heads, calibration or validation; by default heads for a rig, else calibration."
    ),
]
Crs = Annotated[
    str,
    Option(
        "EPSG:N",
        "Projected CRS of the flight, in metres; else that in its flight.toml.",
        of_flight=True,
    ),
]
CrsOfProject = Annotated[
    str | None,
    Option(
        "EPSG:N",
        "Projected CRS of the flight, in metres; by default that of its flight.toml, else the "
        "project's own.",
        of_flight=True,
    ),
]
CrsOfFiles = Annotated[
    str | None,
    Option(
        "EPSG:N",
        "Projected CRS, in metres, of the files' coordinates, which they do not say; local: as "
        "they are, on no map.",
    ),
]
Heights = Annotated[
    str | float | None,
    Option(
        "SYSTEM",
        "Of the flight: ellipsoidal, a vertical CRS, a geoid grid file or an undulation in m; "
        "else those in its flight.toml, or ellipsoidal.",
        of_flight=True,
    ),
]
HeightsOfFlight = Annotated[str | float | None, Option("", "", of_flight=True)]
"""Given by the flight that is there already, never on the command line."""

Columns = Annotated[
    str,
    Option(
        "WORDS", "Columns in their order, such as 'image time skip'; else its heading names them."
    ),
]
Camera = Annotated[
    str, Option("NAME", "Also write images.csv: one image of this camera for each exposure.")
]
Ellipsoidal = Annotated[bool, Option("", "Its heights are, whatever the flight's are.")]
Orientations = Annotated[
    Literal["initial", "adjusted", "none"],
    Option("", "Trajectory: what was measured of the cameras, what was adjusted, or none."),
]
AsAdjusted = Annotated[
    Literal["adjusted", "none"], Option("", "Trajectory: what was adjusted, or none.")
]
Allow = Annotated[
    float,
    Option("PX", "Largest difference of a lens that is refitted as a camera of a flight.", low=0.0),
]
PixelUm = Annotated[float, Option("UM", "Pixel size.", low=0.1, high=1000.0)]
PixelUmOfProject = Annotated[
    float | None,
    Option(
        "UM",
        "Pixel size, where the files do not have it; by default 5, and only millimetres depend on "
        "it.",
        low=0.1,
        high=1000.0,
    ),
]
