"""The exercises on the paper's chapters: each has a solution that a cell checks."""

import ast
import re

import nbformat
import pytest

from support.helpers import ROOT

CHAPTERS = {"07-exercises": 12, "12-synthetic-cost": 2}
"""Notebooks, and how many exercises they have at least."""


@pytest.mark.parametrize(("name", "least"), CHAPTERS.items())
def test_every_exercise_has_a_folded_solution_that_is_checked(name, least):
    cells = nbformat.read(ROOT / "notebooks" / f"{name}.ipynb", as_version=4).cells
    text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    exercises = re.findall(r"```{exercise}\n:label: (\S+)", text)
    assert len(exercises) >= least
    solutions = re.findall(r"{solution-start} (\S+)\n:class: dropdown", text)
    assert solutions == exercises
    inside, checked = None, set()
    for cell in cells:
        if cell.cell_type == "markdown":
            inside = None if "{solution-end}" in cell.source else inside
            started = re.search(r"{solution-start} (\S+)", cell.source)
            inside = started[1] if started else inside
        elif any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(cell.source))):
            checked.add(inside)
    assert checked == set(exercises)


def test_each_of_the_papers_chapters_has_two_to_four():
    cells = nbformat.read(ROOT / "notebooks" / "07-exercises.ipynb", as_version=4).cells
    text = "\n".join(cell.source for cell in cells if cell.cell_type == "markdown")
    _, *sections = re.split(r"(?m)^## ", text)
    counts = {
        found[1]: section.count("```{exercise}")
        for section in sections
        if (found := re.search(r"These belong to {doc}`(\d\d)-", section))
    }
    assert {*counts} == {"00", "01", "02", "03", "04"}
    assert all(2 <= count <= 4 for count in counts.values())
