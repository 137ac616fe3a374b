"""The commands ``acx4 book`` and ``acx4 compare`` on results of runs."""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from acx4book.command import terminal

# --- acx4 book


BOOK_HELP = """\
Write the book of a flight: its chapters, certificate and report, as pages to hand on.

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


# --- acx4 compare


COMPARE_HELP = """Compare the results of two or more flights of the same cameras.

FOLDER gets a page, compare.html, and tables: differences of interior orientation, lever arm and
boresight with their joint covariance and tests at a joint level, their effect on the ground, values
of all flights together, and lines over time and temperature, where flight.toml has [session] with
date and temperature_c. Flights must be independent: not two results of the same one.

With one results folder of a rig of heads: an F test, exposure by exposure, of the rig being rigid.

\b
Examples:
  acx4 compare results_2024 results_2025 results_2026 --out compared
  acx4 compare before after --out compared --method rig --height 1000
  acx4 compare my_results --out rigidity
"""


def compare(
    results: Annotated[list[Path], terminal.argument("RESULTS...", "Folders of runs.")],
    out: Annotated[Path, terminal.option("FOLDER", "Folder for page and tables.")],
    method: Annotated[
        str,
        terminal.option(
            "NAME[,NAME...]",
            "single_step, rig, ...: one for all, or one for each; else the best of each.",
        ),
    ] = "",
    against: Annotated[
        str, typer.Option(metavar="previous|first", help="What each is compared with.")
    ] = "previous",
    height: Annotated[
        float | None,
        terminal.option(
            "M", "Height above ground for effects there; else that of the first flight.", min=1.0
        ),
    ] = None,
    level: Annotated[
        float,
        typer.Option(metavar="P", min=1e-6, max=0.5, help="Probability of a false alarm, jointly."),
    ] = 0.05,
    apriori: Annotated[
        bool, typer.Option("--apriori", help="Sigma as stated, not multiplied by sigma0.")
    ] = False,
) -> None:
    """Compare results, or test the rig of one."""
    methods = [name.strip() for name in method.split(",") if name.strip()]
    _check(methods, against, len(results))
    terminal.need_book("compare")
    from acx4book.report.campaigns import figures, tables, written  # noqa: PLC0415 quick help

    if len(results) == 1:
        rigidity = figures.read(results[0])
        written.write_rigidity(rigidity, out, name=results[0].resolve().name, level=level)
        lines = figures.for_terminal(rigidity, level=level)
    else:
        campaigns = tables.read(results, methods=methods)
        compared = tables.study(
            campaigns, against=against, height_m=height, level=level, apriori=apriori
        )
        written.write(compared, out)
        lines = tables.for_terminal(compared)
    terminal.show("\n".join([*lines, str(out / written.PAGE)]))


def _check(methods: list[str], against: str, n: int) -> None:
    """Refuse invalid or contradicting options."""
    known = ("single_step", "rig", "rig_calibration", "two_step_gnss", "two_step")
    if unknown := [name for name in methods if name not in known]:
        terminal.refuse(f"--method {unknown[0]}: must be one of {', '.join(known)}")
    if len(methods) not in {0, 1, n}:
        terminal.refuse(f"--method names {len(methods)} methods for {n} folders; name one, or {n}")
    if against not in {"previous", "first"}:
        terminal.refuse(f"--against {against}: must be previous or first")
