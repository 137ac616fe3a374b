"""Comparison of answers with the truth, and explanation of wrong ones by common mistakes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acx4book.teaching.flights import Case, Mistake, Question, Right, Rights, Sheet
from acx4book.teaching.handed_in import Answer
from acx4files.flight.problems import quoted
from acx4lib.errors import visible
from acx4lib.expected import Array
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk

SIGMA_FACTOR = 1.3
"""A standard deviation is right up to this factor: methods and redundancies differ."""

ALIKE = 1.08
"""A wrong standard deviation is explained by a mistake up to this factor."""

UNEXPLAINED = "no common mistake gives this value"

UNITS = {
    "m": {"mm": 1e3, "cm": 1e2, "km": 1e-3},
    "mm": {"µm": 1e3, "m": 1e-3},
    "um": {"mm": 1e-3, "nm": 1e3},
    "deg": {"seconds of arc": 3600.0, "minutes of arc": 60.0, "radians": float(np.pi / 180.0)},
}
"""Wrong units of answers, by the right unit, with their factors."""

COPIED = 3
"""Number of matching answers that prove a copy; fewer suffice if all match."""

DIGITS = 500.0
"""Smallest size of an answer that tells flights apart, in units of its last digit."""


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Verdict on one answer.

    Attributes
    ----------
    question : Question
    answer : Answer or None
        None where nothing was handed in.
    right : Right
    points, of : int
        Points reached and possible: one for the value, one for a standard deviation.
    says : str
        Empty for a right answer.
    """

    question: Question
    answer: Answer | None
    right: Right
    points: int
    of: int
    says: str


def graded(
    sheet: Sheet,
    case: Case,
    answers: Mapping[str, Answer],
    others: Callable[[], Mapping[str, Rights]] = dict,
) -> list[Verdict]:
    """Return a verdict on every question of a sheet.

    Parameters
    ----------
    sheet : Sheet
    case : Case
        The student's flight with its truth.
    answers : mapping of str to Answer
        By question; what is not asked for is not looked at.
    others : callable, optional
        Returns the right answers of other students, by their names; called if something is wrong.
    """
    right = sheet.solve(case)
    values = {
        q.name: a.value
        for q in sheet.questions
        if (a := answers.get(q.name)) is not None and a.value is not None and _unit(q, a)
    }
    wrong = {n: v for n, v in values.items() if not apart(n, v, right[n].truth) <= right[n].bound}
    sigmas = {
        q.name: s
        for q in sheet.questions
        if q.with_sigma and q.name in values and (s := answers[q.name].sigma) is not None
    }
    wrong_sigma = {n: s for n, s in sigmas.items() if not _sigma_is_right(s, right[n])}
    mistakes = [*sheet.mistakes(case, right)] if wrong or wrong_sigma else []
    copied = [*_copies(sheet, wrong, others())] if wrong else []
    units = {q.name: q.unit for q in sheet.questions}
    in_units = _in_other_units(wrong, right, units)
    why = {
        name: in_units.get(name, says) if says == UNEXPLAINED else says
        for name, says in _explained(wrong, right, [*copied, *mistakes]).items()
    }
    why_sigma = _explained_sigma(wrong_sigma, right, [*copied, *mistakes], units)
    return [
        _verdict(q, answers.get(q.name), right[q.name], why, why_sigma) for q in sheet.questions
    ]


def apart(name: str, a: float, b: float) -> float:
    """Return the difference of two answers to a question; of angles without whole turns."""
    return abs((a - b + 180.0) % 360.0 - 180.0) if name.endswith("_deg") else abs(a - b)


def _unit(question: Question, answer: Answer) -> bool:
    return answer.unit in ("", question.unit)


def _sigma_is_right(sigma: float, right: Right) -> bool:
    known = right.sigma or np.nan
    return bool(known / SIGMA_FACTOR <= sigma <= known * SIGMA_FACTOR)


