"""One small notebook through papermill."""

import os
import pickle

import nbformat
import pytest

from acx4book.notebooks import execute as notebooks_execute
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4lib.errors import AdjustmentError, FlightError
from support.helpers import ROOT, write_notebook

PARAMETERS = (
    "flight_path = 'a flight'\nresults_path = ''\nseed: int = 1  # any whole number\nnoise = 1e-7"
)


def execute(notebook, executed, **given):
    values = notebooks_execute.with_defaults(notebook, given)
    steps = []
    try:
        notebooks_execute.execute(
            notebook, executed, parameters=values, on_cell=lambda *step: steps.append(step)
        )
    finally:
        notebooks_execute.scrub(executed, hidden="nothing")
    return nbformat.read(executed, as_version=4), steps


def test_defaults_are_values_and_given_ones_go_before(tmp_path):
    notebook = write_notebook(tmp_path / "a.ipynb", PARAMETERS)
    values = notebooks_execute.with_defaults(
        notebook, {"seed": 3, "noise": 2, "of_another_notebook": 1}
    )
    assert values == {"flight_path": "a flight", "results_path": "", "seed": 3, "noise": 2}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"noise": "1e-7"}, "a: noise is float, got '1e-7'"),
        ({"seed": 1.5}, "a: seed is int, got 1.5"),
        ({"seed": True}, "a: seed is int, got True"),
        ({"flight_path": 7}, "a: flight_path is str, got 7"),
    ],
)
def test_a_value_of_another_type_is_refused(tmp_path, given, said):
    notebook = write_notebook(tmp_path / "a.ipynb", PARAMETERS)
    with pytest.raises(ValueError, match=said):
        notebooks_execute.with_defaults(notebook, given)


@pytest.mark.parametrize("text", ["", "{", None])
def test_a_notebook_that_cannot_be_read_is_named(tmp_path, text):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = int('3')")
    if text is not None:
        notebook.write_text(text)
    with pytest.raises(
        notebooks_execute.NotebookError, match="notebook a, cell 1: no readable parameters"
    ):
        notebooks_execute.with_defaults(notebook, {})


@pytest.mark.slow
def test_the_process_is_this_interpreter_alone(tmp_path, monkeypatch):
    (tmp_path / "statistics.py").write_text("raise ImportError('from the current folder')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    notebook = write_notebook(
        tmp_path / "{a} \u00e9.ipynb",
        PARAMETERS,
        "import os, statistics, sys\n[sys.executable, os.getcwd()]",
        "import matplotlib.pyplot as plt\nplt.plot([1, 2]);",
        "flight_path",
    )
    executed, steps = execute(notebook, tmp_path / "out" / "{}.ipynb", flight_path="{b} \u00e9")
    found = executed.cells[1].outputs[0].data["text/plain"]
    assert str([os.sys.executable, str(tmp_path)]) == found.replace("\n", "").replace(",  ", ", ")
    assert executed.cells[2].outputs[0].data["image/svg+xml"].lstrip().startswith("<")
    assert executed.cells[3].outputs[0].data["text/plain"] == "'{b} \u00e9'"
    assert steps == [(done, 5) for done in range(6)]


