"""What a notebook calls: its parameters checked, and an early end that is no error."""

import nbformat
import papermill
import pytest
from jupyter_client.manager import start_new_kernel
from papermill.exceptions import PapermillExecutionError

from acx4book import notebook
from acx4files import flight
from support.flights import written
from support.helpers import repeats, write_notebook

PARAMETERS = "flight_path: str = 'a'\nresults_path: str = 'b'\nshare: float = 0.5  # of them\n"
BEGIN = "from acx4book import notebook\nnotebook.begin()"
NEEDS = f"""{BEGIN}
import acx4 as acx
notebook.needs(acx.read(flight_path), "heads")
print("not shown")"""
ENDS = "This notebook ends here: the flight has no block heads."


@pytest.fixture(scope="module")
def flight_path(tmp_path_factory):
    return str(written.write_flight(tmp_path_factory.mktemp("flight"), blocks=("calibration",)))


def by_papermill(folder, *cells, **parameters):
    """Run cells by papermill and the usual kernel; return the executed cells."""
    path, out = folder / "notebook.ipynb", folder / "out.ipynb"
    write_notebook(path, PARAMETERS, *cells)
    papermill.execute_notebook(
        path, out, parameters=parameters, kernel_name="python3", progress_bar=False
    )
    return nbformat.read(out, as_version=4).cells


def outputs(cells):
    return [output for cell in cells for output in cell.get("outputs", [])]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "says"),
    [
        (
            {"flight": "f"},
            "ValueError: unknown parameter flight; "
            "this notebook has flight_path, results_path, share",
        ),
        repeats(
            {"flight_path": 7},
            "ValueError: parameter flight_path: 7; must be str; "
            "papermill takes text as it is by -r flight_path",
        ),
        repeats({"share": "much"}, "ValueError: parameter share: 'much'; must be float"),
    ],
)
def test_an_unknown_parameter_or_one_of_another_type_is_named_in_the_last_line(
    tmp_path, given, says
):
    with pytest.raises(PapermillExecutionError) as caught:
        by_papermill(tmp_path, BEGIN, **given)
    assert str(caught.value).strip().splitlines()[-1] == says


@pytest.mark.slow
def test_known_parameters_are_taken_and_a_block_that_is_not_there_ends_it_in_one_sentence(
    tmp_path, flight_path
):
    after = ("print('nor this')", "1 / 0")
    cells = by_papermill(tmp_path, "print(share)", NEEDS, *after, flight_path=flight_path, share=1)
    said, shown = outputs(cells)
    assert said.text == "1\n"
    assert shown.data == {"text/markdown": ENDS, "text/plain": ENDS}


@pytest.mark.slow
def test_where_a_reader_runs_all_cells_those_below_wait_and_can_be_run(flight_path):
    manager, client = start_new_kernel(kernel_name="python3")
    shown = []

    def run(cell):
        return client.execute_interactive(cell, allow_stdin=True, output_hook=shown.append)

    try:
        assert run(f"flight_path = {flight_path!r}")["content"]["status"] == "ok"
        # a reply of this status is what stops "run all cells"
        assert run(NEEDS)["content"]["status"] == "error"
        kinds = {m["msg_type"] for m in shown} - {"status", "execute_input"}
        assert kinds == {"display_data"}
        assert run("print(1)")["content"]["status"] == "ok"
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)
    assert [m["content"]["text"] for m in shown if m["msg_type"] == "stream"] == ["1\n"]


def test_outside_of_a_notebook_it_begins_without_a_sound_and_ends_with_its_sentence(
    flight_path, capsys
):
    notebook.begin()
    flown = flight.read(flight_path)
    notebook.needs(flown, "mounting")
    with pytest.raises(notebook.End, match="ends here: the flight has no block heads"):
        notebook.needs(flown, "heads")
    assert capsys.readouterr().out == ""
