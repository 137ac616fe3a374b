import json

import numpy as np
import pytest
from bs4 import BeautifulSoup

from acx4book.typesetting import moving
from acx4book.typesetting.moving import Column, Explorer, Linear, Mark, Panel, Slider


@pytest.fixture
def made():
    mark = Mark(
        kind="curve",
        colour="blue",
        at=np.zeros((1, 2)),
        scale=(1.0, 1.0),
        response=Linear(matrix=np.array([[1.0], [0.0]])),
    )
    return Explorer(
        name="explorer-one",
        caption="a < b & c",
        sliders=[Slider(name="</script><b>", unit="m", low=-1.0, high=1.0, step=0.5)],
        presets={"half": [-0.5], "none": [0.0]},
        panels=[Panel(title="t", alt="seen", size=(10.0, 10.0), fixed="", marks=[mark])],
        columns=[Column(title="x, cm", digits=1)],
        rows={"first": [Linear(matrix=np.array([[100.0]]))]},
    )


def test_without_a_script_it_shows_the_start(made):
    page = BeautifulSoup(moving.explorer(made).html, "html.parser")
    assert page.select_one("li").get_text() == "</script><b> = −0.5\N{NO-BREAK SPACE}m"
    assert page.select_one("tbody td").get_text() == "−50.0"
    assert page.select_one(".marks path")["d"] == moving.path(made.panels[0].marks[0], [-0.5])
    assert page.select_one("svg")["aria-label"] == "seen"
    assert page.select_one("figcaption").get_text() == made.caption


def test_data_come_out_of_the_page_as_they_went_in(made):
    text = moving.explorer(made).html
    assert text.count("<script") == text.count("</script") == 1
    element = BeautifulSoup(text, "html.parser").select_one("script")
    assert json.loads(element.string) == json.loads(json.dumps(made.data()))


def test_a_notebook_shows_the_html_and_a_terminal_the_caption(made):
    output = moving.explorer(made)
    assert output._repr_html_() == moving.explorer(made).html
    assert repr(output) == made.caption