def _verdict(
    question: Question,
    answer: Answer | None,
    right: Right,
    why: Mapping[str, str],
    why_sigma: Mapping[str, str],
) -> Verdict:
    """Return the verdict on one answer from the explanations of wrong answers."""
    full_marks = 2 if question.with_sigma else 1
    says, points = [], 0
    unread = [visible(quoted(cell)) for cell in answer.no_number] if answer else []
    if answer is None or answer.value is None:
        says.append(f"{unread[0]} is no number" if unread else "not answered")
    elif not _unit(question, answer):
        says.append(f"unit {answer.unit}; asked for in {question.unit}")
    else:
        says += [why[question.name]] if question.name in why else []
        points += question.name not in why
        if question.with_sigma:
            missing = "" if answer.sigma is not None else "σ is missing"
            missing = f"σ: {unread[0]} is no number" if unread else missing
            remark = why_sigma.get(question.name, missing)
            says += [remark] if remark else []
            points += not remark
    return Verdict(
        question=question,
        answer=answer,
        right=right,
        points=points,
        of=full_marks,
        says="; ".join(says),
    )


# --- which mistake -----------------------------------------------------------------------------


def _explained(
    wrong: Mapping[str, float], right: Rights, mistakes: Sequence[Mistake]
) -> dict[str, str]:
    """Return the sentence on the mistake behind every wrong answer."""
    # the mistake that explains most answers comes first; among equal ones, the one with the nearest
    # values
    unexplained, reasons = dict(wrong), {}
    while unexplained:
        fits = [_fit(unexplained, right, mistake) for mistake in mistakes]
        best = max(range(len(fits)), key=lambda k: _rank(fits[k]), default=-1)
        if best < 0 or not fits[best]:
            break
        for name in fits[best]:
            reasons[name] = mistakes[best].says
            del unexplained[name]
    return {name: reasons.get(name, UNEXPLAINED) for name in wrong}


def _in_other_units(
    wrong: Mapping[str, float], right: Rights, units: Mapping[str, str]
) -> dict[str, str]:
    """Return sentences on wrong answers that are right in another unit."""
    reasons = {}
    for name, value in wrong.items():
        truth, bound = right[name].truth, right[name].bound
        for unit, factor in UNITS.get(units[name], {}).items():
            if abs(truth) > bound and abs(value / factor - truth) <= bound:
                reasons[name] = f"given in {unit}; asked for in {units[name]}"
    return reasons


def _copies(
    sheet: Sheet, wrong: Mapping[str, float], others: Mapping[str, Rights]
) -> Iterator[Mistake]:
    """Yield the answers for other students' flights, if wrong answers match them.

    To exclude chance, at least `COPIED` wrong answers must match to the last digit, or all if there
    are two, and more than half of those with many digits. Numbers with few digits do not count.
    """
    digits = {q.name: q.digits for q in sheet.questions}
    last = {name: 10.0 ** -digits[name] for name in wrong}
    for student, right in others.items():
        telling = [n for n in wrong if abs(right[n].value) >= DIGITS * last[n]]
        same = [n for n in telling if apart(n, wrong[n], right[n].value) <= 1.01 * last[n]]
        if (
            len(same) >= 2
            and 2 * len(same) > len(telling)
            and (len(same) >= COPIED or len(same) == len(wrong))
        ):
            yield Mistake(
                says=f"this is the answer for the flight of {student}",
                gives={name: right[name].value for name in same},
                gives_sigma={n: r.sigma for n, r in right.items() if r.sigma is not None},
            )


def _fit(wrong: Mapping[str, float], right: Rights, mistake: Mistake) -> dict[str, float]:
    """Return the answers explained by a mistake, with their distances from its values."""
    fits = {}
    for name, value in wrong.items():
        gives = mistake.gives.get(name)
        if gives is None or apart(name, gives, right[name].truth) <= right[name].bound:
            continue  # its answer would count as right
        distance = apart(name, value, gives) / (right[name].bound * mistake.scale)
        if distance <= 1.0:
            fits[name] = distance
    return fits


def _rank(fit: Mapping[str, float]) -> tuple[int, float]:
    return len(fit), -float(np.mean([*fit.values()])) if fit else 0.0


