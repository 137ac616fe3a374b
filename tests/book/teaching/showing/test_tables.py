import pytest

from acx4book.teaching.sheets.every import SHEETS
from acx4book.teaching.showing import tables


@pytest.mark.parametrize("name", SHEETS)
def test_the_books_tables_have_every_question_and_most_mistakes(name):
    texts = dict(tables.texts())
    sheet = SHEETS[name]
    for question in sheet.questions:
        assert f"`{question.name}`" in texts[f"{name}-questions.md"]
        assert f"`{question.name}`" in texts[f"{name}-solution.md"]
    assert texts[f"{name}-solution.md"].count("\n| ") > len(sheet.questions) + 6
