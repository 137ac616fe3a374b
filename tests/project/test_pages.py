"""What foundations, exercises, notation and contracts say agrees with the code."""

import ast
import re

import nbformat
import pytest

from acx4book.command.acx4 import app
from acx4files.flight.tables import SCHEMAS
from acx4lib.geometry.parameters import REPORTED
from support.helpers import ROOT, book_extension

# --- foundations -----------------------------------------------------------------------------
#
# The chapters of part I and their template: the form, and all code, that of solutions included.


NOTEBOOKS = ROOT / "notebooks"
CHAPTERS = [
    *sorted((NOTEBOOKS / "foundations").glob("*.ipynb")),
    NOTEBOOKS / "template/chapter.ipynb",
]


@pytest.fixture(params=CHAPTERS, ids=lambda path: path.stem)
def chapter(request):
    return nbformat.read(request.param, as_version=4)


def test_all_its_code_runs(chapter):
    names = {}
    for cell in chapter.cells:
        if cell.cell_type == "code":
            exec(compile(cell.source, cell.id, "exec"), names)


# --- exercises: each has a solution that a cell checks ------------------------------------------


EXERCISES = {"07-exercises": 12, "12-synthetic-cost": 2}
EXERCISES |= {path.relative_to(NOTEBOOKS).with_suffix("").as_posix(): 3 for path in CHAPTERS}


@pytest.mark.parametrize(("name", "least"), EXERCISES.items())
def test_every_exercise_has_a_folded_solution_that_is_checked(name, least):
    cells = nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4).cells
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
    assert set(exercises) <= checked


# --- the page of symbols names what there is in the code and in files ------------------------


ROWS = re.findall(
    r"^\* - (.*?)(?=^\* - |^```)",
    (ROOT / "book" / "notation.md").read_text(encoding="utf-8"),
    flags=re.MULTILINE | re.DOTALL,
)
NAMES = sorted({name for row in ROWS for name in re.findall(r"`(\w+)`", row.rpartition("  -")[2])})


def test_every_parameter_that_is_reported_has_a_row():
    names = set(NAMES)
    assert {name for name, _ in REPORTED.values()} <= names


# --- the pages of the contract have every key, column and command that the program has -------


key_tables = book_extension("key_tables")


def table_of(page, name):
    """Return the text of a table of a page of the book."""
    text = (ROOT / "book" / f"{page}.md").read_text("utf-8")
    return text.partition(f":name: {name}\n")[2].partition("\n```")[0]


@pytest.mark.parametrize(("page", "name"), [("flight-toml", "flight"), ("planning", "plan")])
def test_every_key_of_a_toml_file_is_explained(page, name):
    text = table_of(page, f"tab-{name}-toml")
    listed = [*key_tables.explained(text, key_tables.TABLES[name])]
    assert all(meaning for *_, meaning in listed)
    assert len(listed) == 1 + sum(line.startswith("`") for line in text.splitlines())


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_column_is_explained(name):
    row = table_of("flight-tables", "tab-flight-tables").partition(f"* - `{name}`")[2]
    row = row.partition("\n* - ")[0]
    required, optional = re.sub(r"\[.*?\]", "", row, flags=re.DOTALL), row
    schema = SCHEMAS[name]
    assert all(f"`{column}`" in required for column in schema.required)
    assert all(f"`{column}`" in optional for column in schema.known)


def test_every_command_is_in_the_table():
    listed = table_of("commands", "tab-commands")
    for command in app.registered_commands:
        name = command.name or command.callback.__name__
        assert f"`acx4 {name} " in listed, name
