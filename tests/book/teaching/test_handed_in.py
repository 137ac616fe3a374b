import os

import pytest

from acx4book.teaching import handed_in
from acx4lib.errors import FlightError

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
        (HEADER.replace(",", ";"), "separated by semicolons"),
        (GOOD.replace("1.5", "=1+1"), "formula"),
        (GOOD.replace("1.5", "nan"), "must be a number"),
        (GOOD.replace("1.5", '"1,5"'), "must be a number"),
        (GOOD.replace("1.5", "__import__('os')"), "must be a number"),
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


def test_a_huge_number_is_no_answer(tmp_path):
    (tmp_path / "answers.csv").write_text(GOOD.replace("1.5", "1e999"))
    assert handed_in.read(tmp_path).answers["x_mm"].value is None


def test_a_folder_of_files_and_folders_is_gone_through(tmp_path):
    (tmp_path / "b.csv").write_text(GOOD)
    (tmp_path / "a").mkdir()
    (tmp_path / "notes.txt").write_text("")
    own = tmp_path / "own"
    own.mkdir()
    (own / "answers.csv").write_text(GOOD)
    assert handed_in.found([tmp_path]) == [tmp_path / "a", tmp_path / "b.csv", own]
    assert handed_in.found([own, tmp_path / "b.csv"]) == [own, tmp_path / "b.csv"]
