"""The command ``acx4 plan``: what a flight will determine, before it is flown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    import pandas as pd

    from acx4lib.planning.choosing.chosen import Chosen
    from acx4lib.planning.design import Design

HELP = """Predict what a flight will determine, from its plan alone.

No measurement is made and no error drawn: a plan has cameras, standard deviations, strips and
control points, and from their geometry follow sigma and correlations of all unknowns, what is
determined worst, which errors of observations would be found, and the RMS of check points.
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

With --target the cheapest strips are chosen, by flying time, that give what is wanted, and what
each of them buys is shown. The status is 1 where no strips give it. Strips to choose from are those
of [calibration.strips] and all combinations of TARGET's [candidates].

\b
TARGET is TOML, too:
  minutes = 60     the longest flying time; without it, as long as is needed
  [sigma]          sigma wanted, by the names of parameters.csv: f_mm = 0.002
  [check_points]   RMS wanted: east_m, north_m, height_m
  [candidates]     strips in which a key may have several values:
                   c = {flying_height_m = [600, 900], course_deg = [0, 180], ...}

\b
Examples:
  acx4 plan my_plan.toml
  acx4 plan my_plan.toml --out my_prediction
  acx4 plan my_plan.toml --target my_target.toml --out my_choice
  acx4 simulate my_choice/plan.toml --out my_flight
  acx4 simulate my_plan.toml --out my_flight
"""

NOT_DETERMINED = 1
"""Exit status where the design leaves something open that is wanted."""

FILES = ("parameters", "covariance", "correlations", "reliability", "check_points")
"""Tables in the folder."""


def plan(
    file: Annotated[Path, typer.Argument(metavar="FILE", show_default=False, help="A plan, TOML.")],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", show_default=False, help="Folder for tables, summary and picture."
        ),
    ] = None,
    target: Annotated[
        Path | None,
        typer.Option(
            metavar="TARGET", show_default=False, help="What is wanted, TOML: choose the strips."
        ),
    ] = None,
) -> None:
    """Predict what a flight will determine."""
    from acx4book.command.planning.target import choose  # noqa: PLC0415 quick help
    from acx4lib.flight.text.files import text_of  # noqa: PLC0415 quick help
    from acx4lib.planning import design, shown, tables, text  # noqa: PLC0415 quick help

    if out is not None:
        terminal.need_book("plan --out")
    planned = text.read(file)
    chosen = None if target is None else choose(planned, target)
    flown = planned if chosen is None else chosen.plan
    found = design.of(flown, winds=design.usual_winds(flown))
    terminal.show("\n".join(shown.lines(found)))
    if out is not None:
        source = text_of(file) if chosen is None else text.written(chosen.plan.values)
        write(found, source, out, chosen)
    if tables.sentences(found) or (chosen is not None and not chosen.met):
        raise typer.Exit(NOT_DETERMINED)


def write(design: Design, source: str, out: Path, chosen: Chosen | None = None) -> None:
    """Write the tables, the summary, the picture and the plan itself into a folder."""
    from acx4book.typesetting.drawing.svg import vector  # noqa: PLC0415 quick help
    from acx4book.typesetting.maps import block_maps  # noqa: PLC0415 quick help
    from acx4lib.planning import tables  # noqa: PLC0415 quick help
    from acx4lib.planning.choosing import tables as choices  # noqa: PLC0415 quick help
    from acx4lib.results.own_folder import claims, whole_files  # noqa: PLC0415 quick help

    made = (
        tables.parameter_table(design),
        tables.covariance_table(design),
        tables.correlation_table(design),
        tables.reliability_table(design),
        tables.check_point_table(design),
    )
    content = {f"{name}.csv": _csv(table) for name, table in zip(FILES, made, strict=True)}
    content["summary.json"] = json.dumps(tables.summary(design), indent=1) + "\n"
    drawing = vector(block_maps(*design.blocks.values()))
    content["plan.svg"] = drawing.replace("<svg ", '<svg style="background: #fff" ', 1) + "\n"
    content["plan.toml"] = source
    if chosen is not None:
        content["target.csv"] = _csv(choices.wanted(chosen))
        content["strips.csv"] = _csv(choices.strips(chosen))
    with claims.claim(out, command="acx4 plan") as own:
        own.expect(content)
        whole_files.write_all({out / name: written for name, written in content.items()})
        own.seal()
    terminal.show(f"\n{out}: {', '.join(content)}")


def _csv(table: pd.DataFrame) -> str:
    return table.to_csv(index=False, lineterminator="\n")
