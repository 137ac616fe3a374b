"""The marks of a class: a table for the screen, and a row for every answer as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from acx4book.teaching import flights, handed_in
from acx4book.teaching.grading import Verdict, graded
from acx4book.teaching.sheets.every import sheet_of
from acx4lib.errors import Acx4Error

COLUMNS = (
    *("student", "sheet", "question", "value", "sigma", "unit"),
    *("right_value", "right_sigma", "points", "of", "verdict"),
)
"""Of the table as CSV."""


@dataclass(frozen=True, kw_only=True)
class Marks:
    """One student's marks on one sheet.

    Attributes
    ----------
    student, sheet : str
    verdicts : tuple of Verdict
    """

    student: str
    sheet: str
    verdicts: tuple[Verdict, ...]

    @property
    def points(self) -> int:
        """Points reached."""
        return sum(verdict.points for verdict in self.verdicts)

    @property
    def of(self) -> int:
        """Points to be had."""
        return sum(verdict.of for verdict in self.verdicts)


@dataclass(frozen=True, kw_only=True)
class Class:
    """The marks of a class.

    Attributes
    ----------
    marks : tuple of Marks
    unread : tuple of str
        A line on each hand-in that could not be read.
    """

    marks: tuple[Marks, ...]
    unread: tuple[str, ...]


def grade(
    paths: Sequence[Path], key: bytes, shown: Callable[[Marks], object] = lambda _: None
) -> Class:
    """Grade what a class handed in; what cannot be read stops nothing.

    Parameters
    ----------
    paths : sequence of Path
        As `handed_in.found` takes them.
    key : bytes
        With which the flights were made.
    shown : callable
        Called with the marks of each student as soon as they are known.
    """
    marks, unread = [], []
    paths = handed_in.found(paths)
    for path in paths:
        try:
            marks.append(marked(handed_in.read(path), key))
            shown(marks[-1])
        except Acx4Error as error:
            first, *more = str(error).splitlines()
            also = f" (and {len(more)} more)" if more else ""
            unread.append(f"{path}: not graded: {first.removeprefix(f'{path}: ')}{also}")
        except (OSError, ValueError) as error:
            unread.append(f"{path}: not graded: {' '.join(str(error).split())}")
    return Class(marks=tuple(marks), unread=tuple(unread))


def marked(given: handed_in.HandedIn, key: bytes) -> Marks:
    """Return the marks of one student on one sheet; the flight is made again."""
    sheet = sheet_of(given.sheet)
    case = flights.case_of(flights.flight_of(sheet, given.student, key))
    verdicts = tuple(graded(sheet, case, given.answers))
    return Marks(student=given.student, sheet=sheet.name, verdicts=verdicts)


def lines(marks: Marks) -> Iterator[str]:
    """Yield a student's marks for the screen: the points, and under them what is wrong."""
    yield f"{marks.student}  {marks.sheet}  {marks.points} of {marks.of}"
    for verdict in marks.verdicts:
        if verdict.says:
            yield f"    {verdict.question.name}: {verdict.says}"


def text(found: Class) -> str:
    """Return the table as CSV, a row for every question."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(COLUMNS)
    for marks in found.marks:
        for verdict in marks.verdicts:
            writer.writerow([marks.student, marks.sheet, *_cells(verdict)])
    return out.getvalue()


def _cells(verdict: Verdict) -> list[object]:
    answer, right = verdict.answer, verdict.right
    value, sigma = (None, None) if answer is None else (answer.value, answer.sigma)
    right_sigma = "" if right.sigma is None else f"{right.sigma:.6g}"
    return [
        verdict.question.name,
        *("" if number is None else repr(number) for number in (value, sigma)),
        verdict.question.unit,
        f"{right.truth:.{verdict.question.digits}f}",
        right_sigma,
        verdict.points,
        verdict.of,
        verdict.says or "right",
    ]
