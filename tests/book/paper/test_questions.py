"""The paper's four questions: the paper's numbers, and the answers of chapters."""

import nbformat
import pytest

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.paper import printed, questions

ANSWERS = {one.chapter: [f"{one.chapter} says so.", "And why."] for one in questions.QUESTIONS}


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (0, "2.3 to 3.2 µm"),
        (0, "held at 74 mm"),
        (1, "around 3 µm, 0.5 pixel"),
        (2, "$f$ is 74.4511 ± 0.0007 mm and 74.4404 ± 0.0010 mm"),
        (3, "0.43 to 0.46 m by axis"),
        (3, "38.89 % of the points"),
        (3, "1:5000 to 1:2000"),
    ],
)
def test_the_papers_answers_have_its_numbers(number, said):
    assert said in questions.QUESTIONS[number].answered()


def test_the_page_has_the_papers_answer_and_ours():
    text = questions.text(ANSWERS, beside_print=True)
    assert text.count("And why.") == 4
    assert text.count("**The paper**") == 4
    assert text.count("**This book.**") == 4


def test_beside_another_camera_the_paper_says_nothing():
    assert "**The paper**" not in questions.text(ANSWERS, beside_print=False)


def test_an_answer_is_what_the_tagged_cell_of_a_notebook_shows(tmp_path):
    v4 = nbformat.v4
    shown = v4.new_output("execute_result", {"text/markdown": "One.\n\nTwo."})
    cells = [
        v4.new_code_cell("0", outputs=[v4.new_output("execute_result", {"text/markdown": "No."})]),
        v4.new_code_cell("1", outputs=[shown], metadata={"tags": [questions.TAG]}),
    ]
    chapter = questions.QUESTIONS[0].chapter
    nbformat.write(v4.new_notebook(cells=cells), tmp_path / f"{chapter}.ipynb")
    answers = questions.answers(tmp_path)
    assert answers.pop(chapter) == ["One.", "Two."]
    assert all(answer == [questions.UNANSWERED] for answer in answers.values())


def test_the_chapters_of_the_questions_end_with_an_answer():
    for one in questions.QUESTIONS:
        notebook = nbformat.read(NOTEBOOKS_PATH / f"{one.chapter}.ipynb", as_version=4)
        tagged = [questions.TAG in cell.metadata.get("tags", []) for cell in notebook.cells]
        assert sum(tagged) == 1
        assert any(tagged[-3:])  # below it, results are written


def test_every_row_of_the_small_table_is_printed():
    assert set(questions.TABLE_3) <= set(printed.table(3)["parameter"])
