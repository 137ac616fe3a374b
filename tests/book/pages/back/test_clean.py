"""Notebooks as they are downloaded."""

import ast
import re

import nbformat
import pytest

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.pages.back import clean
from acx4lib.results import folder
from acx4sim.designs import DESIGNS

SOURCES = {path.stem: path for path in clean.sources()}


def code(notebook):
    return [cell.source for cell in notebook.cells if cell.cell_type == "code"]


def test_every_notebook_has_a_copy_without_outputs(tmp_path):
    clean.write(tmp_path)
    copies = {path.relative_to(tmp_path) for path in tmp_path.rglob("*.ipynb")}
    assert copies == {path.relative_to(NOTEBOOKS_PATH) for path in SOURCES.values()}
    for name in copies:
        copy = nbformat.read(tmp_path / name, as_version=4)
        nbformat.validate(copy)
        assert all(not cell.get("outputs") for cell in copy.cells)
        assert "pip install" in copy.cells[0].source


@pytest.mark.parametrize("name", SOURCES)
def test_no_copy_reads_below_the_project(name):
    source = "\n".join(code(clean.copy(SOURCES[name], name)))
    assert not re.search(r"\.\./|[\"'](data|build)/", source)
    ast.parse(source)


@pytest.mark.parametrize("name", clean.BEFORE)
def test_a_notebook_with_a_flight_makes_it_after_its_parameters(name):
    parameters, start, *_ = code(clean.copy(SOURCES[name], name))
    values = {node.target.id: node.value.value for node in ast.parse(parameters).body}
    (call,) = (
        node
        for node in ast.walk(ast.parse(start))
        if isinstance(node, ast.Call) and node.func.attr == "prepare"
    )
    given = {word.arg: eval(ast.unparse(word.value), values) for word in call.keywords}
    assert given["design"] in DESIGNS
    assert set(given["stages"]) <= set(folder.STAGES)
    assert values["results_path"] == f"results-{name}"
    assert values.get("flight_path", f"flight-{given['design']}") == f"flight-{given['design']}"
    flight, results = map(ast.unparse, call.args)
    assert results == "results_path"
    if "flight_path" in values:
        assert flight == "flight_path"
    else:
        assert f'if results_path == "results-{name}"' in start


def test_notebooks_that_read_a_flight_or_results_are_those_that_make_them():
    reads = {
        n for n, p in SOURCES.items() if re.search(r"(flight|results)_path: str", p.read_text())
    }
    assert reads == set(clean.BEFORE)


def test_only_a_default_is_replaced():
    cell = 'a: str = "../x"  # the a\nab: str = "y"'
    assert clean.with_default(cell, "a", "b") == 'a: str = "b"  # the a\nab: str = "y"'
