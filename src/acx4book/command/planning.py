"""The commands ``acx4 plan``, ``acx4 simulate`` and ``acx4 new``: flights before they are flown."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import importing, terminal

if TYPE_CHECKING:
    import pandas as pd

    from acx4book.planning.design import Design
    from acx4sim.files import SimulatedFlight
    from acx4sim.plan import Options


# --- The command ``acx4 plan``: what a flight will determine, before it is flown


PLAN_HELP = """Predict what a flight will determine, from its plan alone.

No measurement is made and no error drawn: a plan has cameras, standard deviations, strips and
control points, and from their geometry follow sigma and correlations of all unknowns, which errors
of observations would be found, and the RMS of check points.
Nothing needs an image. The status is 1 where something wanted is not determined.

\b
FILE is TOML: the keys of flight.toml, and besides
  [field]          where: east_m, north_m, height_m, relief_m, course_deg
  [control]        control points: layout, number, area_m, sigma_m
  [calibration]    tie_points, and in [calibration.strips] a line for each strip:
                   low = {flying_height_m = 600, course_deg = 0, length_m = 900, overlap = 0.8}
  [heads]          the same for all heads together
  [validation]     a mapping flight with [validation.check] points
A whole plan to begin with: acx4 simulate single-head --plan my_plan.toml

\b
Examples:
  acx4 plan my_plan.toml
  acx4 plan my_plan.toml --out my_prediction
  acx4 simulate my_plan.toml --out my_flight
"""

NOT_DETERMINED = 1
"""Exit status if a wanted parameter is not determined."""


def plan(
    file: Annotated[Path, terminal.argument("FILE", "A plan, TOML.")],
    out: Annotated[
        Path | None, terminal.option("FOLDER", "Folder for tables, summary and picture.")
    ] = None,
) -> None:
    """Predict what a flight will determine."""
    from acx4book.planning import design, tables  # noqa: PLC0415 quick help
    from acx4book.planning import plan as plans  # noqa: PLC0415 quick help

    if out is not None:
        terminal.need_book("plan --out")
    planned = plans.read(file)
    predicted = design.of(planned, winds=design.usual_winds(planned))
    terminal.show("\n".join(tables.lines(predicted)))
    if out is not None:
        _write(predicted, file.read_text("utf-8-sig"), out)
    if tables.not_determined(predicted):
        raise typer.Exit(NOT_DETERMINED)


def _write(design: Design, source: str, out: Path) -> None:
    """Write the tables, the summary, the picture and the plan itself into a folder."""
    from acx4book.planning import tables  # noqa: PLC0415 quick help
    from acx4book.typesetting.maps import block_maps  # noqa: PLC0415 quick help
    from acx4book.typesetting.svg import vector  # noqa: PLC0415 quick help
    from acx4files.results import whole_files  # noqa: PLC0415 quick help

    content = {
        "parameters.csv": _csv(tables.parameter_table(design)),
        "reliability.csv": _csv(tables.reliability_table(design)),
        "rms.csv": _csv(tables.rms_table(design)),
        "summary.json": json.dumps(tables.summary(design), indent=1) + "\n",
    }
    drawing = vector(block_maps(*design.blocks.values()))
    content["plan.svg"] = drawing.replace("<svg ", '<svg style="background: #fff" ', 1) + "\n"
    content["plan.toml"] = source
    with whole_files.claim(out, signs=["plan.svg"]):
        whole_files.write_all({out / name: written for name, written in content.items()})
    terminal.show(f"\n{out}: {', '.join(content)}")


def _csv(table: pd.DataFrame) -> str:
    return table.to_csv(index=False, lineterminator="\n")


# --- The command ``acx4 simulate``: a flight of a design or of a plan, or the plan of a design


SIMULATE_HELP = """Write a simulated flight.

Its truth is in FLIGHT.truth.json beside it. It has pixels where --images names exposures: the
pictures of all cameras that expose together, 16 bit.

