"""Hand-ins of students, read as data: answers.csv, or the results folder of a run.

Nothing of it is executed, and each reading error is one sentence. Spreadsheets of countries
with a decimal comma write it, and semicolons between cells: both are read.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from acx4book.teaching import flights
from acx4book.teaching.flights import Sheet
from acx4files.flight.problems import Range, lines_of
from acx4files.flight.table_files import read_columns
from acx4files.flight.tables import NUMBER, Schema, Table, numbers_of
from acx4files.flight.toml_file import read_toml
from acx4files.results import whole_files
from acx4lib.errors import FlightError
from acx4sim.files import write_files

ANSWERS = "answers.csv"
"""The file to fill in, in the folder of every student's flight."""

COLUMNS = ("student", "sheet", "question", "value", "sigma", "unit")
"""Columns of answers.csv."""

LARGEST_NUMBER = 1e300
"""Larger than any answer."""

OF_RUN = ("parameters.csv", "flight/flight.toml")
"""Files read from a results folder."""

METHODS = {"single_step": "", "two_step": "two_step_"}
"""Methods of the mounting stage with answers, and the prefix of their questions."""

_ANSWERS = Schema(
    required=COLUMNS, may_be_empty=("value", "sigma", "unit"), keys=(("question",),), ranges={}
)
_PARAMETERS = Schema(
    required=("stage", "method", "camera", "parameter", "value", "sigma", "unit"),
    may_be_empty=("camera",),
    keys=(("stage", "method", "camera", "parameter"),),
    ranges={"value": Range(-1e12, 1e12), "sigma": Range(0.0, 1e12)},
)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """A number handed in, with its standard deviation.

    Attributes
    ----------
    value, sigma : float or None
        None if the cell is empty or not a number.
    unit : str
    no_number : tuple of str
        The cells among these two that are not numbers, as written.
    """

    value: float | None
    sigma: float | None
    unit: str
    no_number: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class HandedIn:
    """The answers of one student to one sheet.

    Attributes
    ----------
    path : Path
    student, sheet : str
    answers : mapping of str to Answer
        By question.
    """

    path: Path
    student: str
    sheet: str
    answers: Mapping[str, Answer]


def found(paths: Sequence[Path]) -> list[Path]:
    """Return the files and results folders in given paths, in the order of their names.

    Parameters
    ----------
    paths : sequence of Path
        Answers, results folders, folders with answers, and folders of any of these.
    """
    return [
        place for path in paths for place in (_inside(path) if _is_collection(path) else [path])
    ]


def _is_collection(path: Path) -> bool:
    """Tell whether a path is a folder of hand-ins, not a student's own or a results folder."""
    return path.is_dir() and not any(os.path.lexists(path / n) for n in (ANSWERS, OF_RUN[0]))


def _inside(folder: Path) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        if not path.name.startswith(".") and (path.is_dir() or path.suffix == ".csv"):
            yield path


def read(path: Path) -> HandedIn:
    """Read the answers of a student.

    Raises
    ------
    FlightError
        A line for each problem.
    """
    if not path.is_dir():
        return _of_answers(path)
    if os.path.lexists(path / ANSWERS):
        return _of_answers(path / ANSWERS)
    return _of_run(path)


def _of_answers(path: Path) -> HandedIn:
    table = _table(path, _ANSWERS, as_written=_with_points)
    named = {(_students_name(s), sheet) for s, sheet in zip(*_columns(table, 2), strict=True)}
    if len(named) != 1:
        raise FlightError([f"{path}: must be the answers of one student to one sheet"])
    ((student, sheet),) = named
    return HandedIn(path=path, student=student, sheet=sheet, answers=_answers(table))


def _columns(table: Table, n: int) -> list[Sequence[str]]:
    return [table.text[name] for name in COLUMNS[:n]]


def _answers(table: Table) -> dict[str, Answer]:
    cells = zip(*(table.text[name] for name in COLUMNS[2:]), strict=True)
    return {
        name: Answer(
            value=_number(value),
            sigma=_number(sigma),
            unit=unit.strip(),
            no_number=tuple(
                cell.strip() for cell in (value, sigma) if cell.strip() and _number(cell) is None
            ),
        )
        for name, value, sigma, unit in cells
    }


def _number(cell: str) -> float | None:
    """Return the number in a cell; None if missing, not finite or too large."""
    value = float(numbers_of([cell])[0])
    return value if abs(value) < LARGEST_NUMBER else None


# --- as spreadsheets write -------------------------------------------------------------------

_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?|[+-]?\d+,", re.ASCII)
_GROUPED = re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+", re.ASCII)
_MINUS = str.maketrans("\u2212", "-")


