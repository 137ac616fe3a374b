import base64
import io
import zipfile

import nbformat
import pytest

from acx4book.teaching import showing

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)


@pytest.fixture
def executed(tmp_path):
    def cell(name, data):
        out = nbformat.v4.new_output("display_data", data=data)
        cell = nbformat.v4.new_code_cell("draw()", outputs=[out])
        if name:
            said = {"figure": {"name": name, "caption": "A\n caption."}, "image": {"alt": "Seen."}}
            cell.metadata["mystnb"] = said
        return cell

    png = base64.b64encode(PIXEL).decode()
    cells = [
        cell("fig-lines", {"image/svg+xml": "<svg/>", "image/png": png}),
        cell("fig-picture", {"image/png": png}),
        cell("", {"image/png": png}),
        cell("fig-table", {"text/plain": "1"}),
    ]
    (tmp_path / "part").mkdir()
    nbformat.write(nbformat.v4.new_notebook(cells=cells), tmp_path / "part" / "1-one.ipynb")
    return tmp_path


def test_the_archive_has_every_named_figure_once_with_its_caption(executed):
    found = [*showing.figures(executed)]
    content = showing.archive(found)
    assert content == showing.archive([*showing.figures(executed)])
    with zipfile.ZipFile(io.BytesIO(content)) as pack:
        assert pack.namelist() == [
            "figures.txt",
            "part/1-one/fig-lines.svg",
            "part/1-one/fig-picture.png",
        ]
        assert pack.read("part/1-one/fig-lines.svg") == b"<svg/>"
        assert pack.read("part/1-one/fig-picture.png") == PIXEL
        assert pack.read("figures.txt").decode().count("A caption.") == 2
    assert found[0].alt == "Seen."
