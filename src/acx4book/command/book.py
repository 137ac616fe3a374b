"""The command ``acx4 book``."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from acx4book.command import terminal

HELP = """Write the book of a flight: its chapters, certificate and report, as pages to hand on.

FLIGHT is a folder with flight.toml, which is run first, or the results of acx4 run with its
notebooks. The folder gets index.html and all that its pages need; they ask no other host for
anything. A chapter whose block the flight does not have is not there.

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
    from acx4book.notebooks.execute import Notebooks  # noqa: PLC0415 quick help
    from acx4book.pages import flight_book  # noqa: PLC0415 quick help

    with tempfile.TemporaryDirectory(prefix="acx4-run-") as temporary:
        results, wrong = flight, tuple[str, ...]()
        with terminal.stage_bars() as tell:
            if not (flight / "summary.json").is_file():
                results = Path(temporary) / "acx4-results"
                wrong = runner.run(flight, results, way=Notebooks(), tell=tell).not_determined
            flight_book.write(results, out, strict=strict, tell=tell)
    terminal.show(out / "index.html")
    if wrong:
        terminal.say(*wrong)
        raise typer.Exit(1)
