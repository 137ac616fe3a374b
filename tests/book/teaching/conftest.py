"""Cases of students, made once."""

import functools

import pytest

from acx4book.teaching import flights
from acx4book.teaching.handed_in import Answer
from acx4book.teaching.sheets.every import SHEETS

KEY = b"a key of no lecturer, for tests only"


@functools.cache
def case_and_right(sheet, student):
    case = flights.case_of(flights.flight_of(SHEETS[sheet], student, KEY))
    return case, SHEETS[sheet].solve(case)


@pytest.fixture(scope="session")
def solved():
    """Return the case and the right answers of a student on a sheet."""
    return case_and_right


@pytest.fixture(scope="session")
def key():
    return KEY


@pytest.fixture(scope="session")
def handed():
    """Return right answers as a student writes them, some replaced."""

    def answers(sheet, right, **replaced):
        out = {}
        for q in SHEETS[sheet].questions:
            value = replaced.get(q.name, right[q.name].value)
            sigma = right[q.name].sigma
            out[q.name] = Answer(
                value=round(value, q.digits),
                sigma=None if sigma is None else float(f"{sigma:.3g}"),
                unit=q.unit,
            )
        return out

    return answers
