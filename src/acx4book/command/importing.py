"""The command ``acx4 import``: a command for every kind of files."""

from __future__ import annotations

import importlib
import re
from collections.abc import Sequence
from dataclasses import replace
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4files.exchange.flight_folder import ImportedFlight

HELP = """Read other programs' files, and write a flight, or a part of one.

Every kind says on the screen, and in import.md of the flight, which conventions it assumed, what it
found, and what it left out. A flight may come from several sources: each import adds its tables to
the folder. What is still missing is named at the end.

\b
Examples:
  acx4 import metashape project.xml --out my_flight
  acx4 import sbet a.out --events log.csv --time gps-sow --out my_flight
"""

KINDS = {
    "Where images were taken, and in which attitude": ("sbet", "pospac-text", "orientations"),
    "Points measured in images, and surveyed": ("image-points", "control-points"),
    "Pictures alone": ("pictures",),
    "Projects": ("metashape", "colmap", "opf", "pix4d"),
    "Blocks and adjustments": ("opensfm", "micmac", "bingo", "patb", "odm-control"),
}
"""The kinds grouped by their content, in the order of the help."""


class _Grouped(TyperGroup):
    """Group of commands with a help that lists the kinds by their content."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a list for each group of kinds."""
        for title, names in KINDS.items():
            commands = {name: self.get_command(ctx, name) for name in names}
            rows = [
                (name, command.get_short_help_str(limit=150))
                for name, command in commands.items()
                if command
            ]
            with formatter.section(title):
                formatter.write_dl(rows)


app = typer.Typer(cls=_Grouped, no_args_is_help=True, rich_markup_mode=None, help=HELP)

# --- what all kinds have in common: options, the flight written, what is said

Out = Annotated[
    Path,
    terminal.option(
        "FLIGHT", "The flight: a new folder, or one that an import began, to which this is added."
    ),
]
BLOCKS = ("heads", "calibration", "validation")


def _known_block(name: str | None) -> str | None:
    """Return the name of a block of a flight, or none, or end the command."""
    if name not in {*BLOCKS, None}:
        terminal.refuse(f"--block: {name!r}: must be one of {', '.join(BLOCKS)}")
    return name


Block = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        callback=_known_block,
        help="heads, calibration or validation: where it belongs.",
    ),
]
Crs = Annotated[
    str,
    terminal.option(
        "EPSG:N", "Projected CRS of the flight, in metres; else that in its flight.toml."
    ),
]
Heights = Annotated[
    str,
    terminal.option(
        "SYSTEM",
        "Of the flight: ellipsoidal, a vertical CRS, a geoid grid file or an undulation in m; "
        "else those in its flight.toml, or ellipsoidal.",
    ),
]

Allow = Annotated[
    float,
    typer.Option(
        "--allow",
        metavar="PX",
        min=0.0,
        help="Largest difference of a lens that is refitted as a camera of a flight.",
    ),
]

LARGEST_UNDULATION_M = 200.0


TO_DO = 8
"""Largest number of lines on missing parts of a flight."""


def heights_of(text: str) -> str | float:
    """Return the heights of a flight from the text of an option; a number is an undulation, m."""
    try:
        undulation = float(text)
    except ValueError:
        file = Path(text)  # PROJ needs the absolute path of a grid
        return str(file.absolute()) if file.is_file() else text
    if not abs(undulation) <= LARGEST_UNDULATION_M:
        terminal.refuse(f"--heights: {text}: must be at most {LARGEST_UNDULATION_M:g} m either way")
    return undulation


def system_of(out: Path, crs: str, heights: str) -> tuple[str, str | float]:
    """Return CRS and heights of a flight from the options, else from its flight.toml."""
    from acx4files.flight.problems import lines_of  # noqa: PLC0415 quick help
    from acx4files.flight.settings import FLIGHT  # noqa: PLC0415 quick help
    from acx4files.flight.toml_file import read_toml  # noqa: PLC0415 quick help
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help

    path = out / "flight.toml"
    toml = read_toml(path)
    known = toml.values
    problems = [problem for problem in toml.problems if problem.column == "file" and path.exists()]
    for key in ("crs", "heights"):
        if known.get(key, "") != "":
            problems += FLIGHT.keys[key].problems(toml, (key,))
    if problems:
        raise FlightError(lines_of(problems))
    named = known.get("heights", "ellipsoidal")
    if isinstance(named, str) and (out / named).is_file():
        named = str((out / named).absolute())
    return crs or str(known.get("crs", "")), heights_of(heights) if heights else named


