"""A student's folder: the flight without its truth, what to do with it, and answers to fill in."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from acx4book.teaching import flights, students
from acx4book.teaching.case import Sheet
from acx4book.teaching.handed_in import ANSWERS, COLUMNS
from acx4lib.results.own_folder import whole_files
from acx4sim.files.writer import write_files

README = "README.md"


def write(sheet: Sheet, student: str, key: bytes, folder: Path) -> None:
    """Write the flight of a student, with nothing from which its truth could be read.

    Parameters
    ----------
    sheet : Sheet
    student : str
        Name, as it stands in what is handed in.
    key : bytes
    folder : Path
        New.
    """
    name = students.shown_name(student)
    flight = flights.flight_of(sheet, name, key)
    case = flights.case_of(flight)
    if sheet.hand_out is None:
        write_files(flight, folder)
    else:
        folder.mkdir(exist_ok=True)
        for file, content in sheet.hand_out(case).items():
            whole_files.write(folder / file, content)
    whole_files.write(folder / README, readme(sheet, name, sheet.given(case)))
    whole_files.write(folder / ANSWERS, answers(sheet, name))


def readme(sheet: Sheet, student: str, given: Sequence[str]) -> str:
    """Return what a student is told of the own flight, as Markdown."""
    asked = "\n".join(
        f"| {q.name} | {q.asks} | {q.unit or '-'} | {q.digits}{' and σ' if q.with_sigma else ''} |"
        for q in sheet.questions
    )
    told = "\n".join(given)
    return f"""# {sheet.name}: {sheet.title}

Flight of {student}, simulated. Every student has another flight with other true values.

{told}

Fill in the columns value and sigma of {ANSWERS}: decimal points, no thousands separators. Leave
sigma empty where none is asked for. Hand in this one file.

| question | what | unit | digits after the point |
|---|---|---|---|
{asked}
"""


def answers(sheet: Sheet, student: str) -> str:
    """Return the file to fill in."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([student, sheet.name, q.name, "", "", q.unit] for q in sheet.questions)
    return out.getvalue()