@pytest.mark.slow
def test_two_runs_are_equal_byte_for_byte_and_show_the_parameters_once(tmp_path):
    notebook = write_notebook(
        tmp_path / "a.ipynb",
        PARAMETERS,
        "import warnings\nwarnings.warn('hm')",
        "print({'b', 'a', 'c'})\nresults_path",
    )
    for run in ("one", "two"):
        out = tmp_path / run / ".running-x7" / "a.ipynb"
        out.parent.mkdir(parents=True)
        values = {"seed": 4, "results_path": f"results/.running-{run}"}
        notebooks_execute.execute(notebook, out, parameters=values, on_cell=lambda *_: None)
        notebooks_execute.scrub(out, hidden=f".running-{run}")
    one, two = ((tmp_path / run / ".running-x7" / "a.ipynb").read_bytes() for run in ("one", "two"))
    assert one == two
    executed = nbformat.reads(one.decode(), as_version=4)
    assert [cell.execution_count for cell in executed.cells] == [1, 2, 3]
    assert executed.cells[0].source == '# Parameters\nseed = 4\nresults_path = "results"\n'
    assert executed.cells[0].metadata.tags == ["injected-parameters", "hide-input"]
    assert executed.cells[2].outputs[1].data["text/plain"] == "'results'"
    assert b"papermill" not in one


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("raise ValueError('first\\nlast')", "notebook a, cell 2: ValueError: last"),
        ("x = ((", "notebook a, cell 2: SyntaxError: incomplete input (line 1)"),
        ("raise KeyError", "notebook a, cell 2: KeyError"),
        ("import os; os._exit(3)", "notebook a, cell 2: its process ended with status 3"),
    ],
)
def test_a_failing_cell_is_named_with_the_last_line_of_its_error(tmp_path, cell, said):
    notebook = write_notebook(tmp_path / "a.ipynb", PARAMETERS, cell, "'never'")
    with pytest.raises(notebooks_execute.NotebookError) as caught:
        execute(notebook, tmp_path / "out" / "a.ipynb")
    assert str(caught.value) == said
    assert caught.value.cell == 2
    last = nbformat.read(tmp_path / "out" / "a.ipynb", as_version=4).cells[-1]
    assert last.source == "'never'"
    assert last.execution_count is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "argument", "said"),
    [
        (FlightError, "['a.csv:1: x: bad', 'b.csv:2: y: bad']", "a.csv:1: x: bad\nb.csv:2: y: bad"),
        (AdjustmentError, "'lever_z_m of SYN: not determined'", "lever_z_m of SYN: not determined"),
    ],
)
def test_an_error_of_the_library_stays_what_it_is(tmp_path, kind, argument, said):
    cell = f"from acx4lib.errors import {kind.__name__}\nraise {kind.__name__}({argument})"
    notebook = write_notebook(tmp_path / "a.ipynb", PARAMETERS, cell)
    with pytest.raises(kind) as caught:
        execute(notebook, tmp_path / "out" / "a.ipynb")
    assert str(caught.value) == said


def test_a_failure_is_told_by_a_process_to_the_one_that_asked():
    told = pickle.loads(
        pickle.dumps(notebooks_execute.NotebookError("10-chapter", 3, "TypeError: no"))
    )
    assert str(told) == "notebook 10-chapter, cell 3: TypeError: no"
    assert (told.notebook, told.cell) == ("10-chapter", 3)


# --- Digests of small houses, and of the notebooks of the book


@pytest.fixture
def sources(tmp_path):
    """Two houses: the first loads a room on demand, the second has a module that nobody uses."""
    files = {
        "acx4lib/__init__.py": "if TYPE_CHECKING:\n    from acx4lib.room.on_demand import x\n",
        "acx4lib/room/__init__.py": "from acx4lib.room import near\n",
        "acx4lib/room/near.py": "import numpy\n",
        "acx4lib/room/far.py": "def f():\n    import acx4book.late\n",
        "acx4lib/room/on_demand.py": "",
        "acx4book/__init__.py": "",
        "acx4book/late.py": "",
        "acx4book/unused.py": "",
    }
    for name, text in files.items():
        path = tmp_path / "src" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path / "src"


def reached(notebook, sources):
    return {str(path.relative_to(sources)) for path in notebooks_execute.modules(notebook, sources)}


def test_packages_on_the_way_are_read_and_late_imports_are_followed(tmp_path, sources):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1", "from acx4lib.room.far import f")
    assert reached(notebook, sources) == {
        *("acx4lib/__init__.py", "acx4lib/room/__init__.py", "acx4lib/room/near.py"),
        *("acx4lib/room/far.py", "acx4book/__init__.py", "acx4book/late.py"),
    }


def test_what_a_house_loads_on_demand_is_followed_where_the_house_itself_is_imported(
    tmp_path, sources
):
    for code in ("import acx4lib as acx", "import acx4lib as acx\nfrom acx4lib.room import near"):
        notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1", code)
        assert "acx4lib/room/on_demand.py" in reached(notebook, sources)


def test_every_input_changes_the_digest_and_nothing_else_does(tmp_path, sources):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1", "from acx4lib.room import far")
    data = tmp_path / "data.csv"
    data.write_text("1\n")

    def digest():
        return notebooks_execute.digest(notebook, sources, [data])

    first = digest()
    (sources / "acx4book" / "unused.py").write_text("x = 1\n")
    assert digest() == first
    seen = {first}
    for path in (data, notebook, sources / "acx4book" / "late.py"):
        path.write_text(path.read_text() + "\n")
        assert digest() not in seen
        seen.add(digest())


def test_a_chapter_depends_on_its_own_room_and_not_on_anothers():
    chapter = NOTEBOOKS_PATH / "16-error-budget.ipynb"
    found = reached(chapter, ROOT / "src")
    assert "acx4book/chapters/error_budget.py" in found
    assert "acx4lib/bundle/compiled/normals.py" in found
    assert "acx4book/chapters/rig.py" not in found


def test_a_chapter_depends_on_how_figures_are_shown(tmp_path):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1")
    assert "acx4book/typesetting/svg.py" in reached(notebook, ROOT / "src")