\b
NAME is one of
  acx4         the paper's: four heads that measure in all three blocks
  acx4-ideal   the same with an ideal synthetic camera in the blocks 2 and 3
  single-head  one ordinary camera, turned on its mount
  PLAN.toml    a plan of your own: acx4 plan --help
With --plan the plan of the first three is written instead, to be changed and flown.

\b
Examples:
  acx4 simulate single-head --out my_flight --seed 3
  acx4 simulate acx4 --out my_flight --slow-errors --gross-errors
  acx4 simulate acx4 --out my_flight --images H3-04,C2-05 --reduce 4
  acx4 simulate single-head --plan my_plan.toml
  acx4 simulate my_plan.toml --out my_flight
"""


def simulate(  # noqa: PLR0913, PLR0917 one for every option
    name: Annotated[str, terminal.argument("NAME")],
    out: Annotated[Path | None, terminal.option("FLIGHT", "New folder for the flight.")] = None,
    plan: Annotated[
        Path | None, terminal.option("FILE", "New file for the design's plan; no flight.")
    ] = None,
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="The same seed gives the same flight.")
    ] = 1,
    slow_errors: Annotated[
        bool, typer.Option("--slow-errors", help="Trajectory errors that change slowly.")
    ] = False,
    gross_errors: Annotated[
        bool, typer.Option("--gross-errors", help="Mistakes in the calibration block.")
    ] = False,
    images: Annotated[str, terminal.option("A,B", "Exposures that get pictures.")] = "",
    reduce: Annotated[
        int, typer.Option(metavar="K", min=1, help="Pictures at 1/K of the size.")
    ] = 1,
) -> None:
    """Write a simulated flight, or the plan of one."""
    from acx4files.results import whole_files  # noqa: PLC0415 quick help
    from acx4lib.least_squares import processors  # noqa: PLC0415 quick help
    from acx4sim.files import (  # noqa: PLC0415 quick help
        TRUTH_MARK,
        photograph,
        truth_path,
        write,
    )
    from acx4sim.plan import GrossErrors, Options, SlowErrors  # noqa: PLC0415 quick help

    if (out is None) == (plan is None):
        terminal.refuse("give either --out FLIGHT for a flight, or --plan FILE for its plan")
    if plan is not None:
        _write_plan(name, plan)
        return
    assert out is not None
    whole_files.check_new(out)
    truth = truth_path(out)
    whole_files.check_file(truth, mark=TRUTH_MARK, what="the truth of a simulated flight")
    options = Options(
        slow_errors=SlowErrors() if slow_errors else None,
        gross_errors=GrossErrors() if gross_errors else None,
    )
    exposures = [exposure.strip() for exposure in images.split(",") if exposure.strip()]
    if not exposures and reduce > 1:
        terminal.refuse("--reduce is for pictures; name exposures with --images")
    flight = _flown(name, seed, options)
    if exposures:
        try:
            flight = photograph(flight, exposures, reduce=reduce)
        except ValueError as error:
            terminal.refuse(str(error))
    processors.keep_memory()
    with (
        terminal.stage_bars("rows") as tell,
        whole_files.placed(out) as draft,
    ):
        write(flight, draft, tell=tell)
    terminal.show(f"{out}; its truth in {truth}")


def _flown(name: str, seed: int, options: Options) -> SimulatedFlight:
    """Return the flight of a design, or of the plan in a file."""
    from acx4book.notebooks import simulated  # noqa: PLC0415 quick help

    try:
        return simulated.fly(name, seed=seed, options=options)
    except ValueError as error:
        terminal.refuse(str(error))


def _write_plan(name: str, path: Path) -> None:
    from acx4book.notebooks import simulated  # noqa: PLC0415 quick help
    from acx4book.planning import plan as plans  # noqa: PLC0415 quick help
    from acx4files.results import whole_files  # noqa: PLC0415 quick help
    from acx4sim.designs import PLANS  # noqa: PLC0415 quick help

    if name not in PLANS:
        terminal.refuse(f"--plan is of a design: {', '.join(PLANS)}; got {name!r}")
    if path.exists():
        terminal.refuse(f"{path}: is there already; choose another name")
    whole_files.check_file(path, mark=b"", what="a plan")
    whole_files.write(path, plans.written(simulated.values(PLANS[name]())))
    terminal.show(path)


# --- The command ``acx4 new`` ----------------------------------------------------------------


NEW_HELP = """\
Write a new flight to be filled in.

