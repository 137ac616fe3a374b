"""The questions of the lab sheets, and their solutions for one demonstration student, as pages."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd

from acx4book.teaching import flights
from acx4book.teaching.flights import Mistake, Rights, Sheet
from acx4book.teaching.grading import apart
from acx4book.teaching.sheets.every import SHEETS
from acx4book.typesetting.myst import MISSING, myst_table
from acx4book.typesetting.plain_text import Markup

STUDENT = "Demonstration"
KEY = b"the public key of the book's demonstration flights"
"""Anybody can compute the truth from this public key, so a class needs another."""


def texts() -> Iterator[tuple[str, str]]:
    """Yield names and texts: the questions of every sheet, and the solutions of all."""
    for sheet in SHEETS.values():
        yield f"{sheet.name}-questions.md", _questions(sheet)
        yield f"{sheet.name}-solution.md", _solution(sheet)


def _questions(sheet: Sheet) -> str:
    """Return the questions of a sheet as MyST text."""
    rows = [
        (
            Markup(f"`{q.name}`"),
            q.asks,
            q.unit or MISSING,
            q.digits,
            "yes" if q.with_sigma else MISSING,
        )
        for q in sheet.questions
    ]
    table = pd.DataFrame(rows, columns=["Name", "Question", "Unit", "Digits", "With σ"])
    caption = "What to hand in; digits are those after the decimal point"
    return myst_table(table, caption, name=f"tab-{sheet.name}")


def _solution(sheet: Sheet) -> str:
    """Return the solution of a sheet for the demonstration flight, with common mistakes."""
    case = flights.case_of(flights.flight_of(sheet, STUDENT, KEY))
    right = sheet.solve(case)
    facts = " ".join(sheet.given(case))
    answers = myst_table(
        _answers(sheet, right),
        f"Solution of {sheet.name} for the demonstration flight",
        name=f"tab-{sheet.name}-solution",
    )
    wrong = myst_table(
        _mistakes(sheet, right, [*sheet.mistakes(case, right)]),
        f"Mistakes on {sheet.name}, and a wrong answer by which each is known",
        name=f"tab-{sheet.name}-mistakes",
    )
    return f"{facts}\n\n{answers}\n\n{wrong}"


def _answers(sheet: Sheet, right: Rights) -> pd.DataFrame:
    """Tabulate the right answers."""
    rows = []
    for q in sheet.questions:
        answer = right[q.name]
        sigma = MISSING if answer.sigma is None else f"{answer.sigma:.{q.digits}f}"
        estimated = answer.sigma is not None
        true = f"{answer.truth:.{q.digits}f}" if estimated else MISSING
        value = f"{answer.value:.{q.digits}f}"
        rows.append((Markup(f"`{q.name}`"), value, sigma, true, q.unit or MISSING))
    return pd.DataFrame(rows, columns=["Name", "Right answer", "σ", "Truth", "Unit"])


def _mistakes(sheet: Sheet, right: Rights, mistakes: Sequence[Mistake]) -> pd.DataFrame:
    """Tabulate each mistake with its most changed answer, relative to the accepted bound."""
    rows = []
    for mistake in mistakes:
        deviations = [
            (apart(name, value, right[name].truth) / right[name].bound, name, value)
            for name, value in mistake.gives.items()
        ]
        deviation, name, value = max(deviations, default=(0.0, "", 0.0))
        if deviation > 1.0:
            q = next(q for q in sheet.questions if q.name == name)
            wrong = f"{value:.{q.digits}f}" if round(value, q.digits) else f"{value:.2g}"
            pair = (f"{right[name].value:.{q.digits}f}", wrong)
            rows.append((mistake.says, Markup(f"`{name}`"), *pair))
        elif mistake.gives_sigma:
            name, sigma = next(iter(mistake.gives_sigma.items()))
            pair = (f"{right[name].sigma:.2g}", f"{sigma:.2g}")
            rows.append((mistake.says, Markup(f"σ of `{name}`"), *pair))
    return pd.DataFrame(rows, columns=["Mistake", "For example", "Right", "Wrong"])
