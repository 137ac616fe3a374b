"""What students hand in is read, graded, and listed."""

import csv
import io
import json
import re
from dataclasses import replace

import pytest

from acx4book.teaching import class_table, flights, grading, handed_in
from acx4book.teaching.flights import Mistake, Question, computed, estimated
from acx4book.teaching.handed_in import Answer
from acx4book.teaching.sheets.every import SHEETS
from acx4files.flight.reader import read
from acx4lib.errors import FlightError
from support.helpers import repeats

# --- Right answers are never called wrong, and every mistake is called what it is ------------


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


# --- handed in -------------------------------------------------------------------------------


HEADER = "student,sheet,question,value,sigma,unit\n"
GOOD = HEADER + "Ada,lab-1,x_mm,1.5,,mm\nAda,lab-1,y_mm,,,mm\n"


def test_answers_are_read(tmp_path):
    (tmp_path / "answers.csv").write_text("\ufeff" + GOOD.replace("\n", "\r\n"))
    read = handed_in.read(tmp_path)
    assert (read.student, read.sheet) == ("Ada", "lab-1")
    assert read.answers["x_mm"] == handed_in.Answer(value=1.5, sigma=None, unit="mm")
    assert read.answers["y_mm"].value is None


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty"),
        (HEADER, "has no rows"),
        (HEADER.replace(",", "\t"), "separated by tabs"),
        (GOOD.replace("1.5", "=1+1"), "formula"),
        (GOOD.replace("y_mm", "x_mm"), "already"),
        (GOOD.replace("Ada,lab-1,y", "Bob,lab-1,y"), "one student"),
        (GOOD.replace("Ada", "=HYPERLINK(1)"), "formula"),
        (GOOD.replace("Ada", "A\x1b[2Ja"), "control characters"),
        ("\0" * 100, "null"),
        (GOOD + '"', "quotes closed"),
        ("student," * 5000, "missing in the header"),
    ],
)
def test_a_hostile_file_is_a_sentence(tmp_path, text, says):
    path = tmp_path / "answers.csv"
    path.write_text(text)
    with pytest.raises(FlightError, match=says):
        handed_in.read(path)


@pytest.mark.parametrize("cell", ["1e999", "nan", "inf", "__import__('os')", "0.5 m"])
def test_what_is_no_number_is_kept_as_it_was_written_and_spoils_no_other_answer(tmp_path, cell):
    (tmp_path / "answers.csv").write_text(GOOD.replace("1.5", cell).replace("y_mm,,", "y_mm,2.5,"))
    x, y = handed_in.read(tmp_path).answers.values()
    assert (x.value, x.no_number) == (None, (cell,))
    assert (y.value, y.no_number) == (2.5, ())


@pytest.mark.parametrize(
    ("cell", "value"),
    [
        ("-1,5", -1.5),
        ("1,5e-3", 0.0015),
        (",5", 0.5),
        ("12.345.678,25", 12345678.25),
        ("-1.5", -1.5),
        ("\u22121,5", -1.5),
        (" 1,5 ", 1.5),
        ("+2,0", 2.0),
        ("7", 7.0),
    ],
)
def test_decimal_commas_and_semicolons_of_spreadsheets_are_read(tmp_path, cell, value):
    path = tmp_path / "answers.csv"
    path.write_text("\ufeff" + GOOD.replace(",", ";").replace("1.5", cell).replace("\n", "\r\n"))
    of_semicolons = handed_in.read(path)
    assert (of_semicolons.student, of_semicolons.sheet) == ("Ada", "lab-1")
    assert of_semicolons.answers["x_mm"].value == value
    path.write_text(GOOD.replace("1.5", f'"{cell}"'))
    assert handed_in.read(path).answers["x_mm"].value == value


def test_the_line_of_a_fault_is_that_of_the_file_with_semicolons_too(tmp_path):
    path = tmp_path / "answers.csv"
    path.write_text(GOOD.replace("y_mm", "x_mm").replace(",", ";"))
    with pytest.raises(FlightError, match=r"answers\.csv:3: question: 'x_mm' stands in line 2"):
        handed_in.read(path)


CERTIFIED = ("lab-2", "lab-3", "lab-9")
"""Sheets on which the camera is known, and is no secret."""