def _explained_sigma(
    wrong: Mapping[str, float],
    right: Rights,
    mistakes: Iterable[Mistake],
    units: Mapping[str, str],
) -> dict[str, str]:
    """Return the mistake behind each wrong standard deviation, or its factor."""
    reasons = {name: _factor(sigma, right[name], units[name]) for name, sigma in wrong.items()}
    nearest = dict.fromkeys(wrong, ALIKE)
    for mistake in mistakes:
        for name in wrong.keys() & mistake.gives_sigma.keys():
            ratio = _ratio(wrong[name], mistake.gives_sigma[name])
            if ratio < nearest[name]:
                nearest[name], reasons[name] = ratio, mistake.says
    return reasons


def _ratio(a: float, b: float) -> float:
    """Return the ratio of the larger to the smaller of two numbers; infinite unless positive."""
    return max(a / b, b / a) if a > 0 and b > 0 else np.inf


def _factor(sigma: float, right: Right, unit: str) -> str:
    if not sigma > 0:
        return "σ must be positive"
    known = right.sigma or np.nan
    for other, factor in UNITS.get(unit, {}).items():
        if _ratio(sigma, factor * known) <= SIGMA_FACTOR:
            return f"σ is given in {other}; asked for in {unit}"
    if sigma < known:
        return f"σ is too small by a factor of {known / sigma:.1f}"
    return f"σ is too large by a factor of {sigma / known:.1f}"


# --- Mistakes that are made with numbers of every kind: sign, unit, order, a transposed matrix


GON = 400.0 / 360.0
RADIAN = float(np.pi / 180.0)


def named(names: Sequence[str], values: Array) -> dict[str, float]:
    """Return values by the names of questions."""
    return dict(zip(names, np.asarray(values, dtype=float).ravel().tolist(), strict=True))


def values(right: Rights, names: Sequence[str]) -> Array:
    """Return right answers, shape (n,)."""
    return np.array([right[name].value for name in names])


def scaled(right: Rights, names: Sequence[str], factor: float, says: str) -> Mistake:
    """Return the mistake of numbers and standard deviations in another unit."""
    sigma = {name: right[name].sigma for name in names}
    return Mistake(
        says=says,
        gives=named(names, factor * values(right, names)),
        gives_sigma={name: factor * s for name, s in sigma.items() if s is not None},
        scale=max(1.0, abs(factor)),
    )


def wrong_sign(right: Rights, names: Sequence[str], says: str = "the sign is wrong") -> Mistake:
    """Return the mistake of numbers with the wrong sign."""
    return Mistake(says=says, gives=named(names, -values(right, names)))


def swapped(right: Rights, first: str, second: str, says: str) -> Mistake:
    """Return the mistake of two swapped answers."""
    return Mistake(says=says, gives={first: right[second].value, second: right[first].value})


def of_angles(right: Rights, names: Sequence[str]) -> Iterator[Mistake]:
    """Yield the mistakes of angles in gon and in radians."""
    yield scaled(right, names, GON, "given in gon; asked for in degrees")
    yield scaled(right, names, RADIAN, "given in radians; asked for in degrees")


def of_rotation(right: Rights, opk: Sequence[str]) -> Iterator[Mistake]:
    """Yield common mistakes with omega, phi and kappa of one rotation."""
    R = rotation_from_opk(np.radians(values(right, opk)))
    yield Mistake(
        says="the rotation is transposed: it takes the other frame's axes; transpose the matrix",
        gives=named(opk, np.degrees(opk_from_rotation(R.T))),
    )
    yield wrong_sign(right, opk, "the signs of the angles are wrong: positive turns are taken back")
    yield swapped(right, opk[0], opk[1], "omega and phi are swapped: x and y axes")
    yield from of_angles(right, opk)


def variances(right: Rights) -> Mistake:
    """Return the mistake of variances instead of standard deviations."""
    return Mistake(
        says="σ is a variance: take the square root",
        gives_sigma={name: r.sigma**2 for name, r in right.items() if r.sigma is not None},
    )


def too_small(right: Rights, n: Mapping[str, int], what: str) -> Mistake:
    """Return the mistake of standard deviations divided by √n although errors are shared."""
    return Mistake(
        says=f"σ is too small by √n: the {what} are not independent, they share errors",
        gives_sigma={
            name: sigma / count**0.5
            for name, count in n.items()
            if (sigma := right[name].sigma) is not None
        },
    )