def _parameter(name: str, means: Any, info: Any, default: Any = Parameter.empty) -> Parameter:
    """Return a keyword-only option of a command, with its type and its typer information."""
    annotation = Annotated[means, info]
    return Parameter(name, Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _program(
    name: str,
    help_text: str,
    options: Sequence[Parameter],
    *,
    of_flight: Sequence[str] = (),
    reader: str = "",
) -> None:
    """Make a command of a reader below `acx4files.exchange.programs`; its options are the reader's.

    The reader is imported when the command is called, so that help is quick. A flight that is
    already in the output folder gives the options `of_flight`.
    """
    module, _, function = (reader or name).partition(".")

    def command(source: Path, out: Path, **given: Any) -> None:
        begun, heights = system_of(out, "", "")
        if begun:
            known = {"crs": given.get("crs") or begun, "heights": heights}
            given |= {key: known[key] for key in of_flight}
        program = importlib.import_module(f"acx4files.exchange.programs.{module}")
        _place(getattr(program, function or "read")(source, **given), out)

    needed = [option for option in options if option.default is Parameter.empty]
    others = [option for option in options if option not in needed]
    parameters = [SOURCE, *needed, OUT, *others]
    command.__annotations__ = {option.name: option.annotation for option in parameters}
    command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    app.command(name, help=help_text)(command)


def _place(imported: ImportedFlight, out: Path) -> None:
    """Write imported data, and report assumptions, findings, omissions and missing parts."""
    from acx4files.exchange import flight_folder  # noqa: PLC0415 quick help

    if imported.settings and not (out / flight_folder.SETTINGS).is_file():
        named = {"name": out.resolve().name} | dict(imported.settings)
        imported = replace(imported, settings=named)
    imported = flight_folder.with_no_control(flight_folder.with_synthetic(imported), out)
    remarks = flight_folder.write(imported, out)
    terminal.show(imported.source)
    for title, sentences in (
        ("warning", imported.warnings),
        ("assumed", imported.assumed),
        ("found", (*imported.found, *remarks)),
        ("left out", imported.left_out),
    ):
        for sentence in sentences:
            terminal.show(f"  {title}: {sentence}")
    for line in missing(out):
        terminal.show(f"  {line}")
    terminal.show(out)


def missing(flight: Path) -> list[str]:
    """Return lines on missing parts of a flight, or notes on the conventions of a whole one."""
    from acx4files.conventions import notes  # noqa: PLC0415 quick help
    from acx4files.flight.reader import read  # noqa: PLC0415 quick help
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help

    try:
        flown = read(flight)
    except FlightError as error:
        lines = [f"still to do: {line}" for line in error.problems]
        more = [f"still to do: {len(lines) - TO_DO} more: acx4 check"] * (len(lines) > TO_DO)
        return lines[:TO_DO] + more
    return [f"check: {note}" for note in (*flown.notes, *notes(flown))]


# --- where images were taken, and in which attitude


Clock = Literal["gps-sow", "utc-sow"]
"""Time scale of an SBET."""

Columns = Annotated[
    str,
    terminal.option(
        "WORDS", "Columns in their order, such as 'image time skip'; else its heading names them."
    ),
]
Cells = Annotated[
    Literal["comma", "semicolon", "tab", "space"] | None,
    typer.Option(show_default=False, help="Between the cells; else found from the first line."),
]
Camera = Annotated[
    str,
    terminal.option("NAME", "Also write images.csv: one image of this camera for each exposure."),
]


@app.command(
    "sbet",
    help="""Read an SBET trajectory of POSPac at the times of events.

EVENTS is a text with a row for each exposure: a name and a time. Its columns are named by its
heading, or by --columns. --time says on which clock the times are; where the trajectory counts GPS
time and the events UTC, or the reverse, --leap-seconds is needed: 18 since 2017.

\b
Examples:
  acx4 import sbet sbet.out --events events.csv --time gps-sow --smrmsg smrmsg.out --out flight
  acx4 import sbet sbet.out --events log.txt --columns "skip image time" --time iso-8601
      --leap-seconds 18 --out flight
""",
)
def _sbet(  # noqa: PLR0913 options of a command
    source: Annotated[Path, terminal.argument("SBET")],
    *,
    events: Annotated[Path, terminal.option("FILE", "Names and times of exposures.")],
    time: Annotated[
        Literal["gps-sow", "utc-sow", "gps-week-sow", "iso-8601", "iso-8601-utc", "iso-8601-gps"],
        typer.Option(show_default=False, help="Clock of the events."),
    ],
    out: Out,
    smrmsg: Annotated[Path | None, terminal.option("FILE", "Standard deviations (SMRMSG).")] = None,
    trajectory_time: Annotated[Clock, typer.Option(help="Clock of the SBET.")] = "gps-sow",
    leap_seconds: Annotated[
        float | None, terminal.option("S", "GPS time minus UTC; 18 since 2017.")
    ] = None,
    week: Annotated[
        int | None, terminal.option("N", "GPS week in which the SBET begins; it says none.")
    ] = None,
    gap: Annotated[
        float, typer.Option(metavar="S", help="Largest interval that is interpolated.")
    ] = 0.1,
    columns: Columns = "",
    separator: Cells = None,
    block: Block = "calibration",
    camera: Camera = "",
    crs: Crs = "",
    heights: Heights = "",
) -> None:
    """Read an SBET at the times of events."""
    from acx4files.exchange.trajectories import sbet  # noqa: PLC0415 quick help
    from acx4files.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = system_of(out, crs, heights)
    options = sbet.SbetOptions(
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
    _place(sbet.read(source, events, smrmsg, options), out)


@app.command(
    "orientations",
    help="""Read a table with a row for each image: its position and its attitude.

The columns are those of its heading, or of --columns: image, east, north, height or lat, lon,
height; omega, phi, kappa or roll, pitch, heading; camera, time, week, sigma_east, skip. An angle
may have its unit, as kappa_gon; else it is in --angles.

\b
Examples:
  acx4 import orientations eo.csv --crs EPSG:32633 --of camera --out flight
  acx4 import orientations ins.txt --columns "image lat lon height roll pitch heading" --out flight
""",
)
def _orientations(  # noqa: PLR0913 options of a command
    source: Annotated[Path, terminal.argument("TABLE")],
    *,
    out: Out,
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
        terminal.option("M", "Heights above M have the map's scale, as IGN's; it is taken out."),
    ] = None,
    block: Block = "calibration",
    camera: Camera = "",
    crs: Crs = "",
    heights: Heights = "",
) -> None:
    """Read a table of orientations with declared columns."""
    from acx4files.exchange.trajectories import orientations  # noqa: PLC0415 quick help
    from acx4files.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = system_of(out, crs, heights)
    meaning = Meaning(
        crs=crs,
        angle=angles,
        order=order,
        north=north or "",
        heights=system,
        ellipsoidal=ellipsoidal,
        ground_m=scaled_above,
    )
    options = orientations.TableOptions(
        columns=columns,
        separator=separator or "",
        of=of,
        block=block,
        camera=camera,
    )
    _place(orientations.read(source, meaning, options), out)


@app.command(
    "pospac-text",
    help="""Read a text export of POSPac: exterior orientations, or the trajectory at events.

Columns and units are those of its heading. Omega, phi and kappa are the camera's: another
program's boresight is in them, and the flight has the camera in the place of the IMU. Roll, pitch
and heading are the IMU's: what a calibration needs.

\b
Example:
  acx4 import pospac-text event1.txt --crs EPSG:31982 --out flight
""",
)
def _pospac_text(
    source: Annotated[Path, terminal.argument("TEXT")],
    *,
    out: Out,
    block: Block = "calibration",
    camera: Camera = "",
    crs: Crs = "",
    heights: Heights = "",
) -> None:
    """Read a text export of POSPac."""
    from acx4files.exchange.trajectories import orientations  # noqa: PLC0415 quick help
    from acx4files.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = system_of(out, crs, heights)
    meaning = Meaning(crs=crs, heights=system)
    options = orientations.TableOptions(block=block, camera=camera)
    _place(orientations.read_pospac(source, meaning, options), out)


# --- points measured in images, and surveyed


@app.command(
    "image-points",
    help="""Read tables with a row for each point measured in an image, such as IGN's .mes.

The columns are those of its heading, or of --columns, in any order: point, image, col, row; sigma,
skip. They are pixels; --first says what the table calls the middle of the first pixel. Lines before
a heading are not read. What several tables have is put together.

\b
Examples:
  acx4 import image-points points.csv --first 0.5 --out flight
  acx4 import image-points ties.mes control.mes --columns "point image col row" --out flight
""",
)
def _image_points(
    sources: Annotated[list[Path], terminal.argument("TABLE...")],
    *,
    out: Out,
    columns: Columns = "",
    separator: Cells = None,
    first: Annotated[
        Literal["0", "0.5", "1"],
        typer.Option(help="Column and row that it gives the middle of the first pixel."),
    ] = "0",
    block: Block = "calibration",
    camera: Camera = "",
) -> None:
    """Read a table of measurements with declared columns."""
    from acx4files.exchange.trajectories import orientations  # noqa: PLC0415 quick help

    options = orientations.MeasuredOptions(
        columns=columns,
        separator=separator or "",
        first=float(first),
        block=block,
        camera=camera,
    )
    _place(orientations.measured(sources, options), out)


@app.command(
    "control-points",
    help="""Read a table with a row for each surveyed point, such as IGN's .app.

The columns are those of its heading, or of --columns, in any order: point, east, north, height or
lat, lon, height; sigma_east, sigma_north, sigma_height, role (control or check), skip.

\b
Examples:
  acx4 import control-points control.csv --crs EPSG:32633 --out flight
  acx4 import control-points block.app --columns "point skip x y z" --role check --out flight
""",
)
def _control_points(  # noqa: PLR0913 options of a command
    source: Annotated[Path, terminal.argument("TABLE")],
    *,
    out: Out,
    columns: Columns = "",
    separator: Cells = None,
    role: Annotated[
        Literal["control", "check"] | None,
        typer.Option(show_default=False, help="Of points whose role no column says; else control."),
    ] = None,
    ellipsoidal: Annotated[
        bool, typer.Option("--ellipsoidal", help="Its heights are, whatever the flight's are.")
    ] = False,
    crs: Crs = "",
    heights: Heights = "",
) -> None:
    """Read a table of surveyed points with declared columns."""
    from acx4files.exchange.trajectories import orientations  # noqa: PLC0415 quick help
    from acx4files.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help

    crs, system = system_of(out, crs, heights)
    meaning = Meaning(crs=crs, heights=system, ellipsoidal=ellipsoidal)
    imported = orientations.surveyed(
        source, meaning, columns=columns, separator=separator or "", role=role or ""
    )
    _place(imported, out)


# --- pictures alone


@app.command(
    "pictures",
    help="""\
Make a flight of a folder of pictures: what their EXIF and XMP say, no point is measured.

TIFF or JPEG of MicaSense, DJI and others: cameras with their factory's calibration, how the heads
are turned to each other, exposures, positions, attitudes, times. The pictures are linked into the
flight, or copied to another disk. Of several heads, `acx4 run --stages synthetic` finds tie points
in the pictures, and `acx4 render --blend stack` lays their bands over each other.

\b
Examples:
  acx4 import pictures my_pictures --out my_flight
  acx4 import pictures my_pictures --hold-out 2 --out my_flight
""",
)
def _pictures(
    source: Annotated[Path, terminal.argument("FOLDER", "Folder of the pictures.")],
    out: Out,
    crs: Crs = "",
    pixel_um: Annotated[
        float | None, terminal.option("UM", "Size of a pixel, if unsaid.", min=0.1, max=100.0)
    ] = None,
    allow: Allow = 2.0,
    hold_out: Annotated[
        int | None,
        terminal.option(
            "N",
            "Every N exposures one is held out as block validation; the others are heads and "
            "calibration.",
            min=2,
        ),
    ] = None,
) -> None:
    """Make a flight of a folder of pictures."""
    from acx4files.exchange import pictures  # noqa: PLC0415 quick help

    crs, _ = system_of(out, crs, "")
    imported = pictures.read_folder(
        source, crs=crs, pixel_um=pixel_um, allow=allow, hold_out=hold_out
    )
    _place(imported, out)


# --- projects


SOURCE = _parameter("source", Path, terminal.argument("SOURCE", "What the program wrote."))
OUT = Parameter("out", Parameter.KEYWORD_ONLY, annotation=Out)
BLOCK = _parameter(
    "block",
    str | None,
    terminal.option(
        "NAME",
        "heads, calibration or validation; by default heads for a rig, else calibration.",
        callback=_known_block,
    ),
    None,
)
CRS = _parameter(
    "crs",
    str | None,
    terminal.option(
        "EPSG:N",
        "Projected CRS of the flight, in metres; by default that of its flight.toml, else the "
        "project's own.",
    ),
    None,
)
OWN_CRS = _parameter(
    "crs",
    str | None,
    terminal.option(
        "EPSG:N",
        "Projected CRS, in metres, of the files' coordinates, which they do not say; local: "
        "as they are, on no map.",
    ),
    None,
)
CAMERA = _parameter(
    "camera",
    Literal["adjusted", "initial"],
    typer.Option(help="Which calibration is taken where the project has both."),
    "adjusted",
)
PIXEL_UM = _parameter(
    "pixel_um",
    float | None,
    terminal.option(
        "UM",
        "Pixel size, where the files do not have it; by default 5, and only millimetres "
        "depend on it.",
        "--pixel-um",
        min=0.1,
        max=1000,
    ),
    None,
)
AS_ADJUSTED = _parameter(
    "orientations",
    Literal["adjusted", "none"],
    typer.Option(help="Trajectory: what was adjusted, or none."),
    "adjusted",
)
ORIENTATIONS = _parameter(
    "orientations",
    Literal["initial", "adjusted", "none"],
    typer.Option(help="Trajectory: what was measured of the cameras, what was adjusted, or none."),
    "initial",
)
LENSES = PIXEL_UM, Parameter("allow", Parameter.KEYWORD_ONLY, annotation=Allow, default=2.0)


_program(
    "metashape",
    """Read a project of Metashape: cameras, images, markers, control, orientations.

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
""",
    [
        BLOCK,
        CRS,
        CAMERA,
        ORIENTATIONS,
        _parameter(
            "chunk",
            str | None,
            terminal.option("LABEL", "Which chunk; by default the active one."),
            None,
        ),
        *LENSES,
    ],
    of_flight=("crs", "heights"),
)


_program(
    "colmap",
    """Read a model of COLMAP: cameras, rigs, images and tie points, text or binary.

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
""",
    [BLOCK, OWN_CRS, AS_ADJUSTED.replace(default="none"), *LENSES],
)


_program(
    "opf",
    """Read a project in Pix4D's open photogrammetry format (OPF).

SOURCE is a file .opf, or a folder with it or with JSON files of OPF. Sensors with rig relatives,
images, tie points, control points with their marks and the measured orientations are taken; with
--orientations adjusted the trajectory is the calibrated cameras, and then a boresight means
nothing.

\b
Example:
  acx4 import opf project.opf --out my_flight
""",
    [BLOCK, CRS, CAMERA, ORIENTATIONS, *LENSES],
    of_flight=("crs", "heights"),
)


_program(
    "pix4d",
    """Read the folder params of Pix4Dmapper: lenses, and the adjusted orientations.

SOURCE is that folder (1_initial/params), or the project's folder. From its files
*_calibrated_camera_parameters.txt and *_offset.xyz come lenses and poses, from *_wkt.prj the CRS.
*_pmatrix.txt and *_calibrated_external_camera_parameters.txt must agree with them: the differences
are told. A boresight on this trajectory means nothing. Tie points: acx4 import bingo.

\b
Example:
  acx4 import pix4d my_project/1_initial/params --out my_flight
""",
    [BLOCK, CRS, AS_ADJUSTED, *LENSES],
    of_flight=("crs", "heights"),
)


# --- blocks and adjustments


NEEDED_PIXEL_UM = _parameter(
    "pixel_um", float, terminal.option("UM", "Pixel size.", min=0.1, max=1000.0)
)


def _width_height(text: str) -> tuple[int, int]:
    """Return width and height from the text of a size, or end the command."""
    match = re.fullmatch(r"(\d{1,6})[x×](\d{1,6})", text.strip(), re.ASCII | re.I)
    if match is None or "0" in (match[1].lstrip("0") or "0", match[2].lstrip("0") or "0"):
        terminal.refuse(f"--size {text}: must be width x height in pixels, such as 4000x3000")
    return int(match[1]), int(match[2])


SIZE = _parameter(
    "size", str, terminal.option("WxH", "Size of the pictures: 4000x3000.", callback=_width_height)
)


_program(
    "opensfm",
    """Read a project of OpenSfM, ODM or WebODM: cameras, images, tracks, rigs, control.

SOURCE is the folder with reconstruction.json and tracks.csv, the folder of an ODM project, or one
file reconstruction.json, camera_models.json or cameras.json. Where a reconstruction by ODM has the
axes of UTM, the measured positions tell.

\b
Examples:
  acx4 import opensfm my_project --out my_flight
  acx4 import opensfm my_project --orientations adjusted --crs EPSG:25833 --out my_flight
""",
    [BLOCK, CRS, CAMERA, ORIENTATIONS, *LENSES],
    of_flight=("crs",),
)


_program(
    "micmac",
    """Read MicMac's XML, version 1 or 2: calibration, orientations, measured, surveyed points.

SOURCE is the folder that holds Ori-* and the points (SetOfMesureAppuisFlottants,
DicoAppuisFlottant), one of several Ori-* in it, or one of these files. Distortion models ModRad,
ModPhgrStd, ModNoDist and the three fisheyes are read; others are refused by name. Of version 2
(MMVII) it is the folder with MMVII-PhgrProj, or one of Ori/* in that.

\b
Examples:
  acx4 import micmac my_project --out my_flight
  acx4 import micmac my_project/Ori-Ground --orientations adjusted --crs EPSG:2154 --out my_flight
""",
    [BLOCK, OWN_CRS, ORIENTATIONS, *LENSES],
)


_program(
    "bingo",
    """Read BINGO's image.dat, or *_bingo.txt of Pix4D; control points of geoin.dat beside it.

Image coordinates are in mm from the middle of the image. The layout is that which Pix4D documents;
it is untried on files that BINGO itself wrote.

\b
Example:
  acx4 import bingo image.dat --size 4000x3000 --pixel-um 6 --out my_flight
""",
    [SIZE, NEEDED_PIXEL_UM, BLOCK],
    reader="photo_lists.read_bingo",
)


_program(
    "patb",
    """Read PAT-B's image coordinates, .im: untried on a file that PAT-B wrote.

Blocks of an image, its points and -99. Control and orientations of PAT-B are not read.

\b
Example:
  acx4 import patb my_block.im --unit um --size 4000x3000 --pixel-um 6 --out my_flight
""",
    [
        _parameter(
            "unit", Literal["um", "mm"], typer.Option(show_default=False, help="Of x and y.")
        ),
        SIZE,
        NEEDED_PIXEL_UM,
        BLOCK,
    ],
    reader="photo_lists.read_patb",
)


_program(
    "odm-control",
    """Read ODM's gcp_list.txt: surveyed points and their places in the pictures.

The first line is the CRS; a height NaN makes a tie point of a point. Longitudes and latitudes are
written in the UTM zone where they lie, or in --crs.

\b
Examples:
  acx4 import odm-control gcp_list.txt --out my_flight
  acx4 import odm-control gcp_list.txt --camera CAM --crs EPSG:25833 --out my_flight
""",
    [
        BLOCK,
        CRS,
        _parameter(
            "camera",
            str | None,
            terminal.option("NAME", "Camera of all pictures: then images.csv is written, too."),
            None,
        ),
    ],
    of_flight=("crs",),
    reader="opensfm.read_control",
)
