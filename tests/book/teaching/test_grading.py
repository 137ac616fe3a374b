"""Right answers are never called wrong, and every mistake is called what it is."""

from dataclasses import replace

import pytest

from acx4book.teaching import grading
from acx4book.teaching.flights import Mistake, Question, computed, estimated
from acx4book.teaching.handed_in import Answer
from acx4book.teaching.sheets.every import SHEETS
from support.helpers import repeats

STUDENTS = [f"Student {k}" for k in range(20)]
FEW = STUDENTS[:3]


def said(sheet, case, answers):
    return {v.question.name: v.says for v in grading.graded(sheet, case, answers)}


@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.parametrize("students", [FEW, repeats(STUDENTS)], ids=len)
def test_right_answers_are_never_called_wrong(name, students, solved, handed):
    for student in students:
        case, right = solved(name, student)
        sheet = replace(SHEETS[name], solve=lambda _case, right=right: right)
        verdicts = grading.graded(sheet, case, handed(name, right))
        assert [v.says for v in verdicts if v.says] == []
        assert sum(v.points for v in verdicts) == sum(v.of for v in verdicts)


@pytest.mark.parametrize("name", SHEETS)
def test_every_mistake_is_called_what_it_is(name, solved, handed):
    """All answers that a mistake changes are changed; the others are not called wrong."""
    named = set()
    for student in FEW:
        case, right = solved(name, student)
        mistakes = list(SHEETS[name].mistakes(case, right))
        sheet = replace(
            SHEETS[name],
            solve=lambda _case, right=right: right,
            mistakes=lambda _case, _right, mistakes=mistakes: mistakes,
        )
        for mistake in mistakes:
            answers = handed(name, right)
            for question, value in mistake.gives.items():
                answers[question] = replace(answers[question], value=value)
            for question, sigma in mistake.gives_sigma.items():
                answers[question] = replace(answers[question], sigma=sigma)
            verdicts = said(sheet, case, answers)
            touched = mistake.gives.keys() | mistake.gives_sigma.keys()
            assert {says for q, says in verdicts.items() if q not in touched} <= {""}
            for question in touched:
                assert not verdicts[question] or mistake.says in verdicts[question]
            named |= {mistake.says} if any(verdicts.values()) else set()
    assert named == {mistake.says for mistake in mistakes}


def test_a_wrong_answer_without_a_known_mistake_is_only_called_wrong(solved, handed):
    case, right = solved("lab-1", "Ada")
    answers = handed("lab-1", right, x_mm=right["x_mm"].value + 1.2345)
    assert said(SHEETS["lab-1"], case, answers)["x_mm"] == grading.UNEXPLAINED


def test_the_bound_holds_where_the_flight_itself_is_off():
    """The best solution is 6 sigma off: it is right, and so is the truth."""
    right = estimated(6.0, 1.0, 0.0)
    assert abs(right.value - right.truth) < right.bound < 8.0


def test_a_mistake_that_explains_more_answers_comes_first():
    right = {name: estimated(1.0, 0.01, 1.0) for name in "ab"}
    one = Mistake(says="one", gives={"a": 2.0})
    both = Mistake(says="both", gives={"a": 2.01, "b": 3.0})
    a, b = (Question(name=name, unit="", asks="", digits=2) for name in "ab")

    def verdicts(mistakes, **wrong):
        sheet = replace(
            SHEETS["lab-1"],
            questions=(a, b),
            solve=lambda _case: right,
            mistakes=lambda _case, _right: mistakes,
        )
        answers = {n: Answer(value=v, sigma=None, unit="") for n, v in wrong.items()}
        return said(sheet, None, answers)

    assert verdicts([one, both], a=2.0, b=3.0) == {"a": "both", "b": "both"}
    assert verdicts([both, one], a=2.0, b=1.0) == {"a": "one", "b": ""}


@pytest.mark.parametrize(
    ("sigma", "says"),
    [
        (0.02, ""),
        (0.017, ""),
        (0.01, "σ is too small by a factor of 2.0"),
        (0.1, "σ is too large by a factor of 5.0"),
        (0.0, "σ must be positive"),
        (-0.02, "σ must be positive"),
        (None, "σ is missing"),
        (0.0004, "σ is a variance: take the square root"),
    ],
)
def test_a_standard_deviation_has_a_verdict_of_its_own(sigma, says, solved):
    case, right = solved("lab-6", "Ada")
    only = replace(right["lever_x_m"], sigma=0.02)
    sheet = replace(SHEETS["lab-6"], solve=lambda _case: {**right, "lever_x_m": only})
    answer = Answer(value=only.value, sigma=sigma, unit="m")
    assert said(sheet, case, {"lever_x_m": answer})["lever_x_m"] == says


