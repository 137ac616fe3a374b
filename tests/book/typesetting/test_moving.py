"""Figures that move, as a page has them before a script runs."""

import json

import numpy as np
import pytest
from bs4 import BeautifulSoup

from acx4book.typesetting import maps, moving, style
from acx4book.typesetting.moving import (
    Explorer,
    Layer,
    Linear,
    Mark,
    Panel,
    Plane,
    Scene,
    Slider,
    Stops,
)

HOSTILE = "</script><b> & <!--"
SLIDER = Slider(name=HOSTILE, unit="m", low=-0.5, high=0.5, step=0.25)
PLANE = Plane(x=(-10.0, 10.0), y=(0.0, 5.0), size=(120.0, 90.0), margin=(10.0, 10.0, 20.0, 20.0))


def test_a_response_is_a_matrix_times_values():
    response = Linear(matrix=np.array([[1.0, 2.0], [0.0, -1.0]]))
    assert response.at([3.0, 0.5]) == pytest.approx([4.0, -0.5])


def test_a_table_has_a_row_for_every_stop_of_the_sliders_that_matter():
    other = Slider(name="b", unit="m", low=0, high=1, step=0.5)
    response = Stops(sliders=[other, SLIDER], table=np.arange(10.0).reshape(1, 5, 2))
    assert response.at([1.0, 0.25]) == pytest.approx([6.0, 7.0])
    assert response.data()["stops"][0][3] == [6.0, 7.0]


def test_corners_of_the_plane_are_at_the_margins_and_y_counts_upwards():
    corners = np.array([[-10.0, 0.0], [10.0, 5.0]])
    assert PLANE.at(corners) == pytest.approx(np.array([[10.0, 70.0], [110.0, 20.0]]))
    assert PLANE.scale == pytest.approx([5.0, -10.0])


def test_an_arrow_ends_at_its_place_and_without_length_is_none():
    mark = Mark("arrows", "teal", PLANE, Linear(matrix=np.array([[3.0], [2.0]])), times=2.0)
    assert mark.path([1.0]).startswith("M60.00 70.00L90.00 30.00M")
    assert mark.path([0.0]) == ""


@pytest.fixture
def explorer():
    mark = Mark("curve", "blue", PLANE, Linear(matrix=np.array([[1.0], [0.0]])))
    return Explorer(
        name="explorer-one",
        caption=HOSTILE,
        sliders=[SLIDER],
        presets={"half": [-0.5], "none": [0.0]},
        panels=[Panel(title=HOSTILE, alt="seen", size=(10.0, 10.0), fixed="", marks=[mark])],
        columns={HOSTILE: 1, "length": 1},
        rows={
            HOSTILE: [
                Linear(matrix=np.array([[100.0]])),
                Linear(matrix=np.array([[6.0], [8.0]])),
            ]
        },
    )


@pytest.fixture
def scene():
    ends = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    return Scene(
        name="block-in-space",
        alt="a line & a point",
        caption=HOSTILE,
        layers=[
            Layer(name="line", kind="lines", colour="blue", at=ends),
            Layer(name=HOSTILE, kind="points", colour="ink", at=ends + 60.0, labels=[HOSTILE]),
        ],
    )


def test_without_a_script_it_shows_the_start(explorer):
    page = BeautifulSoup(explorer.html, "html.parser")
    assert page.select_one("li").get_text() == f"{HOSTILE} = −0.50\N{NO-BREAK SPACE}m"
    assert [cell.get_text() for cell in page.select("tbody td")] == ["−50.0", "5.0"]
    path = page.select_one(".marks path")
    assert path["d"] == "M57.50 70.00"
    assert path["stroke"] == f"var(--figure-blue, {style.BLUE})"
    assert page.select_one("svg")["aria-label"] == "seen"


def test_without_a_script_the_block_is_seen_from_its_start(scene):
    page = BeautifulSoup(scene.html, "html.parser")
    x0, y0, x1, y1 = map(float, page.path["d"].replace("L", " ").strip("M").split())
    along = maps.view(moving.FROM_DEG, moving.ABOVE_DEG).apply([100.0, 0.0, 0.0])
    assert (y0 - y1) / (x1 - x0) == pytest.approx(along[1] / along[0], abs=0.01)
    eye = maps.view(moving.FROM_DEG, moving.ABOVE_DEG).apply(scene.data()["from"])
    assert eye == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)


@pytest.mark.parametrize("shown", ["explorer", "scene"])
def test_names_are_text_and_data_come_out_as_they_went_in(request, shown):
    figure = request.getfixturevalue(shown)
    page = BeautifulSoup(figure.html, "html.parser")
    assert page.select("b") == []
    assert page.select_one("figcaption").get_text() == HOSTILE == repr(figure)
    assert json.loads(page.select_one("script").string) == figure.data()
    assert figure._repr_html_() == figure.html
