"""The command ``acx4 measure``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acx4book.command.many import Where
from acx4book.command.terminal import Flight, refuse, say_if_not_kept, show, stage_bars

HELP = """Measure the pictures of a flight, and write the measured flight.

FLIGHT has settings, images.csv with the column file, a trajectory and, where there are some,
control points; image_points.csv may be missing or empty. Attitudes may be wrong by ten degrees
and the height of the ground unknown: features of the pictures tell. MEASURED is a complete flight
with the same tables and pictures: tie points found in the pictures, each with its standard
deviation from the matching, and surveyed points, which are looked for where the trajectory puts
them. Measurements that are there already are kept. What is not found is listed. A command that was
interrupted goes on where it was.

\b
Examples:
  acx4 measure my_flight --out measured
  acx4 measure my_flight --out measured --jobs 4 --show seen
  acx4 measure my_flight --out measured --reduce 2 --ground 140
  acx4 check measured
"""


def measure(  # noqa: PLR0913, PLR0917 every option is an argument
    flight: Flight,
    out: Annotated[
        Path, typer.Option(metavar="MEASURED", show_default=False, help="Folder for the flight.")
    ],
    points: Annotated[
        int, typer.Option(metavar="N", min=20, help="Corners of a picture, about.")
    ] = 200,
    reduce: Annotated[
        int, typer.Option(metavar="K", min=1, help="Measure at 1/K of the size: poor pictures.")
    ] = 1,
    ground: Annotated[
        float | None,
        typer.Option(
            metavar="HEIGHT", show_default=False, help="Of the mean ground, if nothing tells it."
        ),
    ] = None,
    show_in: Annotated[
        Path | None,
        typer.Option(
            "--show", metavar="FOLDER", show_default=False, help="New folder for pictures of them."
        ),
    ] = None,
    jobs: Annotated[
        int, typer.Option(metavar="N", min=1, help="Pairs at a time, a process each.")
    ] = 1,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", show_default=False, help="Dask scheduler to match on."),
    ] = None,
) -> None:
    """Measure the pictures of a flight."""
    from acx4lib.measuring import shown  # noqa: PLC0415 quick help
    from acx4lib.measuring.levels import MeasureOptions  # noqa: PLC0415 quick help
    from acx4lib.measuring.measure import measure_flight  # noqa: PLC0415 quick help
    from acx4lib.results.own_folder import claims, places  # noqa: PLC0415 quick help

    if flight.resolve() == out.resolve():
        refuse(f"{out}: is the flight itself; choose another folder for the measured one")
    if show_in is not None:
        places.check_new(show_in)
    options = MeasureOptions(points=points, reduce=reduce, ground_m=ground)
    where = Where(jobs=jobs, cluster=cluster)
    with stage_bars("pairs") as tell, where.maybe_executor() as executor:
        found = measure_flight(flight, out, options=options, executor=executor, tell=tell)
    if show_in is not None:
        with claims.placed(show_in, command="acx4 measure --show") as draft:
            shown.write(found, draft)
    say_if_not_kept()
    for one in found:
        for sentence in one.sentences:
            show(sentence)
    show(out)
