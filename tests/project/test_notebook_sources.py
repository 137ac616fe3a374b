"""The form of the notebooks' sources: parametrised, without outputs, the method in open cells."""

import ast
import re

import nbformat
import pytest

from support.helpers import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
OPEN = [path for path in NOTEBOOKS if '"acx4": {' in path.read_text("utf-8")]
"""Those whose method stands in their cells."""

PAPER = [path for path in OPEN if path.stem[:2] in ("01", "02", "03", "04", "08")]
"""Those of the paper's sections, and of the rig, which calibrate and write results."""

BANNED = (*(ast.AsyncFunctionDef, ast.ClassDef, ast.For, ast.While, ast.Try, ast.Global, ast.With),)
ROOMS = {
    "00": ["chapters.flight", "paper"],
    "01": ["chapters.heads", "paper"],
    "02": ["chapters.synthetic_image", "paper"],
    "03": ["chapters.mounting", "paper"],
    "04": ["chapters.validation", "paper"],
    "05": ["reference"],
    "06": ["paper.errata"],
    "07": [],
    "08": ["chapters.rig", "paper"],
    "09": ["chapters.weights", "paper"],
    "10": ["chapters.image_quality", "paper"],
    "11": ["reference"],
    "12": ["chapters.synthetic_cost", "paper"],
    "13": ["reference", "chapters.mounting.tables"],
    "14": ["chapters.failures"],
    "15": ["chapters.design"],
    "16": ["chapters.error_budget", "paper"],
    "19": ["chapters.from_pictures"],
    "co": [],
}
"""The rooms of the book that a notebook may use, besides `notebook` and `typesetting`."""

MAIN_PARAMETERS = {
    *("flight_path", "pictures_path", "results_path", "calibration_path", "seed"),
    *("results_a", "results_b"),
}

READING = {"read", "measured", "needs", "begin", "write", "given", "read_heads", "read_pictures"}
"""Functions that compute nothing."""


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return nbformat.read(request.param, as_version=4)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def is_hidden(cell):
    return "hide-input" in cell.metadata.get("tags", [])


def read(path):
    return nbformat.read(path, as_version=4)


def test_the_parameters_are_plain_typed_and_explained(notebook):
    tagged = [
        cell for cell in code_cells(notebook) if "parameters" in cell.metadata.get("tags", [])
    ]
    assert len(tagged) == 1
    assert tagged[0] is code_cells(notebook)[0]
    body = ast.parse(tagged[0].source).body
    assert all(isinstance(node, ast.AnnAssign) for node in body)
    names = {node.target.id for node in body}
    assert names
    assert len(names - MAIN_PARAMETERS) <= 1
    for node, line in zip(body, tagged[0].source.splitlines(), strict=True):
        assert type(ast.literal_eval(node.value)).__name__ == node.annotation.id
        assert "  # " in line, f"{node.target.id} is not explained"


def test_cells_do_one_step_each(notebook):
    for cell in code_cells(notebook):
        lines = cell.source.splitlines()
        tree = ast.parse(cell.source)  # fails on magics
        assert len(lines) <= 15 or is_hidden(cell)
        assert [type(n).__name__ for n in ast.walk(tree) if isinstance(n, BANNED)] == []
        defined = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
        assert all(n.end_lineno - n.lineno < 3 for n in defined)


def called(cell, modules):
    """Return the functions of the library that a cell calls, or hands on to be called."""
    names = [
        ast.unparse(node)
        for node in ast.walk(ast.parse(cell.source))
        if isinstance(node, ast.Name | ast.Attribute)
    ]
    whole = {
        f"{modules.get(n.partition('.')[0], '')}.{n.partition('.')[2]}".strip(".") for n in names
    }
    return {name for name in whole if name.startswith(("acx4lib.", "acx4files."))}


@pytest.mark.parametrize("path", OPEN, ids=lambda path: path.stem)
def test_what_computes_is_not_hidden(path):
    for cell in code_cells(read(path))[1:]:
        if is_hidden(cell) and "notebook.end(" not in cell.source:
            imports = ("import ", "from ")
            lines = [x for x in cell.source.splitlines() if not x.startswith(imports)]
            assert "begin()" in cell.source or "say(" in cell.source or not any(lines)


@pytest.mark.parametrize("path", PAPER, ids=lambda path: path.stem)
def test_six_functions_of_the_method_are_called_in_open_cells(path):
    notebook = read(path)
    modules = imported(notebook)
    shown = [cell for cell in code_cells(notebook) if not is_hidden(cell)]
    functions = {name for cell in shown for name in called(cell, modules)}
    computing = {n for n in functions if n.rpartition(".")[2] not in READING and n.count(".") > 1}
    assert len(computing) >= 6


@pytest.mark.parametrize("path", PAPER, ids=lambda path: path.stem)
def test_a_chapter_of_the_paper_can_be_changed_answers_and_writes(path):
    notebook = read(path)
    texts = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    (change,) = [text for text in texts if text.startswith("## Change it")]
    assert len(re.findall(r"(?m)^- \*\*", change)) >= 3
    assert any(re.search(r"\\tag{\d+}", text) for text in texts)
    assert any(text.startswith("## The answer") for text in texts)
    assert ".write(" in code_cells(notebook)[-1].source


def imported(notebook):
    """Return what the cells import: the module by the name that it has there."""
    nodes = [node for cell in code_cells(notebook) for node in ast.walk(ast.parse(cell.source))]
    froms = [node for node in nodes if isinstance(node, ast.ImportFrom)]
    plain = [alias for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    return {a.asname or a.name: f"{node.module}.{a.name}" for node in froms for a in node.names} | {
        a.asname or a.name: a.name for a in plain
    }


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_imports_the_library_typesetting_what_notebooks_call_and_its_own_room(path):
    modules = imported(nbformat.read(path, as_version=4)).values()
    book = [name for name in modules if name.startswith("acx4book")]
    rooms = tuple(
        f"acx4book.{room}"
        for room in ("notebook", "typesetting", "planning", "campaigns", *ROOMS[path.stem[:2]])
    )
    assert [name for name in book if not name.startswith(rooms)] == []
    others = {name.partition(".")[0] for name in modules}
    standard = {"dataclasses", "functools", "pathlib"}
    assert (
        others
        <= {"acx4", "acx4lib", "acx4files", "acx4sim", "acx4book", "IPython", "numpy", "pandas"}
        | standard
    )