def numbers(value):
    if isinstance(value, dict):
        return [n for v in value.values() for n in numbers(v)]
    if isinstance(value, list):
        return [n for v in value for n in numbers(v)]
    return [value] if isinstance(value, float) and value != 0 else []


@pytest.mark.parametrize("name", SHEETS)
def test_a_students_folder_is_what_was_asked_for_and_holds_no_truth(name, key, tmp_path):
    sheet, folder = SHEETS[name], tmp_path / "flight"
    handed_in.write(sheet, 'Ada "the\\ first"', key, folder)
    assert [path.name for path in tmp_path.iterdir()] == ["flight"]  # nothing beside it
    if sheet.hand_out is None:
        assert read(folder).name == f'{name}: Ada "the\\ first"'
    text = "".join(path.read_text() for path in folder.rglob("*") if path.is_file())
    secret = flights.flight_of(sheet, 'Ada "the\\ first"', key)
    truth = {k: v for k, v in secret.truth.items() if k in ("exposures", "control_points")}
    truth |= {"cameras": {} if name in CERTIFIED else secret.truth["cameras"]}
    written = {abs(float(number)) for number in re.findall(r"\d+\.\d+", text)}
    assert written.isdisjoint(abs(n) for n in numbers(truth) if len(repr(n)) > 6)
    for purpose in ("truth", "errors"):
        seed = flights.seed(key, sheet=name, student='Ada "the\\ first"', purpose=purpose)
        assert str(seed) not in text
        assert f"{seed:x}" not in text
    assert key.decode() not in text
    assert "truth" not in text.replace(json.dumps("true"), "")


# --- class table -----------------------------------------------------------------------------


def hand_in(folder, student, sheet, values):
    rows = [
        f"{student},{sheet},{q.name},{values.get(q.name, '')},,{q.unit}"
        for q in SHEETS[sheet].questions
    ]
    folder.mkdir(exist_ok=True)
    (folder / f"{student}.csv").write_text(
        "student,sheet,question,value,sigma,unit\n" + "\n".join(rows) + "\n"
    )


def test_a_class_is_marked_and_what_cannot_be_read_stops_nothing(tmp_path, key, solved):
    _, right = solved("lab-1", "Ada")
    good = {q.name: round(right[q.name].value, q.digits) for q in SHEETS["lab-1"].questions}
    folder = tmp_path / "class"
    hand_in(folder, "Ada", "lab-1", good)
    hand_in(folder, "Bob", "lab-1", good)  # copied: Bob's flight is another
    (folder / "Eve.csv").write_bytes(b"\xff\xfe\x00")
    (folder / "Zed.csv").write_text("a,b\n1,2\n")
    (folder / "odd.csv").write_text(
        "student,sheet,question,value,sigma,unit\nOdd,lab-99,x_mm,1,,mm\n"
    )
    found = class_table.grade([folder], key)
    assert {m.student: m.points for m in found.marks}["Ada"] == len(good)
    (bob,) = (m for m in found.marks if m.student == "Bob")
    assert bob.points < len(good) / 2
    assert any(v.says == "this is the answer for the flight of Ada" for v in bob.verdicts)
    assert len(found.unread) == 3
    assert all("not graded" in line and "\n" not in line for line in found.unread)
    shown = list(class_table.lines(found.marks[0]))
    assert shown == [f"Ada  lab-1  {len(good)} of {len(good)}"]
    table = list(csv.DictReader(io.StringIO(class_table.text(found))))
    assert len(table) == 2 * len(good)
    assert table[0]["verdict"] == "right"


def test_totals_are_of_all_sheets_and_count_the_best_attempt(tmp_path, key, solved):
    for sheet in ("lab-1", "lab-2"):
        _, right = solved(sheet, "Ada")
        good = {q.name: round(right[q.name].value, q.digits) for q in SHEETS[sheet].questions}
        hand_in(tmp_path / sheet, "Ada", sheet, good)
    hand_in(tmp_path / "again", "ada", "lab-1", {})
    found = class_table.grade([tmp_path / n for n in ("lab-1", "lab-2", "again")], key)
    one, two = (len(SHEETS[sheet].questions) for sheet in ("lab-1", "lab-2"))
    assert list(class_table.total_lines(found)) == [f"Ada  2 sheets  {one + two} of {one + two}"]
    assert class_table.totals_text(found) == (
        f"student,lab-1,lab-2,points,of\nAda,{one},{two},{one + two},{one + two}\n"
    )
