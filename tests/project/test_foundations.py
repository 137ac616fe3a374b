"""The chapters of part I and their template: the form, and all code, that of solutions included."""

import ast
import re

import nbformat
import pytest

from support.helpers import ROOT

NOTEBOOKS = ROOT / "notebooks"
CHAPTERS = [
    *sorted((NOTEBOOKS / "foundations").glob("*.ipynb")),
    NOTEBOOKS / "template/chapter.ipynb",
]


@pytest.fixture(params=CHAPTERS, ids=lambda path: path.stem)
def chapter(request):
    return nbformat.read(request.param, as_version=4)


def texts(chapter):
    return [cell.source for cell in chapter.cells if cell.cell_type == "markdown"]


def test_it_opens_with_a_question_and_closes_with_its_answer(chapter):
    first, last = texts(chapter)[0], texts(chapter)[-1]
    assert re.match(r"# .+\n\n\*[^*]+\?\*\n", first)
    assert all(f"**{word}**" in first for word in ("Goals.", "Prerequisites.", "Time."))
    assert re.search(r"(?m)^## What to keep$", last)


def test_it_has_three_to_six_exercises_with_a_checked_solution_each(chapter):
    text = "\n".join(texts(chapter))
    exercises = re.findall(r"```{exercise}\n:label: (\S+)", text)
    assert 3 <= len(exercises) <= 6
    assert re.findall(r"{solution-start} (\S+)", text) == exercises
    inside, asserted = None, set()
    for cell in chapter.cells:
        if cell.cell_type == "code":
            tree = ast.walk(ast.parse(cell.source))
            if inside and any(isinstance(node, ast.Assert) for node in tree):
                asserted.add(inside)
        elif started := re.search(r"{solution-start} (\S+)", cell.source):
            inside = started[1]
        elif "{solution-end}" in cell.source:
            inside = None
    assert asserted == set(exercises)


def test_cells_are_short(chapter):
    cells = [cell.source.splitlines() for cell in chapter.cells if cell.cell_type == "code"]
    assert max(map(len, cells)) <= 15
    assert max(len(line) for lines in cells for line in lines) <= 78


def test_all_its_code_runs(chapter):
    names = {}
    for cell in chapter.cells:
        if cell.cell_type == "code":
            exec(compile(cell.source, cell.id, "exec"), names)


def test_figures_have_a_caption_and_say_what_is_seen(chapter):
    for cell in chapter.cells:
        if told := cell.metadata.get("mystnb"):
            assert told["figure"]["caption"].endswith(".")
            assert told["figure"]["name"].startswith("fig-")
            assert len(told["image"]["alt"]) > 40


def test_equations_with_a_number_need_no_environment_around_them(chapter):
    r"""Sphinx puts every equation with \\ into a *split*, in which MathJax allows no \tag."""
    for text in texts(chapter):
        for equation in re.findall(r"(?s)\$\$(.+?)\$\$", text):
            assert not (r"\tag" in equation and r"\\" in equation), equation
