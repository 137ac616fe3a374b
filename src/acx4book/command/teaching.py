"""The commands ``acx4 lab`` and ``acx4 grade``: a flight for every student, and their marks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acx4book.command import terminal

LAB_HELP = """Write the simulated flight of one student for a lab sheet.

SHEET is 1 to 9. The flight is drawn from the name, the sheet and the key: the same three give the
same flight. Its truth is not written; acx4 grade makes it again. Case and spaces of a name do not
count. The folder has the flight, README.md with the questions, and answers.csv to fill in.

With --quiz the folder has the questions on this flight as a question bank for a learning platform
instead, in GIFT: numbers with tolerances, and feedback that names the common mistake. It holds the
truth, and is for the lecturer.

\b
A key, to be made once and shown to nobody, and the flights of a class:
  python3 -c 'import secrets; print(secrets.token_hex(32))' > key.txt
  acx4 lab 6 --student "Ada Lovelace" --key key.txt
  while read name; do acx4 lab 6 --student "$name" --key key.txt; done < class.txt
  acx4 lab 6 --student "Ada Lovelace" --key key.txt --quiz
"""

GRADE_HELP = """Mark what students handed in on lab sheets.

HANDED_IN are files of answers, results folders of acx4 run, or folders of these. The truth is made
again of sheet, name and key. For every answer that is wrong the common mistake is named that gives
this value. Nothing of what was handed in is executed. What cannot be read is named in one line, the
others are marked, and the status is 2.

\b
Example:
  acx4 grade handed_in --key key.txt --out marks.csv --totals totals.csv
"""

Key = Annotated[Path, terminal.option("FILE", "The lecturer's key file.")]


def lab(
    sheet: Annotated[str, terminal.argument("SHEET")],
    student: Annotated[str, terminal.option("NAME", "Name of the student.")],
    key: Key,
    out: Annotated[
        Path | None, terminal.option("FOLDER", "New folder; else lab-N-name, here.")
    ] = None,
    quiz: Annotated[
        bool, typer.Option("--quiz", help="Write a question bank, in GIFT, into quiz-N-name.")
    ] = False,
) -> None:
    """Write the simulated flight of one student, or the questions on it."""
    from acx4book.teaching import flights, handed_in  # noqa: PLC0415 quick help
    from acx4book.teaching import quiz as question_banks  # noqa: PLC0415 quick help
    from acx4book.teaching.sheets.every import sheet_of  # noqa: PLC0415 quick help
    from acx4files.results import whole_files  # noqa: PLC0415 quick help

    try:
        chosen = sheet_of(sheet)
        kind = chosen.name.replace("lab-", "quiz-") if quiz else chosen.name
        folder = out or Path(flights.folder_name(kind, student))
    except ValueError as error:
        terminal.refuse(str(error))
    secret = flights.read_key(key)
    whole_files.check_new(folder)
    with whole_files.placed(folder) as draft:
        write = question_banks.write if quiz else handed_in.write
        write(chosen, student, secret, draft)
    terminal.show(folder)


def grade(
    handed_in: Annotated[
        list[Path], terminal.argument("HANDED_IN...", "Answers, results, or their folders.")
    ],
    key: Key,
    out: Annotated[Path | None, terminal.option("TABLE.csv", "A row for every answer.")] = None,
    totals: Annotated[Path | None, terminal.option("TABLE.csv", "A row for every student.")] = None,
) -> None:
    """Mark what students handed in."""
    from acx4book.teaching import class_table, flights  # noqa: PLC0415 quick help
    from acx4files.results import whole_files  # noqa: PLC0415 quick help

    secret = flights.read_key(key)
    if out is not None:
        mark = ",".join(class_table.COLUMNS).encode()
        whole_files.check_file(out, mark=mark, what="a table of acx4 grade")
    if totals is not None:
        mark = ",".join(class_table.TOTALS[1:]).encode()
        whole_files.check_file(totals, mark=mark, what="a table of totals of acx4 grade")
    graded = class_table.grade(
        handed_in, secret, lambda marks: terminal.show("\n".join(class_table.lines(marks)))
    )
    tables = {out: class_table.text(graded), totals: class_table.totals_text(graded)}
    whole_files.write_all({path: text for path, text in tables.items() if path is not None})
    for line in class_table.total_lines(graded):
        terminal.show(line)
    terminal.say(*graded.unread)
    if graded.unread or not graded.marks:
        nothing = "nothing was graded: no answers.csv and no results of acx4 run were found"
        terminal.say(*([] if graded.marks or graded.unread else [nothing]))
        raise typer.Exit(2)
