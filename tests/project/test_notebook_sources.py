"""The form of the notebooks' sources: thin, parametrised, without outputs, fit for the book."""

import ast
import json
import re

import nbformat
import pytest

from support.helpers import ROOT

NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
BANNED = (
    *(ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda, ast.For, ast.While),
    *(ast.Try, ast.Global),
)
ROOMS = {
    "00": ["chapters.flight"],
    "01": ["chapters.heads"],
    "02": ["chapters.synthetic_image"],
    "03": ["chapters.mounting"],
    "04": ["chapters.validation"],
    "05": ["reference"],
    "06": ["paper.errata"],
    "07": ["report"],
    "08": ["chapters.beyond.rig"],
    "09": ["chapters.beyond.weights"],
    "10": ["chapters.beyond.image_quality", "chapters.synthetic_image"],
    "11": ["reference"],
    "12": ["chapters.beyond.synthetic_cost"],
    "13": ["chapters.beyond.bad_starts"],
    "14": ["chapters.beyond.failures"],
    "15": ["chapters.beyond.design"],
    "17": ["chapters.beyond.distortion_models"],
    "18": ["chapters.beyond.stability", "report.campaigns"],
    "16": ["chapters.beyond.error_budget"],
    "19": ["chapters.beyond.from_pictures"],
}
"""The rooms of the book that a notebook may use, besides `notebook` and `typesetting`."""

MAIN_PARAMETERS = {"flight_path", "pictures_path", "results_path", "seed"}


@pytest.fixture(params=NOTEBOOKS, ids=lambda path: path.stem)
def notebook(request):
    return nbformat.read(request.param, as_version=4)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def figures(notebook):
    """Return what the book is told of every figure: caption, name and alternative text."""
    told = [cell.metadata["mystnb"] for cell in notebook.cells if "mystnb" in cell.metadata]
    return [(t["figure"]["caption"], t["figure"]["name"], t["image"]["alt"]) for t in told]


def tables(notebook):
    """Return the labels of the tables that the cells make."""
    source = "\n".join(cell.source for cell in code_cells(notebook))
    return re.findall(r'name="(tab-[^"]*)"', source)


def test_there_are_notebooks():
    assert len(NOTEBOOKS) >= 5


def test_names_are_numbered_and_can_stand_in_an_address():
    assert all(re.fullmatch(r"\d\d(-[a-z0-9]+)+", path.stem) for path in NOTEBOOKS)


def test_it_is_valid_and_has_neither_outputs_nor_a_kernel_of_its_own(notebook):
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert notebook.metadata.kernelspec.name == "python3"
    assert set(notebook.metadata) <= {"kernelspec", "language_info"}
    for cell in code_cells(notebook):
        assert cell.outputs == []
        assert cell.execution_count is None


def test_cells_are_named_in_order(notebook):
    numbers = [int(re.fullmatch(r"(?:cell-)?(\d+)", cell.id)[1]) for cell in notebook.cells]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_it_begins_with_a_title_and_has_sections(notebook):
    assert notebook.cells[0].cell_type == "markdown"
    text = [c.source for c in notebook.cells if c.cell_type == "markdown"]
    headings = re.findall(r"(?m)^(#+) ", "\n".join(text))
    assert text[0].startswith("# ")
    assert headings.count("#") == 1
    assert headings.count("##") >= 2  # a page with fewer breaks the theme's margin
    assert set(headings) <= {"#", "##", "###"}


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


def test_it_is_thin(notebook):
    cells = [cell.source.splitlines() for cell in code_cells(notebook)]
    assert len(cells) <= 24
    assert max(map(len, cells)) <= 15
    assert sum(map(len, cells)) <= 120


def test_everything_computed_lives_in_the_library(notebook):
    for cell in code_cells(notebook):
        tree = ast.parse(cell.source)  # fails on magics
        found = [type(node).__name__ for node in ast.walk(tree) if isinstance(node, BANNED)]
        assert found == []
        modules = {
            name.partition(".")[0]
            for node in ast.walk(tree)
            if isinstance(node, ast.Import | ast.ImportFrom)
            for name in (
                [alias.name for alias in node.names]
                if isinstance(node, ast.Import)
                else [node.module or ""]
            )
        }
        assert modules.isdisjoint({"numpy", "pandas", "scipy", "matplotlib"})


def test_lines_fit(notebook):
    assert all(
        len(line) <= 100 for cell in code_cells(notebook) for line in cell.source.splitlines()
    )


def test_every_figure_has_a_caption_a_label_and_a_description(notebook):
    for caption, name, alt in figures(notebook):
        assert caption.endswith(".")
        assert re.fullmatch(r"fig-[a-z0-9-]+", name)
        assert 40 < len(alt) < 600
        assert alt.endswith(".")
        assert "\n" not in caption + alt
        assert "{cite" not in caption  # breaks the printed book


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
    rooms = tuple(f"acx4book.{room}" for room in ("notebook", "typesetting", *ROOMS[path.stem[:2]]))
    assert [name for name in book if not name.startswith(rooms)] == []
    others = {name.partition(".")[0] for name in modules}
    assert others <= {"acx4lib", "acx4book", "IPython", "functools"}


def test_every_call_of_a_figure_is_one(notebook):
    modules = imported(notebook)
    draws = {n for n, m in modules.items() if re.search(r"\.figure|typesetting\.ma", m)}
    assert draws or not figures(notebook) or "shown" in modules
    for cell in code_cells(notebook):
        last = ast.parse(cell.source).body[-1]
        names = [node.id for node in ast.walk(last) if isinstance(node, ast.Name)]
        drawn = isinstance(last, ast.Expr) and names[:1] and names[0] in draws
        assert not drawn or "mystnb" in cell.metadata


def test_references_lead_to_labels(notebook):
    text = "\n".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    labels = {name for _, name, _ in figures(notebook)} | set(tables(notebook))
    own = {
        name for name in re.findall(r"{numref}`([^`]+)`", text) if name.startswith(("fig", "tab"))
    }
    everywhere = all_labels()
    assert own <= set(everywhere)
    assert labels <= set(everywhere)
    assert all(1 <= int(n) <= 14 for n in re.findall(r"{eq}`eq-(\d+)`", text))


def all_labels():
    read = [nbformat.read(path, as_version=4) for path in NOTEBOOKS]
    return [label for n in read for label in [*(f[1] for f in figures(n)), *tables(n)]]


def test_labels_are_used_once_in_the_whole_book():
    labels = all_labels()
    assert sorted(set(labels)) == sorted(labels)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_file_ends_with_a_line_and_is_written_one_way(path):
    text = path.read_text(encoding="utf-8")
    assert text == json.dumps(json.loads(text), indent=1, ensure_ascii=False) + "\n"


@pytest.mark.parametrize("path", [p for p in NOTEBOOKS if "01" <= p.stem[:2] <= "04"], ids=str)
def test_the_stages_end_with_what_would_be_seen_if(path):
    notebook = nbformat.read(path, as_version=4)
    text = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    assert "## What would be seen if" in text[-2]
    assert text[-1].startswith("## The answer")