def test_another_unit_is_no_answer_and_whole_turns_do_not_count(solved):
    case, right = solved("lab-2", "Ada")
    name = "body_kappa_deg"
    turned = Answer(value=right[name].value + 360.0, sigma=None, unit="deg")
    assert said(SHEETS["lab-2"], case, {name: turned})[name] == ""
    gon = Answer(value=1.0, sigma=None, unit="gon")
    assert said(SHEETS["lab-2"], case, {name: gon})[name] == "unit gon; asked for in deg"


@pytest.mark.parametrize("value", [1.23449, 1.23451, -1.23449, -1.2350001])
def test_the_last_digit_may_differ_by_one_in_both_directions(value):
    right = computed(value, 3)
    for off in (-0.001, 0.0, 0.001):
        assert abs(round(value, 3) + off - right.truth) <= right.bound
    for off in (-0.002, 0.002):
        assert abs(round(value, 3) + off - right.truth) > right.bound


def test_what_is_no_number_is_called_so_for_value_and_sigma(solved):
    case, right = solved("lab-6", "Ada")
    sheet = replace(SHEETS["lab-6"], solve=lambda _case: right)
    nan = Answer(value=None, sigma=None, unit="m", no_number=("nan",))
    assert said(sheet, case, {"lever_x_m": nan})["lever_x_m"] == "'nan' is no number"
    value = right["lever_x_m"].value
    sigma = Answer(value=value, sigma=None, unit="m", no_number=("1e999",))
    assert said(sheet, case, {"lever_x_m": sigma})["lever_x_m"] == "σ: '1e999' is no number"


def test_another_unit_is_named_of_values_and_of_standard_deviations(solved):
    case, right = solved("lab-6", "Ada")
    sheet = replace(SHEETS["lab-6"], solve=lambda _case: right, mistakes=lambda *_: [])
    name, one = "boresight_phi_deg", right["boresight_phi_deg"]
    seconds = Answer(value=3600 * one.value, sigma=3500 * one.sigma, unit="deg")
    assert said(sheet, case, {name: seconds})[name] == (
        "given in seconds of arc; asked for in deg; σ is given in seconds of arc; asked for in deg"
    )
    name, one = "two_step_lever_z_m", right["two_step_lever_z_m"]
    in_mm = Answer(value=one.value, sigma=994.7 * one.sigma, unit="m")
    assert said(sheet, case, {name: in_mm})[name] == "σ is given in mm; asked for in m"


def test_values_of_the_other_method_are_named(solved):
    case, right = solved("lab-6", "Ada")
    mistakes = list(SHEETS["lab-6"].mistakes(case, right))
    two_step = next(m for m in mistakes if "of the two-step method" in m.says)
    sheet = replace(SHEETS["lab-6"], solve=lambda _case: right, mistakes=lambda *_: mistakes)
    answers = {
        name: Answer(value=value, sigma=two_step.gives_sigma[name], unit=sheet.question(name).unit)
        for name, value in two_step.gives.items()
    }
    found = said(sheet, case, answers)
    named = [name for name in answers if two_step.says in found[name]]
    assert "lever_z_m" in named  # its sigma is many times larger
    assert all(
        found[name] in ("", two_step.says, f"{two_step.says}; {two_step.says}") for name in named
    )


def test_a_convergence_of_zero_is_named(solved):
    case, _ = solved("lab-2", "Ada")
    zero = Answer(value=0.0, sigma=None, unit="deg")
    found = said(SHEETS["lab-2"], case, {"convergence_deg": zero})
    assert "convergence is not zero" in found["convergence_deg"]


def test_answers_for_another_students_flight_are_recognised_and_single_chances_are_not(solved):
    case, right = solved("lab-6", "Ada")
    _, other = solved("lab-6", "Bob")
    sheet = replace(SHEETS["lab-6"], solve=lambda _case: right, mistakes=lambda *_: [])

    def verdicts(of_other):
        answers = {
            q.name: Answer(
                value=round((other if q.name in of_other else right)[q.name].value, q.digits),
                sigma=None,
                unit=q.unit,
            )
            for q in sheet.questions
        }
        graded = grading.graded(sheet, case, answers, lambda: {"Bob": other, "Cid": right})
        return {v.question.name: v.says for v in graded}

    angles = ("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg")
    found = verdicts(angles)
    assert all("this is the answer for the flight of Bob" in found[name] for name in angles)
    assert "flight of" not in " ".join(verdicts(angles[:1]).values())
