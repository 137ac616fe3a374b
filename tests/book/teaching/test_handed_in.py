import json
import os
import re

import pytest

from acx4book.teaching import flights, handed_in
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.errors import FlightError
from acx4lib.flight.reader import read

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
        ("x" * 2_000_000, "at most"),
        ("student," * 5000, "columns"),
    ],
)
def test_a_hostile_file_is_a_sentence(tmp_path, text, says):
    path = tmp_path / "answers.csv"
    path.write_text(text)
    with pytest.raises(FlightError, match=says):
        handed_in.read(path)


def test_what_is_no_file_is_a_sentence(tmp_path):
    os.mkfifo(tmp_path / "answers.csv")
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    for name in ("answers.csv", "loop.csv", "missing.csv"):
        with pytest.raises(FlightError):
            handed_in.read(tmp_path / name)


@pytest.mark.parametrize("cell", ["1e999", "nan", "inf", "__import__('os')", "0.5 m"])
def test_what_is_no_number_is_kept_as_it_was_written_and_spoils_no_other_answer(tmp_path, cell):
    (tmp_path / "answers.csv").write_text(GOOD.replace("1.5", cell).replace("y_mm,,", "y_mm,2.5,"))
    x, y = handed_in.read(tmp_path).answers.values()
    assert (x.value, x.no_number) == (None, (cell,))
    assert (y.value, y.no_number) == (2.5, ())


def test_what_begins_with_a_minus_and_is_no_number_is_no_formula(tmp_path):
    (tmp_path / "answers.csv").write_text(GOOD.replace("1.5", "-0.5 m"))
    assert handed_in.read(tmp_path).answers["x_mm"].no_number == ("\u22120.5 m",)


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
    path.write_text(GOOD.replace("y_mm", "x_mm").replace("1.5", "-1,5").replace(",", ";"))
    with pytest.raises(FlightError, match=r"answers\.csv:3: question: 'x_mm' stands in line 2"):
        handed_in.read(path)


def test_a_folder_of_files_and_folders_is_gone_through(tmp_path):
    (tmp_path / "b.csv").write_text(GOOD)
    (tmp_path / "a").mkdir()
    (tmp_path / "notes.txt").write_text("")
    own = tmp_path / "own"
    own.mkdir()
    (own / "answers.csv").write_text(GOOD)
    assert handed_in.found([tmp_path]) == [tmp_path / "a", tmp_path / "b.csv", own]
    assert handed_in.found([own, tmp_path / "b.csv"]) == [own, tmp_path / "b.csv"]


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


def test_the_readme_asks_what_the_answers_file_has(key, tmp_path):
    sheet = SHEETS["lab-3"]
    handed_in.write(sheet, "Ada", key, tmp_path / "flight")
    asked = (tmp_path / "flight" / handed_in.README).read_text()
    rows = (tmp_path / "flight" / "answers.csv").read_text().splitlines()
    assert rows[0] == "student,sheet,question,value,sigma,unit"
    for question, row in zip(sheet.questions, rows[1:], strict=True):
        assert row == f"Ada,lab-3,{question.name},,,{question.unit}"
        assert f"| {question.name} | {question.asks} |" in asked
