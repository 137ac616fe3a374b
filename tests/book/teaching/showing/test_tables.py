import pytest

from acx4book.teaching import showing
from acx4book.teaching.sheets.every import SHEETS


@pytest.fixture(scope="module")
def texts():
    return dict(showing.texts())


@pytest.mark.parametrize("name", SHEETS)
def test_the_books_tables_have_every_question_and_the_mistakes(name, texts):
    sheet = SHEETS[name]
    asked, solved = texts[f"{name}-questions.md"], texts[f"{name}-solution.md"]
    for question in sheet.questions:
        assert f"`{question.name}`" in asked
        assert f"`{question.name}`" in solved
    assert solved.count("\n| ") > len(sheet.questions) + 6
