"""The command ``acx4 import``: a command for every kind of files, made of its reader.

A reader's parameters and docstring are the options and the help of its command
(`acx4files.exchange.options`). The readers are loaded when `acx4 import` is called, not before.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer
from typer.core import TyperGroup

from acx4book.command import terminal

if TYPE_CHECKING:
    from acx4files.exchange.flight_folder import ImportedFlight

HELP = """Write a flight, or a part of one, of other programs' files.

Every kind says on the screen, and in import.md of the flight, which conventions it assumed, what it
found, and what it left out. A flight may come from several sources: each import adds its tables to
the folder. What is still missing is named at the end.

\b
Examples:
  acx4 import metashape project.xml --out my_flight
  acx4 import sbet a.out --events log.csv --time gps-sow --out my_flight
"""

KINDS = {
    "Where images were taken, and in which attitude": {
        "sbet": "trajectories.sbet.read",
        "orientations": "trajectories.orientations.read",
    },
    "Points measured in images, and surveyed": {
        "image-points": "trajectories.orientations.measured",
        "control-points": "trajectories.orientations.surveyed",
    },
    "Pictures alone": {"pictures": "pictures.read_folder"},
    "Projects": {
        "metashape": "programs.metashape.read",
        "colmap": "programs.colmap.read",
        "opf": "programs.opf.read",
        "pix4d": "programs.pix4d.read",
    },
    "Blocks and adjustments": {
        "opensfm": "programs.opensfm.read",
        "micmac": "programs.micmac.read",
        "bingo": "programs.photo_lists.read_bingo",
        "patb": "programs.photo_lists.read_patb",
        "odm-control": "programs.opensfm.read_control",
    },
}
"""The kinds grouped by their content, in the order of the help, and their readers."""

OUT = typer.Option(
    metavar="FLIGHT",
    help="The flight: a new folder, or one that an import began, to which this is added.",
)

LARGEST_UNDULATION_M = 200.0

TO_DO = 8
"""Largest number of lines on missing parts of a flight."""


class _Grouped(TyperGroup):
    """The kinds, made when they are asked for, with a help that lists them by their content."""

    @property
    def commands(self) -> Any:
        """Commands by their names."""
        return _commands()

    @commands.setter
    def commands(self, none: Any) -> None:
        """Typer sets those that it knows of: none."""

    def format_commands(self, _: Any, formatter: Any) -> None:
        """Write a list for each group of kinds."""
        for title, names in KINDS.items():
            rows = [(name, self.commands[name].get_short_help_str(limit=150)) for name in names]
            with formatter.section(title):
                formatter.write_dl(rows)


app = typer.Typer(cls=_Grouped, no_args_is_help=True, rich_markup_mode=None, help=HELP)


@app.callback()
def _every() -> None:
    """Keep the group a group: its commands are made later."""


# --- commands made of readers


@cache
def _commands() -> dict[str, Any]:
    """Return the command of every kind by its name."""
    made = typer.Typer(add_completion=False, rich_markup_mode=None)
    for readers in KINDS.values():
        for name, path in readers.items():
            module, _, function = path.rpartition(".")
            reader = getattr(importlib.import_module(f"acx4files.exchange.{module}"), function)
            made.command(name, help=_help(reader))(_command(reader))
    return dict(typer.main.get_group(made).commands)


def _command(reader: Callable[..., ImportedFlight]) -> Callable[..., None]:
    """Return the function of a command: it reads with the options of a reader, and writes."""
    hints = get_type_hints(reader, include_extras=True)
    parameters, of_flight = [], []
    for parameter in inspect.signature(reader).parameters.values():
        means, option = get_args(hints[parameter.name])
        if option.of_flight:
            of_flight.append(parameter.name)
        if option.help:
            said = _info(parameter, option)
            parameters.append(parameter.replace(annotation=Annotated[_typed(means), said]))
    out = inspect.Parameter("out", inspect.Parameter.KEYWORD_ONLY, annotation=Annotated[Path, OUT])
    parameters.sort(key=lambda one: (one.kind, one.default is not one.empty))
    needed = sum(one.default is one.empty for one in parameters)
    parameters.insert(needed, out)

    def command(out: Path, **given: Any) -> None:
        source = given.pop(parameters[0].name)
        if given.get("heights"):
            given["heights"] = heights_of(given["heights"])
        begun = system_of(out)
        given |= {key: begun[key] for key in of_flight if key in begun and not given.get(key)}
        _place(reader(source, **given), out)

    command.__annotations__ = {one.name: one.annotation for one in parameters}
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return command


def _help(reader: Callable[..., ImportedFlight]) -> str:
    """Return the first paragraphs of a docstring, and its examples, as help of a command."""
    said, *sections = inspect.cleandoc(reader.__doc__ or "").split("\n\nExamples\n--------\n")
    examples = [line for part in sections for line in part.split("\n\n")[0].splitlines()]
    return "\n".join([said, "", "\b", "Examples:", *(f"  {line}" for line in examples)])


def _typed(means: Any) -> Any:
    """Return the type of an option: a number or a text is a text on the command line."""
    return str | None if {str, float} <= set(get_args(means)) else means


def _info(parameter: inspect.Parameter, option: Any) -> Any:
    """Return what Typer knows of an option; of a source it is an argument."""
    said: dict[str, Any] = {"help": option.help, "metavar": option.metavar or None}
    if parameter.kind is not parameter.KEYWORD_ONLY:
        return typer.Argument(show_default=False, **said)
    limits = {"min": option.low, "max": option.high}
    name = f"--{parameter.name.replace('_', '-')}"
    return typer.Option(name, show_default=parameter.default not in {None, ""}, **said, **limits)


# --- what all kinds have in common: the system of the flight, what is written, what is said


def heights_of(text: str) -> str | float:
    """Return the heights of a flight from the text of an option; a number is an undulation, m."""
    try:
        undulation = float(text)
    except ValueError:
        file = Path(text)  # PROJ needs the absolute path of a grid
        return str(file.absolute()) if file.is_file() else text
    if not abs(undulation) <= LARGEST_UNDULATION_M:
        terminal.refuse(f"--heights: {text}: must be at most {LARGEST_UNDULATION_M:g} m either way")
    return undulation


def system_of(out: Path) -> dict[str, str | float]:
    """Return CRS and heights that the flight.toml of a folder has; nothing where there is none."""
    from acx4files.flight.problems import lines_of  # noqa: PLC0415 quick help
    from acx4files.flight.settings import FLIGHT  # noqa: PLC0415 quick help
    from acx4files.flight.toml_file import read_toml  # noqa: PLC0415 quick help
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help

    path = out / "flight.toml"
    if not path.exists():
        return {}
    toml = read_toml(path)
    known = {key: toml.values[key] for key in ("crs", "heights") if toml.values.get(key, "") != ""}
    problems = [problem for problem in toml.problems if problem.column == "file"]
    for key in known:
        problems += FLIGHT.keys[key].problems(toml, (key,))
    if problems:
        raise FlightError(lines_of(problems))
    grid = known.get("heights")
    if isinstance(grid, str) and (out / grid).is_file():
        known["heights"] = str((out / grid).absolute())
    return known


def _place(imported: ImportedFlight, out: Path) -> None:
    """Write imported data, and report assumptions, findings, omissions and missing parts."""
    from acx4files.exchange import flight_folder  # noqa: PLC0415 quick help

    if imported.settings and not (out / flight_folder.SETTINGS).is_file():
        named = {"name": out.resolve().name} | dict(imported.settings)
        imported = replace(imported, settings=named)
    imported = flight_folder.with_no_control(flight_folder.with_synthetic(imported), out)
    remarks = flight_folder.write(imported, out)
    terminal.show(imported.source)
    for title, sentences in (
        ("warning", imported.warnings),
        ("assumed", imported.assumed),
        ("found", (*imported.found, *remarks)),
        ("left out", imported.left_out),
    ):
        for sentence in sentences:
            terminal.show(f"  {title}: {sentence}")
    for line in missing(out):
        terminal.show(f"  {line}")
    terminal.show(out)


def missing(flight: Path) -> list[str]:
    """Return lines on missing parts of a flight, or notes on the conventions of a whole one."""
    from acx4files.conventions import notes  # noqa: PLC0415 quick help
    from acx4files.flight.reader import read  # noqa: PLC0415 quick help
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help

    try:
        flown = read(flight)
    except FlightError as error:
        lines = [f"still to do: {line}" for line in error.problems]
        more = [f"still to do: {len(lines) - TO_DO} more: acx4 check"] * (len(lines) > TO_DO)
        return lines[:TO_DO] + more
    return [f"check: {note}" for note in (*flown.notes, *notes(flown))]
