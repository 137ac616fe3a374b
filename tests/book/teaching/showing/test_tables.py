import pytest

from acx4book.teaching.sheets.every import SHEETS
from acx4book.teaching.showing import tables


@pytest.mark.parametrize("name", SHEETS)
def test_the_books_tables_have_every_question_and_the_mistakes(name):
    sheet = SHEETS[name]
    asked, solved = tables.questions(sheet), tables.solution(sheet)
    for question in sheet.questions:
        assert f"`{question.name}`" in asked
        assert f"`{question.name}`" in solved
    assert solved.count("\n| ") > len(sheet.questions) + 6