def _with_points(text: str) -> str:
    """Return a table with commas between cells and decimal points, line by line."""
    header = text.partition("\n")[0]
    between = ";" if ";" in header and "," not in header else ","
    try:
        rows = list(csv.reader(io.StringIO(text, newline=""), delimiter=between, strict=True))
    except csv.Error:  # the reader of tables reports the problem
        return text
    header_cells = [name.strip() for name in rows[0]] if rows else []
    numbers = [k for k, name in enumerate(header_cells) if name in ("value", "sigma")]
    plain = [
        [_with_point(cell) if k in numbers else cell for k, cell in enumerate(row)] for row in rows
    ]
    if between == "," and plain == rows:
        return text
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(plain)
    return out.getvalue()


def _with_point(cell: str) -> str:
    """Return a number with decimal comma or typographic minus in the notation of Python."""
    number = cell.strip().translate(_MINUS)
    if _GROUPED.fullmatch(number):
        return number.replace(".", "").replace(",", ".")
    if _COMMA.fullmatch(number):
        return number.replace(",", ".")
    if NUMBER.fullmatch(number):
        return number
    # a minus before other text would be read as a formula
    return re.sub(r"^\s*-", "\u2212", cell)


def _students_name(text: str) -> str:
    """Return a student's name in normal form; FlightError if it is not valid."""
    try:
        return flights.shown_name(text)
    except ValueError as error:
        raise FlightError([f"student: {error}"]) from None


def _of_run(folder: Path) -> HandedIn:
    table = _table(folder / OF_RUN[0], _PARAMETERS)
    document = read_toml(folder / OF_RUN[1])
    if document.problems:
        raise FlightError(lines_of(document.problems))
    try:
        sheet, student = flights.of_title(str(document.get("name")))
    except ValueError as error:
        raise FlightError([f"{folder}: {error}"]) from None
    return HandedIn(
        path=folder, student=_students_name(student), sheet=sheet, answers=_estimates(table)
    )


def _estimates(table: Table) -> dict[str, Answer]:
    text = table.text
    return {
        METHODS[method] + name: Answer(
            value=float(table.numbers["value"][k]),
            sigma=float(table.numbers["sigma"][k]),
            unit=text["unit"][k],
        )
        for k, (stage, method, name) in enumerate(
            zip(text["stage"], text["method"], text["parameter"], strict=True)
        )
        if stage == "mounting" and method in METHODS
    }


def _table(path: Path, schema: Schema, *, as_written: Callable[[str], str] = str) -> Table:
    """Read a table; FlightError on any problem."""
    table = read_columns(path, str(path), schema, needed_by="a mark", as_written=as_written)
    if table.problems:
        raise FlightError(lines_of(table.problems))
    return table


# --- A student's folder: the flight without its truth, what to do with it, and answers to fill in


README = "README.md"


def write(sheet: Sheet, student: str, key: bytes, folder: Path) -> None:
    """Write the flight of a student without its truth.

    Parameters
    ----------
    sheet : Sheet
    student : str
        Name as in the hand-in.
    key : bytes
    folder : Path
        New.
    """
    name = flights.shown_name(student)
    flight = flights.flight_of(sheet, name, key)
    case = flights.case_of(flight)
    if sheet.hand_out is None:
        write_files(flight, folder)
    else:
        folder.mkdir(exist_ok=True)
        for file, content in sheet.hand_out(case).items():
            whole_files.write(folder / file, content)
    whole_files.write(folder / README, _readme(sheet, name, sheet.given(case)))
    whole_files.write(folder / ANSWERS, _to_fill_in(sheet, name))


def _readme(sheet: Sheet, student: str, given: Sequence[str]) -> str:
    """Return the instructions for a student's flight, as Markdown."""
    asked = "\n".join(
        f"| {q.name} | {q.asks} | {q.unit or '-'} | {q.digits}{' and σ' if q.with_sigma else ''} |"
        for q in sheet.questions
    )
    facts = "\n".join(given)
    return f"""# {sheet.name}: {sheet.title}

Flight of {student}, simulated. Every student has another flight with other true values.

{facts}

Fill in the columns value and sigma of {ANSWERS}: decimal points, no thousands separators. Leave
sigma empty where none is asked for. Hand in this one file.

| question | what | unit | digits after the point |
|---|---|---|---|
{asked}
"""


def _to_fill_in(sheet: Sheet, student: str) -> str:
    """Return the file to fill in."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([student, sheet.name, q.name, "", "", q.unit] for q in sheet.questions)
    return out.getvalue()
