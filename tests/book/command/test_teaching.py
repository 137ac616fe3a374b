"""The commands `acx4 lab` and `acx4 grade`, as a lecturer meets them."""

import csv

import pytest


@pytest.fixture
def acx4(acx4, tmp_path, monkeypatch):
    """Run the command in a folder with a key; return status, standard output and error."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "key.txt").write_text("ab" * 32)
    return acx4


def test_from_a_students_flight_to_marks(acx4, tmp_path):
    lab = ("lab", "1", "--student", "Ada Lovelace", "--key", "key.txt")
    assert acx4(*lab) == (0, "lab-1-ada-lovelace\n", "")
    folder = tmp_path / "lab-1-ada-lovelace"
    assert acx4("check", str(folder))[0] == 0
    assert acx4(*lab, "--out", "again")[0] == 0
    for path in folder.rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "again" / path.relative_to(folder)).read_bytes()
    status, out, err = acx4("grade", str(folder), "--key", "key.txt", "--out", "marks.csv")
    assert (status, err) == (0, "")
    assert out.startswith("Ada Lovelace  lab-1  0 of 7\n    x_mm: not answered\n")
    with (tmp_path / "marks.csv").open() as file:
        assert {row["verdict"] for row in csv.DictReader(file)} == {"not answered"}
    again = acx4("grade", str(folder), "--key", "key.txt", "--out", "marks.csv")
    assert again[0] == 0  # its own table is replaced


def test_a_quiz_is_two_question_banks_and_no_flight(acx4, tmp_path):
    lab = ("lab", "2", "--student", "Ada", "--key", "key.txt", "--quiz")
    assert acx4(*lab) == (0, "quiz-2-ada\n", "")
    files = {path.name for path in (tmp_path / "quiz-2-ada").iterdir()}
    assert files == {"questions.gift", "questions_qti.zip", ".acx4.json"}
    assert acx4(*lab)[0] == 2  # it is there already


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("lab", "99", "--student", "Ada", "--key", "key.txt"), "unknown sheet '99'; known: lab-1"),
        (("lab", "1", "--student", " ", "--key", "key.txt"), "is empty; must be a name"),
        (("lab", "1", "--student", "=1+1", "--key", "key.txt"), "formula"),
        (("lab", "1", "--student", "Ada", "--key", "none.txt"), "token_hex"),
        (("lab", "1", "--student", "Ada", "--key", "key.txt", "--out", "."), "already"),
        (("grade", "nothing", "--key", "key.txt"), "not graded"),
        (("grade", ".", "--key", "key.txt"), "no answers.csv and no results"),
        (("grade", "key.txt", "--key", "key.txt", "--out", "key.txt"), "choose another name"),
    ],
)
def test_what_cannot_be_done_is_a_sentence(acx4, arguments, says):
    status, _, err = acx4(*arguments)
    assert status == 2
    assert says in err
