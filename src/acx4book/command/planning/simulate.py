"""The command ``acx4 simulate``: a flight of a design or of a plan, or the plan of a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4sim.files.flights import SimulatedFlight
    from acx4sim.plan import Options

HELP = """Write a simulated flight.

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
    name: Annotated[str, typer.Argument(metavar="NAME", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(metavar="FLIGHT", show_default=False, help="New folder for the flight."),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", show_default=False, help="New file for the design's plan; no flight."
        ),
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
    refraction: Annotated[
        bool, typer.Option("--refraction", help="Rays bent by the standard atmosphere.")
    ] = False,
    images: Annotated[
        str, typer.Option(metavar="A,B", help="Exposures that get pictures.", show_default=False)
    ] = "",
    reduce: Annotated[
        int, typer.Option(metavar="K", min=1, help="Pictures at 1/K of the size.")
    ] = 1,
    ground: Annotated[
        Path | None,
        typer.Option(
            metavar="PHOTO",
            show_default=False,
            help="A picture to lie on the ground, a pixel every 12.5 cm; else a landscape.",
        ),
    ] = None,
) -> None:
    """Write a simulated flight, or the plan of one."""
    from acx4lib.results.own_folder import claims, places  # noqa: PLC0415 quick help
    from acx4sim.files.flights import photograph  # noqa: PLC0415 quick help
    from acx4sim.files.writer import TRUTH_MARK, truth_path, write  # noqa: PLC0415 quick help
    from acx4sim.plan import GrossErrors, Options, SlowErrors  # noqa: PLC0415 quick help

    if (out is None) == (plan is None):
        terminal.refuse("give either --out FLIGHT for a flight, or --plan FILE for its plan")
    if plan is not None:
        _write_plan(name, plan)
        return
    assert out is not None
    places.check_new(out)
    truth = truth_path(out)
    places.check_file(truth, mark=TRUTH_MARK, what="the truth of a simulated flight")
    options = Options(
        slow_errors=SlowErrors() if slow_errors else None,
        gross_errors=GrossErrors() if gross_errors else None,
        refraction="standard" if refraction else "none",
    )
    exposures = [exposure.strip() for exposure in images.split(",") if exposure.strip()]
    if not exposures and (reduce > 1 or ground is not None):
        terminal.refuse("--reduce and --ground are for pictures; name exposures with --images")
    flight = _flown(name, seed, options)
    if exposures:
        try:
            flight = photograph(flight, exposures, reduce=reduce, photo=ground)
        except ValueError as error:
            terminal.refuse(str(error))
    with terminal.stage_bars("rows") as tell, claims.placed(out, command="acx4 simulate") as draft:
        write(flight, draft, tell=tell)
    terminal.show(f"{out}; its truth in {truth}")


def _flown(name: str, seed: int, options: Options) -> SimulatedFlight:
    """Return the flight of a design, or of the plan in a file."""
    from acx4book.notebooks.simulated import by_name  # noqa: PLC0415 quick help

    try:
        return by_name.fly(name, seed=seed, options=options)
    except ValueError as error:
        terminal.refuse(str(error))


def _write_plan(name: str, path: Path) -> None:
    from acx4book.notebooks.simulated import of_design  # noqa: PLC0415 quick help
    from acx4lib.planning import text  # noqa: PLC0415 quick help
    from acx4lib.results.own_folder import places, whole_files  # noqa: PLC0415 quick help
    from acx4sim.designs import PLANS  # noqa: PLC0415 quick help

    if name not in PLANS:
        terminal.refuse(f"--plan is of a design: {', '.join(PLANS)}; got {name!r}")
    if path.exists():
        terminal.refuse(f"{path}: is there already; choose another name")
    places.check_file(path, mark=b"", what="a plan")
    whole_files.write(path, text.written(of_design.values(PLANS[name]())))
    terminal.show(path)
