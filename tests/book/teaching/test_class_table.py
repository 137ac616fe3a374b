import csv
import io

from acx4book.teaching import class_table, handed_in
from acx4book.teaching.sheets.every import SHEETS


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


def test_an_empty_answers_file_has_no_points(tmp_path, key):
    handed_in.write(SHEETS["lab-2"], "Ada", key, tmp_path / "flight")
    (marks,) = class_table.grade([tmp_path / "flight"], key).marks
    assert marks.points == 0
    assert {verdict.says for verdict in marks.verdicts} == {"not answered"}


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
