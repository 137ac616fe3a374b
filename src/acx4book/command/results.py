"""The commands ``acx4 book`` and ``acx4 export`` on results of runs."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4files.exchange.outward.content import Calibrated, Taken
    from acx4files.exchange.outward.programs import Kind


# --- acx4 book


BOOK_HELP = """\
Write the book of a flight, as pages to hand on.

It has the flight's chapters, its certificate and the report. FLIGHT is a folder with flight.toml,
which is run first, or the results of acx4 run with its notebooks. The folder gets index.html and
all that its pages need; they ask no other host for anything. A chapter whose block the flight does
not have is not there.

\b
Examples:
  acx4 book my_flight --out my_book
  acx4 book my_results --out my_book
"""


def book(
    flight: Annotated[Path, terminal.argument("FLIGHT", "Folder of a flight, or of its results.")],
    out: Annotated[Path, terminal.option("DIR", "Folder for the pages.")],
    strict: Annotated[
        bool, typer.Option("--strict", help="Fail on warnings about the pages.")
    ] = False,
) -> None:
    """Run a flight and write its book."""
    terminal.need_book("book")
    if importlib.util.find_spec("jupyter_book") is None:
        terminal.refuse("acx4 book needs jupyter_book: pip install 'acx4lib[book]'")
    from acx4book.notebooks import runner  # noqa: PLC0415 quick help
    from acx4book.pages import flight_book  # noqa: PLC0415 quick help

    with tempfile.TemporaryDirectory(prefix="acx4-run-") as temporary:
        results, wrong = flight, tuple[str, ...]()
        with terminal.stage_bars() as tell:
            if not (flight / "summary.json").is_file():
                results = Path(temporary) / "acx4-results"
                outcome = runner.run(flight, results, notebooks=runner.NOTEBOOKS_PATH, tell=tell)
                wrong = outcome.not_determined
            flight_book.write(results, out, strict=strict, tell=tell)
    terminal.show(out / "index.html")
    if wrong:
        terminal.say(*wrong)
        raise typer.Exit(1)


# --- acx4 export -----------------------------------------------------------------------------


EXPORT_HELP = """Write a calibration, or orientations by it, for another program.

FOLDER gets the files and export.md, which says in which conventions they are, and what they have no
place for. Lenses are refitted over the whole image where the other program has another model; what
is lost is printed, and refused above --allow. Of a rig the first head is the reference.

\b
KIND, cameras:
  toml             tables [cameras.NAME] for flight.toml of the next flight
  opencv           YAML for cv::FileStorage, a file for each camera; rigs with R and T
  micasense        XMP tags of the heads, among them RigRelatives, and these with sigma
KIND, cameras, and with --orientations BLOCK its images:
  metashape        calibrations; cameras.xml with sensors, slaves of a rig
  colmap           cameras.txt, rigs.txt; a whole model as text
KIND, images of --orientations BLOCK:
  opk              east, north, height, omega, phi, kappa in the flight's grid, with sigma
  opk-topocentric  the same in Cartesian axes east, north, up at the middle of the block
  rph              latitude, longitude, ellipsoidal height, roll, pitch, heading of the image

Orientations are those of direct georeferencing: trajectory, boresight and lever arm, no adjustment.
A later --flight needs no image points and no control.

\b
Examples:
  acx4 export my_results --to toml --out for_the_next_flight
  acx4 export my_results --to metashape --method rig --out for_metashape
  acx4 export my_results --to opk --orientations validation --out oriented
  acx4 export my_results --to colmap --orientations validation --flight later_flight --out model
"""


def export(
    results: Annotated[Path, terminal.argument("RESULTS", "Folder of a run.")],
    to: Annotated[str, terminal.option("KIND", "See above.", "--to")],
    out: Annotated[Path, terminal.option("FOLDER", "Folder for the files.")],
    method: Annotated[
        str,
        terminal.option("NAME", "single_step, rig, ...: which calibration; else the best."),
    ] = "",
    orientations: Annotated[
        str,
        terminal.option(
            "BLOCK", "heads, calibration or validation: export its images' orientations, too."
        ),
    ] = "",
    flight: Annotated[
        Path | None, terminal.option("FLIGHT", "Orient images of this flight instead.")
    ] = None,
    allow: Annotated[
        float,
        typer.Option(metavar="PX", min=0.0, help="Largest difference of a refitted lens, px."),
    ] = 0.05,
) -> None:
    """Write a calibration for another program."""
    from acx4files.exchange.outward import content, programs  # noqa: PLC0415 quick help

    kind = programs.KINDS.get(to)
    if kind is None:
        terminal.refuse(f"--to {to}: must be one of {', '.join(programs.KINDS)}")
    known = (*content.CAMERA, *content.HEADS)
    if method and method not in known:
        terminal.refuse(f"--method {method}: must be one of {', '.join(known)}")
    if kind.cameras is None and not orientations:
        terminal.refuse(f"--to {to} needs --orientations BLOCK: heads, calibration or validation")
    if kind.oriented is None and orientations:
        terminal.refuse(f"--to {to} has no place for orientations; leave --orientations out")
    if flight is not None and not orientations:
        terminal.refuse("--flight needs --orientations BLOCK, a block of that flight")
    calibration = content.read(results, method=method, heads=kind.heads)
    exported = _made(kind, calibration, orientations, flight)
    exported = content.near(exported, allow)
    title = f"{to}: {calibration.title}"
    content.write(exported, out, title=title, origin=calibration.origin)
    _show(title, calibration, exported)
    terminal.show(f"{out}: {', '.join([*exported.files, content.STATEMENT])}")


def _made(kind: Kind, calibration: Calibrated, block: str, flight: Path | None) -> Taken:
    """Return the files of a kind, with orientations if a block is named."""
    from acx4files.exchange.outward import programs  # noqa: PLC0415 quick help
    from acx4files.exchange.outward.content import orient, read_flown  # noqa: PLC0415 quick help

    if not block and kind.cameras is not None:
        return kind.cameras(calibration)
    flown = calibration.flight if flight is None else read_flown(flight)
    if kind.on_map and flown.grid.is_local:
        fits = [
            name
            for name, program in programs.KINDS.items()
            if program.oriented and not program.on_map
        ]
        terminal.refuse(
            f"{flown.path}: crs is {flown.grid.crs!r}, on no map, which these orientations need; "
            f"--to {', '.join(fits)} need none"
        )
    oriented = orient(calibration, flown, block)
    if kind.oriented is None:
        msg = "kind: expected one with a place for orientations"
        raise ValueError(msg)
    return kind.oriented(calibration, oriented)


def _show(title: str, calibration: Calibrated, made: Taken) -> None:
    from acx4files.exchange.outward.content import sentences  # noqa: PLC0415 quick help

    terminal.show(title)
    for sentence in sentences(made):
        terminal.show(f"  {sentence}")
    for name, remarks in (("convention", made.assumed), ("left out", made.left_out)):
        for sentence in remarks:
            terminal.show(f"  {name}: {sentence}")
    if calibration.others:
        terminal.show(f"  by --method also: {', '.join(calibration.others)}")
