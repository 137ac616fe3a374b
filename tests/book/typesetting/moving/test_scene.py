import json
import re

import numpy as np
import pytest
from bs4 import BeautifulSoup

from acx4book.typesetting import maps, moving
from acx4book.typesetting.moving import Layer, Scene

AXES = np.array([[[20.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 50.0]]])


@pytest.fixture
def made():
    ends = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    return Scene(
        name="block-in-space",
        alt="a line & a point",
        caption="<c>",
        layers=[
            Layer(name="line", kind="lines", colour="blue", at=ends),
            Layer(name="<b>", kind="points", colour="ink", at=ends[1:] + 60.0, labels=["<i>"]),
            Layer(name="e", kind="ellipsoids", colour="brick", at=ends[:1], axes=AXES),
        ],
    )


def test_coordinates_are_from_the_middle(made):
    assert made.middle == pytest.approx([80.0, 30.0, 30.0])
    layers = made.data()["layers"]
    assert layers[0]["at"] == [-80.0, -30.0, -30.0, 20.0, -30.0, -30.0]
    assert layers[2]["axes"] == AXES.ravel().tolist()


def test_the_eye_is_where_the_drawing_is_seen_from(made):
    """It has no place on the drawing but its middle."""
    eye = np.array(made.data()["from"])
    assert np.linalg.norm(eye) == pytest.approx(1.0, abs=1e-3)
    turn = maps.view(moving.FROM_DEG, moving.ABOVE_DEG)
    assert turn.apply(eye) == pytest.approx([0.0, 0.0, 1.0], abs=1e-3)


def test_the_outline_of_an_ellipsoid_is_where_its_rays_touch_it():
    """The ends farthest to the right and up, against those of the surface itself."""
    rng = np.random.default_rng(1)
    axes = rng.normal(size=(3, 3))
    unit = rng.normal(size=(20_000, 3))
    surface = unit / np.linalg.norm(unit, axis=1, keepdims=True) @ axes
    (seen,) = moving.outline(axes[None, :, :2])
    for direction in np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]]):
        farthest = (surface[:, :2] @ direction).max()
        assert (seen @ direction).max() == pytest.approx(farthest, rel=0.02)


def test_the_drawing_is_inside_its_frame_and_in_proportion(made):
    text = moving.view(made).html
    first = re.search(r'd="M(\S+) (\S+)L(\S+) (\S+)"', text)
    x0, y0, x1, y1 = map(float, first.groups())
    turn = maps.view(moving.FROM_DEG, moving.ABOVE_DEG)
    along = turn.apply([100.0, 0.0, 0.0])[:2]
    assert (y0 - y1) / (x1 - x0) == pytest.approx(along[1] / along[0], abs=0.01)
    points = np.array([[x0, y0], [x1, y1]])
    assert np.all((points >= 0) & (points <= moving.SIZE))


def test_names_are_text_in_the_page(made):
    page = BeautifulSoup(moving.view(made).html, "html.parser")
    assert [item.get_text().strip() for item in page.select("li")] == ["line", "<b>", "e"]
    assert page.select_one("svg text").get_text() == "<i>"
    assert page.select_one("svg")["aria-label"] == made.alt
    assert json.loads(page.select_one("script").string) == made.data()
