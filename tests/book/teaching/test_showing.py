"""What teachers show: tables, slides and a pack of figures."""

import base64
import html.parser
import io
import json
import re
import zipfile

import nbformat
import pytest

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.teaching import showing
from acx4book.teaching.sheets.every import SHEETS
from acx4book.teaching.showing import Figure
from acx4book.typesetting import style

# --- tables ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def texts():
    return dict(showing.texts())


@pytest.mark.parametrize("name", SHEETS)
def test_the_books_tables_have_every_question_and_the_mistakes(name, texts):
    sheet = SHEETS[name]
    asked, solved = texts[f"{name}-questions.md"], texts[f"{name}-solution.md"]
    for question in sheet.questions:
        assert f"`{question.name}`" in asked
        assert f"`{question.name}`" in solved
    assert solved.count("\n| ") > len(sheet.questions) + 6


# --- slides ----------------------------------------------------------------------------------


def test_every_figure_of_the_lecture_is_in_the_book():
    for slide in showing.LECTURE:
        if slide.figure:
            text = (NOTEBOOKS_PATH / f"{slide.chapter}.ipynb").read_text(encoding="utf-8")
            named = [
                cell["metadata"].get("mystnb", {}).get("figure", {}).get("name")
                for cell in json.loads(text)["cells"]
            ]
            assert slide.figure in named


DRAWN = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="9pt" height="9pt" viewBox="0 0 9 9"><g>'
    f'<path d="m0 0v3" style="stroke: {style.INK}"/></g></svg>'
).encode()


def test_the_page_has_all_slides_and_asks_for_no_other_file():
    figure = Figure(chapter="c", name="f", caption="", alt='a "b" <c>', kind="svg", content=DRAWN)
    told = (
        showing.Slide(title="1 < 2", says=("a", "b"), chapter="c", figure="f"),
        showing.Slide(title="Two", says=("c",), chapter="c", figure="not there"),
    )
    page = showing.slides([figure], told)
    html.parser.HTMLParser().feed(page)
    assert page.count("<section>") == 2
    assert "1 &lt; 2" in page
    assert 'aria-label="a &quot;b&quot; &lt;c&gt;"' in page
    assert f'<path d="m0 0v3" style="stroke: {style.INK}"/>' in page
    assert not re.findall(r'(?:src|href)="([^#][^"]*)', page)
    assert "http" not in page


def test_every_slide_is_linked_once_by_its_number():
    text = "".join(text for _, text in showing.links())
    assert re.findall(r"slides\.html#slide-(\d+)", text) == [
        str(number) for number in range(1, len(showing.LECTURE) + 1)
    ]
    assert [name for name, _ in showing.links()] == [f"block-{k}-slides.md" for k in range(1, 6)]


# --- figure pack -----------------------------------------------------------------------------


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
