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


def test_what_a_flight_has_nothing_of_is_left_out_with_its_heading(tmp_path):
    v4 = nbformat.v4
    figure = {"mystnb": {"figure": {"caption": "A figure.", "name": "fig-a"}}}
    instead = {"text/markdown": "The flight has no such block.", "text/plain": "Nothing"}

    def cell(source, data, **metadata):
        outputs = [v4.new_output("display_data", data=data)] if data else []
        return v4.new_code_cell(source, outputs=outputs, metadata=metadata)

    cells = [
        v4.new_markdown_cell("# Title"),
        v4.new_markdown_cell("## There\n\nThe next figure shows it."),
        cell("drawn", {"image/svg+xml": "<svg/>"}, **figure),
        v4.new_markdown_cell("It is a disc.", metadata={"tags": ["introduces"]}),
        cell("target", None, **figure),
        v4.new_markdown_cell("### Below\n\nThe next figure shows more."),
        cell("nothing", instead, **figure),
        v4.new_markdown_cell("## Not there\n\nThe next figure shows it."),
        cell("x = 1", None),
        cell("nothing", instead, **figure),
        cell('say("")', {"text/markdown": "", "text/plain": ""}, tags=["hide-input"]),
        v4.new_markdown_cell("## Told\n\nA table and a figure."),
        cell(
            "table",
            {"text/markdown": "| 1 |", "text/html": "1"},
            acx4={"caption": "T", "name": "t"},
        ),
        cell("nothing", instead, **figure),
    ]
    nbformat.write(v4.new_notebook(cells=cells), tmp_path / "a.ipynb")
    build.fold(tmp_path / "a.ipynb", tmp_path / "b.ipynb")
    page = nbformat.read(tmp_path / "b.ipynb", as_version=4)
    said = [c.source.splitlines()[0] for c in page.cells if c.cell_type == "markdown"]
    assert said == ["# Title", "## There", "## Told"]
    assert page.cells[-1].outputs[0].data["text/markdown"] == "The flight has no such block."
    assert "figure" not in page.cells[-1].metadata.get("mystnb", {})  # a sentence has no caption


def test_a_page_of_open_cells_shows_the_method_and_hides_what_only_the_page_needs(tmp_path):
    v4 = nbformat.v4
    table = {"text/html": "<table></table>", "text/markdown": "| x |\n| --- |\n| 1 |"}
    sentence = {"text/markdown": "There is one.", "text/plain": "There is one."}
    nothing = {"text/markdown": "", "text/plain": ""}

    def shown(source, data, **metadata):
        outputs = [v4.new_output("execute_result", data=data, execution_count=1)] if data else []
        return v4.new_code_cell(source, outputs=outputs, metadata=metadata)

    cells = [
        v4.new_markdown_cell("# Title"),
        shown("import x\nnotebook.begin()", None, tags=["hide-input"]),
        shown("single.table()", table, acx4={"caption": "A table", "name": "tab-a"}),
        shown('say("...")', sentence, tags=["hide-input"]),
        shown('say("")', nothing, tags=["hide-input"]),
        shown("figure(None)", None, mystnb={"figure": {"caption": "A figure."}}),
    ]
    nbformat.write(v4.new_notebook(cells=cells), tmp_path / "a.ipynb")
    build.fold(tmp_path / "a.ipynb", tmp_path / "b.ipynb")
    page = nbformat.read(tmp_path / "b.ipynb", as_version=4)
    _, imports, computed, said, silent, undrawn = page.cells
    assert imports.metadata.tags == ["hide-input"]
    assert "tags" not in computed.metadata
    assert computed.outputs[0].data == {
        "text/markdown": "```{table} A table\n:name: tab-a\n\n| x |\n| --- |\n| 1 |\n```"
    }
    assert said.metadata.tags == ["remove-input"]
    assert silent.metadata.tags == ["remove-cell"]
    assert silent.outputs == []
    assert undrawn.metadata.tags == ["remove-cell"]
