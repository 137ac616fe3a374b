"""What cells show becomes the outputs that a Jupyter kernel would give."""

import os
import signal

import matplotlib.pyplot as plt
import nbformat
import pytest

from acx4book.notebooks import interpreter
from support.helpers import write_notebook


def run(folder, *cells):
    """Run cells after that of the parameters, and return them with the cells that were started."""
    notebook, executed = write_notebook(folder / "a.ipynb", "seed = 1", *cells), folder / "b.ipynb"
    started = []
    try:
        interpreter.execute(
            str(notebook),
            str(executed),
            parameters={"seed": 7},
            home=str(folder),
            on_cell=started.append,
        )
    finally:
        made = nbformat.read(executed, as_version=4)
        nbformat.validate(made)
    return made.cells[2:], started


def test_text_displays_and_values_come_in_the_order_in_which_they_were_made(tmp_path):
    cells, started = run(
        tmp_path,
        "import sys\nfrom IPython.display import Markdown, display\n"
        "print('one', seed)\nprint('two')\nprint('three', file=sys.stderr)\n"
        "display(Markdown('*four*'))\n'five'",
        "'nothing';",
    )
    outputs = cells[0].outputs
    assert [output.output_type for output in outputs] == [
        *("stream", "stream", "display_data", "execute_result")
    ]
    assert [(o.name, o.text) for o in outputs[:2]] == [
        ("stdout", "one 7\ntwo\n"),
        ("stderr", "three\n"),
    ]
    assert outputs[2].data["text/markdown"] == "*four*"
    assert outputs[3].data == {"text/plain": "'five'"}
    assert outputs[3].execution_count == cells[0].execution_count == 3
    assert cells[1].outputs == []
    assert started == [0, 1, 2, 3]


@pytest.mark.parametrize("text", ["The lens is stable", "http://localhost:9/x is down"])
def test_text_is_shown_and_no_file_or_address_of_that_name(tmp_path, monkeypatch, text):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "The lens is stable").write_text("The lens is not stable")
    monkeypatch.chdir(tmp_path / "here")
    cells, _ = run(tmp_path, f"from IPython.display import HTML, Markdown\nMarkdown({text!r})")
    assert cells[0].outputs[0].data["text/markdown"] == text


def test_what_is_displayed_by_name_can_be_replaced_and_outputs_be_cleared(tmp_path):
    cells, _ = run(
        tmp_path,
        "from IPython.display import clear_output, display\n"
        "shown = display('old', display_id=True)",
        "shown.update('new')\nprint('gone')\nclear_output()\nprint('left')",
    )
    assert [output.data["text/plain"] for output in cells[0].outputs] == ["'new'"]
    assert [output.text for output in cells[1].outputs] == ["left\n"]


def test_a_binary_picture_is_text_a_figure_a_drawing_and_one_of_nothing_a_sentence(tmp_path):
    left = plt.figure()  # of the process that runs the notebook, which shows none of it
    pixel = "b'\\x89PNG\\r\\n\\x1a\\n'"
    cells, _ = run(
        tmp_path,
        f"from IPython.display import Image\nImage({pixel}, format='png')",
        "import matplotlib.pyplot as plt\n_ = plt.plot([1, 2])\nprint('before')",
        "from acx4book.typesetting import style\nstyle.subplots(figsize=(2, 2))[0]",
        "style.nothing('no *data*')",
    )
    assert cells[0].outputs[0].data["image/png"].startswith("iVBORw0KGgo")
    text, picture = cells[1].outputs
    assert text.text == "before\n"
    for drawn in (picture, *cells[2].outputs):
        assert drawn.data["image/svg+xml"].startswith("<svg ")
        assert "image/png" not in drawn.data
    (said,) = cells[3].outputs
    assert said.data["text/markdown"] == r"no &#42;data&#42;"
    assert not {"image/svg+xml", "image/png"} & said.data.keys()
    assert plt.fignum_exists(left.number)
    plt.close(left)


def test_the_own_commands_of_ipython_work_and_their_wrong_use_is_an_error(tmp_path):
    cells, _ = run(tmp_path, "found = !echo seen\nprint(found)")
    assert "seen" in cells[0].outputs[0].text
    with pytest.raises(interpreter.Failed) as caught:
        run(tmp_path, "%no_such_command")
    assert (caught.value.index, caught.value.name) == (2, "UsageError")


def test_a_process_that_is_killed_is_told_with_its_signal(tmp_path):
    with pytest.raises(interpreter.Failed) as caught:
        run(tmp_path, "2", f"import os\nos.kill(os.getpid(), {int(signal.SIGKILL)})")
    assert caught.value.index == 3
    assert caught.value.message == "its process was ended by signal 9 (Killed)"


def test_nothing_of_a_notebook_stays_in_the_process_that_runs_it(tmp_path, capfd):
    before = dict(os.environ)
    cells, _ = run(
        tmp_path,
        "import os\nos.environ['LEFT'] = 'behind'\nprint(os.environ['IPYTHONDIR'])\n"
        "os.write(1, b'unseen');",
    )
    assert dict(os.environ) == before
    assert capfd.readouterr().out == ""
    assert cells[0].outputs[0].text == f"{tmp_path}\n"
