"""The command ``acx4 plan``: what a flight will determine, before it is flown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4lib.planning.design import Design

HELP = """Predict what a flight will determine, from its plan alone.

No measurement is made and no error drawn: a plan has cameras, standard deviations, strips and
control points, and from their geometry follow sigma and correlations of all unknowns, what is
determined worst, which errors of observations would be found, and the RMS of check points.
Nothing needs an image. The status is 1 where something wanted is not determined.

\\b
FILE is TOML: the keys of flight.toml, and besides
  [field]          where: east_m, north_m, height_m, relief_m, course_deg
  [control]        control points: layout, number, area_m, sigma_m
  [calibration]    tie_points, and in [calibration.strips] a line for each strip:
                   low = {flying_height_m = 600, course_deg = 0, length_m = 900, overlap = 0.8}
  [heads]          the same for all heads together
  [validation]     a mapping flight with [validation.check] points
A whole plan to begin with: acx4 simulate single-head --plan my_plan.toml

\\b
Examples:
  acx4 plan my_plan.toml
  acx4 plan my_plan.toml --out my_prediction
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
) -> None:
    """Predict what a flight will determine."""
    from acx4lib.planning import design, shown, tables, text  # noqa: PLC0415 quick help

    found = design.of(text.read(file))
    terminal.show("\n".join(shown.lines(found)))
    if out is not None:
        terminal.need_book("plan --out")
        write(found, file, out)
    if tables.sentences(found):
        raise typer.Exit(NOT_DETERMINED)


def write(design: Design, file: Path, out: Path) -> None:
    """Write the tables, the summary, the picture and the plan itself into a folder."""
    from acx4book.typesetting.drawing import vector  # noqa: PLC0415 quick help
    from acx4book.typesetting.maps import block_maps  # noqa: PLC0415 quick help
    from acx4lib.planning import tables  # noqa: PLC0415 quick help
    from acx4lib.results.own_folder import claims  # noqa: PLC0415 quick help

    made = (
        tables.parameter_table(design),
        tables.covariance_table(design),
        tables.correlation_table(design),
        tables.reliability_table(design),
        tables.check_point_table(design),
    )
    content = {
        f"{name}.csv": table.to_csv(index=False, lineterminator="\n")
        for name, table in zip(FILES, made, strict=True)
    }
    content["summary.json"] = json.dumps(tables.summary(design), indent=1) + "\n"
    content["plan.svg"] = vector(block_maps(*design.blocks.values())) + "\n"
    content["plan.toml"] = file.read_text("utf-8-sig")
    with claims.claim(out, command="acx4 plan") as own:
        own.expect(content)
        for name, written in content.items():
            (out / name).write_text(written, encoding="utf-8", newline="\n")
        own.seal()
    terminal.show(f"\n{out}: {', '.join(content)}")
