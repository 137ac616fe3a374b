import html.parser
import json
import re

from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4book.teaching import showing
from acx4book.teaching.showing import Figure
from acx4book.typesetting import style


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
