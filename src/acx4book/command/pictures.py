"""``acx4 measure`` and ``acx4 render``: from pictures to measurements, and to synthetic images."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Literal

import typer

from acx4book.command import terminal

# --- The command ``acx4 measure``


MEASURE_HELP = """Measure the pictures of a flight, and write the measured flight.

FLIGHT has settings, images.csv with the column file, a trajectory and, where there are some,
control points; image_points.csv may be missing or empty. Attitudes may be wrong by ten degrees
and the height of the ground unknown: features of the pictures tell. MEASURED is a complete flight
with the same tables and pictures: tie points found in the pictures, each with its standard
deviation from the matching, and surveyed points, which are looked for where the trajectory puts
them. Measurements that are there already are kept. What is not found is listed.

\b
Examples:
  acx4 measure my_flight --out measured
  acx4 measure my_flight --out measured --jobs 4
  acx4 measure my_flight --out measured --reduce 2 --ground 140
  acx4 check measured
"""


def measure(
    flight: terminal.Flight,
    out: Annotated[Path, terminal.option("MEASURED", "Folder for the flight.")],
    reduce: Annotated[
        int, typer.Option(metavar="K", min=1, help="Measure at 1/K of the size: poor pictures.")
    ] = 1,
    ground: Annotated[
        float | None, terminal.option("HEIGHT", "Of the mean ground, if nothing tells it.")
    ] = None,
    jobs: Annotated[
        int, typer.Option(metavar="N", min=1, help="Pairs at a time, a process each.")
    ] = 1,
) -> None:
    """Measure the pictures of a flight."""
    from acx4book.command import runs  # noqa: PLC0415 quick help
    from acx4files.measuring.levels import MeasureOptions  # noqa: PLC0415 quick help
    from acx4files.measuring.measure import measure_flight  # noqa: PLC0415 quick help

    if flight.resolve() == out.resolve():
        terminal.refuse(f"{out}: is the flight itself; choose another folder for the measured one")
    options = MeasureOptions(reduce=reduce, ground_m=ground)
    pool = nullcontext() if jobs == 1 else runs.executor(jobs, None)
    with terminal.stage_bars("pairs") as tell, pool as executor:
        outcomes = measure_flight(flight, out, options=options, executor=executor, tell=tell)
    terminal.say_if_not_kept()
    for outcome in outcomes:
        for sentence in outcome.sentences:
            terminal.show(sentence)
    terminal.show(out)


# --- The command ``acx4 render``


RENDER_HELP = """Render synthetic images of a flight from its heads' images.

The folder gets a tiled BigTIFF with overviews and a small JPEG for every exposure whose heads all
have files, and images.csv, by which they are a block of a flight. Images that are there
already, from the same input, are not rendered again. Where an image cannot be rendered the reasons
are on standard error, the others are finished, and the status is 2.

\b
Examples:
  acx4 render my_flight --results my_results --out my_images
  acx4 render my_flight --results my_results --out my_images --exposures A1,A2
  acx4 render my_flight --results my_results --out my_stacks --blend stack
"""


def render(
    flight: terminal.Flight,
    results: Annotated[Path, terminal.option("DIR", "Folder of a run.")],
    out: Annotated[Path, terminal.option("FOLDER", "Folder for the images.")],
    exposures: Annotated[
        str | None, terminal.option("A,B", "Only these, or block/A; else all.")
    ] = None,
    blend: Annotated[
        Literal["feather", "seam", "stack"],
        typer.Option(help="Between heads, or each head a band of its own."),
    ] = "feather",
) -> None:
    """Render the synthetic images of a flight."""
    from acx4files.flight.reader import read  # noqa: PLC0415 quick help
    from acx4files.images.flight_images import render_flight  # noqa: PLC0415 quick help

    named = None if exposures is None else [n.strip() for n in exposures.split(",") if n.strip()]
    if named == []:
        terminal.refuse("--exposures: name at least one exposure")
    with terminal.counting_bar("images") as tell:
        report = render_flight(read(flight), results, out, exposures=named, blend=blend, tell=tell)
    terminal.say_if_not_kept()
    for line in report.notes:
        terminal.show(line)
    kept = f", {len(report.kept)} there already" if report.kept else ""
    images = "1 image" if len(report.rendered) == 1 else f"{len(report.rendered)} images"
    terminal.show(f"{images} rendered{kept}, in {out}")
    if report.problems:
        terminal.say(*report.problems)
        raise typer.Exit(2)
