"""The command ``acx4 render``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from acx4book.command.many import Where
from acx4book.command.terminal import Flight, counting_bar, refuse, say, say_if_not_kept, show

HELP = """Render the synthetic images of a flight from the images of its heads.

The folder gets a tiled BigTIFF with overviews and a small JPEG for every exposure whose heads all
have files, and images.csv, by which they are a block of a flight. Images that are there
already, from the same input, are not rendered again. Where an image cannot be rendered the reasons
are on standard error, the others are finished, and the status is 2.

\b
Examples:
  acx4 render my_flight --results my_results --out my_images
  acx4 render my_flight --results my_results --out my_images --exposures A1,A2 --compression zstd
  acx4 render my_flight --results my_results --out my_images --cluster tcp://host:8786
"""


def render(  # noqa: PLR0913, PLR0917 every option is an argument
    flight: Flight,
    results: Annotated[
        Path, typer.Option(metavar="DIR", show_default=False, help="Folder of a run.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", show_default=False, help="Folder for the images.")
    ],
    exposures: Annotated[
        str | None,
        typer.Option(metavar="A,B", show_default=False, help="Only these, or block/A; else all."),
    ] = None,
    blend: Annotated[
        str,
        typer.Option(
            metavar="feather|seam|stack", help="Between heads, or each head a band of its own."
        ),
    ] = "feather",
    feather: Annotated[
        float, typer.Option(metavar="PX", min=1.0, help="Width of the blend, full-size pixels.")
    ] = 150.0,
    interpolation: Annotated[
        str, typer.Option(metavar="bilinear|cubic", help="Between pixels.")
    ] = "bilinear",
    equalise: Annotated[
        str,
        typer.Option(
            metavar="flight|image|none", help="Response of the heads from overlaps: once, or each."
        ),
    ] = "flight",
    refine: Annotated[
        str,
        typer.Option(metavar="flight|image", help="Heads as in DIR, or by each image's ties."),
    ] = "flight",
    compression: Annotated[
        str, typer.Option(metavar="none|deflate|zstd|lzw", help="Of the TIFF, without loss.")
    ] = "none",
    jobs: Annotated[
        int, typer.Option(metavar="N", min=1, help="Images at a time, a process each.")
    ] = 1,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", show_default=False, help="Dask scheduler to render on."),
    ] = None,
) -> None:
    """Render the synthetic images of a flight."""
    from acx4lib.flight.reader import read  # noqa: PLC0415 quick help
    from acx4lib.production.exposure import RenderOptions  # noqa: PLC0415 quick help
    from acx4lib.production.flight_images import render_flight  # noqa: PLC0415 quick help

    chosen: dict[str, Any] = {
        "blend": blend,
        "feather_px": feather,
        "interpolation": interpolation,
        "equalise": "none" if blend == "stack" else equalise,
        "refine": refine,
        "compression": compression,
    }
    try:
        options = RenderOptions(**chosen)
    except ValueError as error:
        refuse(f"--{error}")
    named = None if exposures is None else [n.strip() for n in exposures.split(",") if n.strip()]
    if named == []:
        refuse("--exposures: name at least one exposure")
    where = Where(jobs=jobs, cluster=cluster)
    with counting_bar("images") as tell, where.maybe_executor() as executor:
        report = render_flight(
            read(flight),
            results,
            out,
            exposures=named,
            options=options,
            executor=executor,
            threads=where.threads,
            tell=tell,
        )
    say_if_not_kept()
    for line in report.notes:
        show(line)
    there = f", {len(report.kept)} there already" if report.kept else ""
    images = "1 image" if len(report.rendered) == 1 else f"{len(report.rendered)} images"
    show(f"{images} rendered{there}, in {out}")
    if report.problems:
        say(*report.problems)
        raise typer.Exit(2)
