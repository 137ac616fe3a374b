"""A student's questions as a question bank of learning platforms, in GIFT.

An answer is accepted in the range that `grading` accepts, and a common mistake is known by the
range around what it gives, with its sentence as feedback. The first range that an answer lies in
counts. A bank holds the truth: it is the lecturer's.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4book.teaching import flights
from acx4book.teaching.flights import Case, Mistake, Question, Right, Sheet
from acx4book.teaching.grading import ALIKE, SIGMA_FACTOR, UNITS, apart
from acx4files.results import whole_files

GIFT = "questions.gift"
"""File of a bank."""

RIGHT = "Right."

LARGE = 1e12
"""Larger than any answer."""


@dataclass(frozen=True, kw_only=True)
class Range:
    """Interval from `low` to `high`, with the feedback on answers in it."""

    low: float
    high: float
    says: str


@dataclass(frozen=True, kw_only=True)
class _Item:
    """A question of a bank; its mistakes stand in the order in which they are looked at."""

    name: str
    asks: str
    right: Range
    mistakes: tuple[Range, ...]


def write(sheet: Sheet, student: str, key: bytes, folder: Path) -> None:
    """Write the bank of a student.

    Parameters
    ----------
    sheet : Sheet
    student : str
    key : bytes
    folder : Path
        New.
    """
    name = flights.shown_name(student)
    items = _items(sheet, flights.case_of(flights.flight_of(sheet, name, key)))
    folder.mkdir()
    title = flights.title(sheet.name, name)
    whole_files.write(folder / GIFT, _gift(items, title))


def _gift(bank: Sequence[_Item], title: str) -> str:
    """Return questions as GIFT."""
    category = title.replace("/", "-")  # a slash would begin a subcategory
    return "\n\n".join([f"$CATEGORY: {category}", *map(_gift_item, bank)]) + "\n"


def _items(sheet: Sheet, case: Case) -> list[_Item]:
    """Return the questions of a sheet on one flight, with a question for each sigma."""
    right = sheet.solve(case)
    mistakes = [*sheet.mistakes(case, right)]
    facts = " ".join(re.sub("`", "", line) for line in sheet.given(case))
    items = []
    for question in sheet.questions:
        items.append(_value(question, right[question.name], mistakes, facts))
        if question.with_sigma:
            items.append(_sigma(question, right[question.name], mistakes, facts))
    return items


def _value(question: Question, right: Right, mistakes: Sequence[Mistake], facts: str) -> _Item:
    name, digits = question.name, question.digits
    unit = f" ({question.unit})" if question.unit else ""
    after = f"{digits} digits after the decimal point" if digits else "a whole number"
    return _Item(
        name=name,
        asks=" ".join(filter(None, [facts, f"{question.asks}{unit}, {after}."])),
        right=_around(right.truth, right.bound, RIGHT),
        mistakes=tuple(_wrong_values(question, right, mistakes)),
    )


def _wrong_values(question: Question, right: Right, mistakes: Sequence[Mistake]) -> Iterator[Range]:
    for mistake in mistakes:
        gives = mistake.gives.get(question.name)
        if gives is not None and apart(question.name, gives, right.truth) > right.bound:
            yield _around(gives, right.bound * mistake.scale, mistake.says)
    for unit, factor in UNITS.get(question.unit, {}).items():
        says = f"given in {unit}; asked for in {question.unit}"
        if abs(right.truth) > right.bound and all(says != other.says for other in mistakes):
            yield _around(factor * right.truth, factor * right.bound, says)


def _around(value: float, bound: float, says: str) -> Range:
    return Range(low=value - bound, high=value + bound, says=says)


def _sigma(question: Question, right: Right, mistakes: Sequence[Mistake], facts: str) -> _Item:
    unit, known = question.unit, right.sigma or 0.0
    others = {f"σ is given in {u}; asked for in {unit}": f for u, f in UNITS.get(unit, {}).items()}
    ranges = [
        *(
            _by_factor(sigma, ALIKE, mistake.says)
            for mistake in mistakes
            if (sigma := mistake.gives_sigma.get(question.name, 0.0)) > 0
        ),
        *(_by_factor(factor * known, SIGMA_FACTOR, says) for says, factor in others.items()),
        Range(low=-LARGE, high=0.0, says="σ must be positive"),
        Range(low=0.0, high=known / SIGMA_FACTOR, says="σ is too small"),
        Range(low=known * SIGMA_FACTOR, high=LARGE, says="σ is too large"),
    ]
    return _Item(
        name=f"sigma_{question.name}",
        asks=" ".join(filter(None, [facts, f"Standard deviation of: {question.asks} ({unit})."])),
        right=_by_factor(known, SIGMA_FACTOR, RIGHT),
        mistakes=tuple(ranges),
    )


def _by_factor(value: float, factor: float, says: str) -> Range:
    return Range(low=value / factor, high=value * factor, says=says)


# --- GIFT: a text, as Moodle reads it


SPECIAL = re.compile(r"([~=#{}:\\])")


def _gift_item(item: _Item) -> str:
    lines = [
        f"={points}{_number(interval.low)}..{_number(interval.high)}#{_escaped(interval.says)}"
        for points, interval in [
            ("", item.right),
            *(("%0%", interval) for interval in item.mistakes),
        ]
    ]
    inside = "\n".join(lines)
    return f"::{_escaped(item.name)}::[plain]{_escaped(item.asks)} {{#\n{inside}\n}}"


def _escaped(text: str) -> str:
    return SPECIAL.sub(r"\\\1", text)


def _number(value: float) -> str:
    """Return a number without exponent, since some readers of GIFT reject exponents."""
    return np.format_float_positional(value, precision=12, fractional=False, trim="-")
