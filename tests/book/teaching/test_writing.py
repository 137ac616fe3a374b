import json
import re

import pytest

from acx4book.teaching import flights, students, writing
from acx4book.teaching.sheets.every import SHEETS
from acx4lib.flight.reader import read

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
    writing.write(sheet, 'Ada "the\\ first"', key, folder)
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
        seed = students.seed(key, sheet=name, student='Ada "the\\ first"', purpose=purpose)
        assert str(seed) not in text
        assert f"{seed:x}" not in text
    assert key.decode() not in text
    assert "truth" not in text.replace(json.dumps("true"), "")


def test_the_readme_asks_what_the_answers_file_has(key, tmp_path):
    sheet = SHEETS["lab-3"]
    writing.write(sheet, "Ada", key, tmp_path / "flight")
    asked = (tmp_path / "flight" / writing.README).read_text()
    rows = (tmp_path / "flight" / "answers.csv").read_text().splitlines()
    assert rows[0] == "student,sheet,question,value,sigma,unit"
    for question, row in zip(sheet.questions, rows[1:], strict=True):
        assert row == f"Ada,lab-3,{question.name},,,{question.unit}"
        assert f"| {question.name} | {question.asks} |" in asked
