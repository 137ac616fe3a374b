"""One small notebook through papermill."""

import os
import signal
import threading
import time
from functools import partial

import nbformat
import pytest

from acx4book.notebooks import execute as notebooks_execute
from acx4book.notebooks import runner
from acx4lib.errors import AdjustmentError, FlightError
from support.helpers import write_notebook

PARAMETERS = (
    "flight_path = 'a flight'\nresults_path = ''\nseed: int = 1  # any whole number\nnoise = 1e-7"
)


def execute(notebook, executed, **given):
    steps = []
    try:
        notebooks_execute.execute(
            notebook, executed, parameters=given, on_cell=lambda *step: steps.append(step)
        )
    finally:
        read = nbformat.read(executed, as_version=4)
        nbformat.validate(read)
    return read, steps


@pytest.mark.slow
def test_two_runs_are_equal_byte_for_byte(tmp_path):
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
        notebooks_execute.execute(notebook, out, parameters=values, hidden=f".running-{run}")
    one, two = ((tmp_path / run / ".running-x7" / "a.ipynb").read_bytes() for run in ("one", "two"))
    assert one == two
    executed = nbformat.reads(one.decode(), as_version=4)
    assert [cell.execution_count for cell in executed.cells] == [1, 2, 3, 4]
    assert executed.cells[1].source == '# Parameters\nseed = 4\nresults_path = "results"\n'
    assert executed.cells[2].outputs[0].text.startswith("<cell>:2: UserWarning: hm")
    assert executed.cells[3].outputs[1].data["text/plain"] == "'results'"
    assert b"papermill" not in one
    assert b"/tmp" not in one


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cell", "said"),
    [
        ("raise ValueError('first\\nlast')", "notebook a, cell 2: ValueError: last"),
        ("x = ((", "notebook a, cell 2: SyntaxError: incomplete input (line 1)"),
        ("raise KeyError", "notebook a, cell 2: KeyError"),
        ("import os; os._exit(3)", "notebook a, cell 2: its process was ended"),
    ],
)
def test_a_failing_cell_is_named_with_the_last_line_of_its_error(tmp_path, cell, said):
    notebook = write_notebook(tmp_path / "a.ipynb", PARAMETERS, cell, "'never'")
    with pytest.raises(notebooks_execute.NotebookError) as caught:
        execute(notebook, tmp_path / "out" / "a.ipynb", seed=7)
    assert str(caught.value) == said
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


def test_every_input_changes_the_digest(tmp_path):
    notebook = write_notebook(tmp_path / "a.ipynb", "seed = 1")
    data, source = tmp_path / "data.csv", tmp_path / "src" / "house" / "room.py"
    source.parent.mkdir(parents=True)
    data.write_text("1\n")
    source.write_text("x = 1\n")
    seen = set()
    for path in (data, notebook, source):
        seen.add(notebooks_execute.digest(notebook, tmp_path / "src", [data]))
        path.write_text(path.read_text() + "\n")
    seen.add(notebooks_execute.digest(notebook, tmp_path / "src", [data]))
    assert len(seen) == 4


def test_after_an_interruption_no_notebook_runs_on(tmp_path):
    notebook = write_notebook(tmp_path / "a.ipynb", PARAMETERS, "import time; time.sleep(100)")
    timer = threading.Timer(6, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    task = partial(notebooks_execute.execute, notebook, tmp_path / "b.ipynb", parameters={})
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        runner.side_by_side({"a": task}, {})
    assert time.monotonic() - begun < 60
    assert not notebooks_execute.Kernel.running


def test_a_task_begins_when_those_before_it_have_ended_and_none_does_after_a_failure():
    began = []

    def fail():
        began.append("c")
        raise ValueError("c")

    tasks = {name: partial(began.append, name) for name in "dba"} | {"c": fail}
    after = {"a": (), "b": ("a",), "c": ("b",), "d": ("b", "c")}
    with pytest.raises(ValueError, match="c"):
        runner.side_by_side(tasks, after)
    assert began == ["a", "b", "c"]
