"""Executed notebooks as pages of the book."""

import nbformat

from acx4book.pages import build


def executed(path):
    """Write a notebook of a title and a cell that shows something."""
    v4 = nbformat.v4
    shown = v4.new_code_cell("1", outputs=[v4.new_output("execute_result", {"text/plain": "1"})])
    cells = [v4.new_markdown_cell("# Title\n\nIntroduction."), shown]
    nbformat.write(v4.new_notebook(cells=cells), path)


def test_code_that_shows_something_is_folded(tmp_path):
    executed(tmp_path / "a.ipynb")
    build.fold(tmp_path / "a.ipynb", tmp_path / "b.ipynb")
    page = nbformat.read(tmp_path / "b.ipynb", as_version=4)
    assert page.cells[1].metadata["tags"] == ["hide-input"]
    assert page.cells[0].source == "# Title\n\nIntroduction."


def test_a_note_stands_under_the_introduction(tmp_path):
    executed(tmp_path / "a.ipynb")
    build.fold(tmp_path / "a.ipynb", tmp_path / "b.ipynb", note=build.IDEAL)
    page = nbformat.read(tmp_path / "b.ipynb", as_version=4)
    assert page.cells[0].source == f"# Title\n\nIntroduction.\n\n{build.IDEAL}"
    assert len(page.cells) == 2