It has a flight.toml with remarks, and tables with their headers. On a terminal it asks three
questions, unless the options answer them. `acx4 import` adds to the folder: its tables take the
place of the empty ones, its settings are put into flight.toml. `acx4 check` names what is still to
be filled in.

\b
Examples:
  acx4 new my_flight
  acx4 new my_flight --cameras RGB --crs EPSG:31982 --heights ellipsoidal
  acx4 new my_rig --cameras RED,GREEN,BLUE,NIR --crs EPSG:32633 --heights EPSG:5773
"""

QUESTIONS = {
    "cameras": ("Names of the cameras, commas between; several are heads of one rig", "CAM"),
    "crs": ("Projected CRS in metres, such as EPSG:31982", ""),
    "heights": (
        "Heights: ellipsoidal, a vertical CRS (EPSG:5773), a geoid grid file, an undulation in m",
        "ellipsoidal",
    ),
}


def new(
    folder: Annotated[Path, terminal.argument("FLIGHT", "New folder for the flight.")],
    *,
    cameras: Annotated[str, terminal.option("A,B", "One camera, or the heads of a rig.")] = "",
    crs: Annotated[str, terminal.option("EPSG:N", "Projected CRS of the flight, in metres.")] = "",
    heights: Annotated[
        str,
        terminal.option(
            "SYSTEM", "ellipsoidal, a vertical CRS, a geoid grid file, or an undulation in m."
        ),
    ] = "",
) -> None:
    """Write a new flight to be filled in."""
    answers = _answers({"cameras": cameras, "crs": crs, "heights": heights})
    from acx4files.exchange import flight_folder  # noqa: PLC0415 quick help
    from acx4files.exchange.trajectories import orientations  # noqa: PLC0415 quick help
    from acx4files.exchange.trajectories.orientations import Meaning  # noqa: PLC0415 quick help
    from acx4files.flight.tables import name_fault  # noqa: PLC0415 quick help
    from acx4lib.geometry.geodesy import grid_system  # noqa: PLC0415 quick help

    heads = [name.strip() for name in answers["cameras"].split(",") if name.strip()]
    name = folder.resolve().name
    for entered in (name, *heads):
        if fault := name_fault(entered):
            terminal.refuse(f"{fault[0]}; {fault[1]}")
    if len(set(heads)) != len(heads) or not heads:
        terminal.refuse(f"--cameras: {answers['cameras']!r}: must be names that are all different")
    try:
        _ = grid_system(answers["crs"])
    except ValueError as error:
        terminal.refuse(f"--crs: {error}; must be a projected CRS in metres")
    system = Meaning(crs=answers["crs"], heights=importing.heights_of(answers["heights"]))
    texts = flight_folder.files(name, cameras=heads, **orientations.settings(system))
    flight_folder.begin(folder, texts, orientations.grid_file(system))
    for line in importing.missing(folder):
        terminal.show(f"  {line}")
    terminal.show(folder)


def _answers(given: dict[str, str]) -> dict[str, str]:
    """Return the given options, and the answers to questions for the others."""
    unanswered = [name for name, value in given.items() if not value]
    if unanswered and not sys.stdin.isatty():
        options = ", ".join(f"--{name}" for name in unanswered)
        terminal.refuse(f"{options}: missing; on a terminal the command asks for them")
    asked = {
        name: typer.prompt(QUESTIONS[name][0], default=QUESTIONS[name][1] or None, err=True)
        for name in unanswered
    }
    return given | {name: str(answer).strip() for name, answer in asked.items()}
