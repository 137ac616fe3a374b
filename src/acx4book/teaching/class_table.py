"""The marks of a class: a table for the screen, a row for every answer as CSV, and totals."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from acx4book.teaching import flights, handed_in
from acx4book.teaching.flights import Rights
from acx4book.teaching.grading import Verdict, graded
from acx4book.teaching.sheets.every import sheet_of
from acx4lib.errors import Acx4Error

COLUMNS = (
    *("student", "sheet", "question", "value", "sigma", "unit"),
    *("right_value", "right_sigma", "points", "of", "verdict"),
)
"""Columns of the table as CSV."""

TOTALS = ("student", "points", "of")
"""Columns of the table of totals; a column for every sheet stands after the first."""


@dataclass(frozen=True, kw_only=True)
class Marks:
    """One student's marks on one sheet."""

    student: str
    sheet: str
    verdicts: tuple[Verdict, ...]

    @property
    def points(self) -> int:
        """Points reached."""
        return sum(verdict.points for verdict in self.verdicts)

    @property
    def of(self) -> int:
        """Largest possible number of points."""
        return sum(verdict.of for verdict in self.verdicts)


@dataclass(frozen=True, kw_only=True)
class Class:
    """The marks of a class.

    Attributes
    ----------
    marks : tuple of Marks
    unread : tuple of str
        A line on each hand-in that could not be graded.
    """

    marks: tuple[Marks, ...]
    unread: tuple[str, ...]


def grade(
    paths: Sequence[Path], key: bytes, shown: Callable[[Marks], object] = lambda _: None
) -> Class:
    """Grade the hand-ins of a class; unreadable ones are reported and do not stop it.

    Parameters
    ----------
    paths : sequence of Path
        As `handed_in.found` takes them.
    key : bytes
        The lecturer's key of the flights.
    shown : callable
        Called with the marks of each student as soon as they are known.
    """
    marks, unread = [], []
    submissions: list[handed_in.HandedIn] = []
    for path in handed_in.found(paths):
        try:
            submission = handed_in.read(path)
            sheet_of(submission.sheet)
            submissions.append(submission)
        except (Acx4Error, OSError, ValueError) as error:
            unread.append(_not_graded(path, error))

    @cache
    def right(sheet_name: str, student: str) -> Rights:
        sheet = sheet_of(sheet_name)
        return sheet.solve(flights.case_of(flights.flight_of(sheet, student, key)))

    def others(submission: handed_in.HandedIn) -> dict[str, Rights]:
        own_name = flights.same_name(submission.student)
        named = {o.student for o in submissions if o.sheet == submission.sheet}
        return {
            n: right(submission.sheet, n) for n in sorted(named) if flights.same_name(n) != own_name
        }

    for submission in submissions:
        try:
            marks.append(_marked(submission, key, partial(others, submission)))
            shown(marks[-1])
        except (Acx4Error, OSError, ValueError) as error:
            unread.append(_not_graded(submission.path, error))
    return Class(marks=tuple(marks), unread=tuple(unread))


def _not_graded(path: Path, error: Exception) -> str:
    if not isinstance(error, Acx4Error):
        return f"{path}: not graded: {' '.join(str(error).split())}"
    first, *more = str(error).splitlines()
    suffix = f" (and {len(more)} more)" if more else ""
    return f"{path}: not graded: {first.removeprefix(f'{path}: ')}{suffix}"


def _marked(
    submission: handed_in.HandedIn, key: bytes, others: Callable[[], dict[str, Rights]] = dict
) -> Marks:
    """Grade one student on one sheet, with the flight simulated again."""
    sheet = sheet_of(submission.sheet)
    case = flights.case_of(flights.flight_of(sheet, submission.student, key))
    verdicts = tuple(graded(sheet, case, submission.answers, others))
    return Marks(student=submission.student, sheet=sheet.name, verdicts=verdicts)


# --- totals ----------------------------------------------------------------------------------


def _totals(found: Class) -> dict[str, dict[str, Marks]]:
    """Return the best marks of every student by sheet."""
    by_student: dict[str, dict[str, Marks]] = {}
    shown: dict[str, str] = {}
    for marks in found.marks:
        name = shown.setdefault(flights.same_name(marks.student), marks.student)
        best = by_student.setdefault(name, {})
        if marks.sheet not in best or marks.points > best[marks.sheet].points:
            best[marks.sheet] = marks
    return {name: by_student[name] for name in sorted(by_student)}


def total_lines(found: Class) -> Iterator[str]:
    """Yield a line with the total points of every student; nothing if all have one sheet."""
    totals = _totals(found)
    if all(len(best) == 1 for best in totals.values()):
        return
    for name, best in totals.items():
        points, possible = (
            sum(getattr(m, attribute) for m in best.values()) for attribute in ("points", "of")
        )
        yield f"{name}  {len(best)} sheets  {points} of {possible}"


def totals_text(found: Class) -> str:
    """Return the totals as CSV: a row for every student, a column for every sheet."""
    totals = _totals(found)
    sheets = sorted({sheet for best in totals.values() for sheet in best})
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([TOTALS[0], *sheets, *TOTALS[1:]])
    for name, best in totals.items():
        points = [best[sheet].points if sheet in best else "" for sheet in sheets]
        sums = [sum(m.points for m in best.values()), sum(m.of for m in best.values())]
        writer.writerow([name, *points, *sums])
    return out.getvalue()


def lines(marks: Marks) -> Iterator[str]:
    """Yield a student's marks as lines: the points, and below them the wrong answers."""
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
