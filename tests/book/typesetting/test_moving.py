"""explorer plane scene shown"""

import json
import re

import numpy as np
import pytest
from bs4 import BeautifulSoup

from acx4book.typesetting import maps, moving, style
from acx4book.typesetting.moving import (
    Column,
    Explorer,
    Layer,
    Linear,
    Mark,
    Panel,
    Plane,
    Roots,
    Scene,
    Slider,
    Stops,
)

# --- explorer --------------------------------------------------------------------------------


SLIDER = Slider(name="a", unit="m", low=-0.5, high=0.5, step=0.25)


def test_stops_go_from_end_to_end_and_are_told_apart():
    assert SLIDER.stops == pytest.approx([-0.5, -0.25, 0.0, 0.25, 0.5])
    assert SLIDER.digits == 2
    digits = {1.0: 0, 5.0: 0, 0.5: 1, 0.05: 2, 0.005: 3}
    for step, expected in digits.items():
        assert Slider(name="", unit="", low=0, high=10, step=step).digits == expected


@pytest.mark.parametrize(("unit", "after"), [("m", "\xa0m"), ("°", "°"), ("", "")])
def test_a_unit_stands_as_it_is_printed(unit, after):
    slider = Slider(name="a", unit=unit, low=0.0, high=1.0, step=0.5)
    assert slider.after == slider.data()["after"] == after


def test_a_response_is_a_constant_and_a_matrix_times_values():
    response = Linear(matrix=np.array([[1.0, 2.0], [0.0, -1.0]]), constant=np.array([10.0, 0.0]))
    assert response.at([3.0, 0.5]) == pytest.approx([14.0, -0.5])


def test_a_table_has_a_row_for_every_stop_of_the_sliders_that_matter():
    other = Slider(name="b", unit="m", low=0, high=1, step=0.5)
    sliders = [other, SLIDER]
    response = Stops(sliders=sliders, table=np.arange(10.0).reshape(1, 5, 2))
    assert response.at([1.0, 0.25]) == pytest.approx([6.0, 7.0])
    assert response.data()["stops"][0][3] == [6.0, 7.0]
    both = Stops(sliders=sliders, table=np.arange(15.0).reshape(3, 5, 1))
    assert both.at([0.5, -0.25]) == pytest.approx([6.0])
    with pytest.raises(ValueError, match=r"expected axes of 1 or of \[3, 5\] stops"):
        Stops(sliders=sliders, table=np.zeros((5, 2)))


def test_places_are_scaled_from_where_a_mark_stands():
    response = Linear(matrix=np.array([[1.0], [2.0]]))
    mark = Mark(
        kind="arrows",
        colour="blue",
        at=np.array([[10.0, 20.0]]),
        scale=(2.0, -3.0),
        response=response,
    )
    assert mark.places([4.0]) == pytest.approx(np.array([[18.0, -4.0]]))


def read(numbers, digits):
    """Return a constant response as the table of an explorer shows it."""
    constant = Linear(matrix=np.zeros((len(numbers), 1)), constant=np.array(numbers))
    parts = {"name": "a", "caption": "", "sliders": [SLIDER], "panels": [], "presets": {"": [0.0]}}
    explorer = Explorer(
        **parts, columns=[Column(title="", digits=digits)], rows={"row": [constant]}
    )
    return explorer.readings([0.0])[0][0]


@pytest.mark.parametrize(
    ("number", "digits", "expected"),
    [(-0.04, 1, "0.0"), (-0.06, 1, "−0.1"), (2.5, 0, "2"), (-12.0, 0, "−12")],
)
def test_zero_has_no_sign(number, digits, expected):
    assert read([number], digits) == expected


def test_a_reading_of_two_numbers_is_their_length():
    assert read([-3.0], 1) == "−3.0"
    assert read([3.0, -4.0], 1) == "5.0"


def test_data_are_plain_and_short():
    response = Linear(matrix=np.array([[1 / 3, 0.0]]), constant=-0.0)
    assert json.dumps(response.data()) == '{"constant": [0.0], "matrix": [[0.333333, 0.0]]}'


def test_roots_add_squares_at_the_stop_of_the_first_slider():
    """The root of 0.3^2 + (2 x 0.2)^2, and the same twice as large at the next stop."""
    other = Slider(name="b", unit="", low=0.0, high=1.0, step=0.1)
    table = np.array([[[0.3, 2.0]]]) * np.arange(1.0, 6.0)[:, None, None]
    response = Roots(sliders=[SLIDER, other], table=table)
    assert response.at([-0.5, 0.2]) == pytest.approx([0.5])
    assert response.at([-0.25, 0.2]) == pytest.approx([1.0])
    assert response.data()["roots"][1] == [[0.6, 4.0]]
    with pytest.raises(ValueError, match=r"expected \(5, n, 2\)"):
        Roots(sliders=[SLIDER, other], table=table[:3])


# --- plane -----------------------------------------------------------------------------------


PLANE = Plane(x=(-10.0, 10.0), y=(0.0, 5.0), size=(120.0, 90.0), margin=(10.0, 10.0, 20.0, 20.0))


def mark(kind, *moved):
    response = Linear(matrix=np.array([moved]).T)
    at = np.tile([10.0, 20.0], (len(moved) // 2, 1))
    return Mark(kind=kind, colour="teal", at=at, scale=(1.0, 1.0), response=response)


def test_corners_of_the_plane_are_at_the_margins_and_y_counts_upwards():
    corners = np.array([[-10.0, 0.0], [10.0, 5.0]])
    assert PLANE.at(corners) == pytest.approx(np.array([[10.0, 70.0], [110.0, 20.0]]))
    assert PLANE.scale == pytest.approx((5.0, -10.0))


def test_an_arrow_ends_at_its_place_with_a_head_no_longer_than_half_of_it():
    d = moving.path(mark("arrows", 30.0, 40.0), [1.0])
    points = np.array(re.findall(r"-?[\d.]+", d), dtype=float).reshape(-1, 2)
    assert points[[0, 1]] == pytest.approx(np.array([[10.0, 20.0], [40.0, 60.0]]))
    short = moving.path(mark("arrows", 3.0, 4.0), [1.0])
    back = np.array(re.findall(r"-?[\d.]+", short), dtype=float).reshape(-1, 2)[2] - [13.0, 24.0]
    assert np.hypot(*back) == pytest.approx(2.5, abs=0.05)


def test_an_arrow_without_length_is_none():
    assert moving.path(mark("arrows", 30.0, 40.0), [0.0]) == ""


def test_a_bar_ends_at_its_place():
    assert moving.path(mark("bars", 25.0, 0.0), [1.0]) == "M10.00 14.00H35.00v12.00H10.00z"


def test_a_dot_lies_around_its_place():
    d = moving.path(mark("dots", 25.0, 0.0), [1.0])
    assert d == "M29.00 20.00a6.00 6.00 0 1 0 12.00 0a6.00 6.00 0 1 0 -12.00 0z"


def test_a_curve_goes_through_its_places():
    assert moving.path(mark("curve", 1.0, 2.0, 3.0, 4.0), [1.0]) == "M11.00 22.00L13.00 24.00"


def test_text_is_escaped_and_colours_are_those_of_the_page_or_of_the_figures():
    text = PLANE.text((0.0, 0.0), "<b> & c", colour="blue")
    assert "&lt;b&gt; &amp; c" in text
    assert f'fill="var(--figure-blue, {style.BLUE})"' in text


def test_axes_have_all_numbers():
    drawn = PLANE.axes([-10, 0, 10], [0.0, 2.5, 5.0], labels=("x, m", "y, m"))
    said = re.findall(r">([^<]+)</text>", drawn)
    assert said == ["−10", "0", "10", "0.0", "2.5", "5.0", "x, m", "y, m"]


# --- scene -----------------------------------------------------------------------------------


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
    text = made.html
    first = re.search(r'd="M(\S+) (\S+)L(\S+) (\S+)"', text)
    x0, y0, x1, y1 = map(float, first.groups())
    turn = maps.view(moving.FROM_DEG, moving.ABOVE_DEG)
    along = turn.apply([100.0, 0.0, 0.0])[:2]
    assert (y0 - y1) / (x1 - x0) == pytest.approx(along[1] / along[0], abs=0.01)
    points = np.array([[x0, y0], [x1, y1]])
    assert np.all((points >= 0) & (points <= moving.SIZE))


def test_names_are_text_in_the_page(made):
    page = BeautifulSoup(made.html, "html.parser")
    assert [item.get_text().strip() for item in page.select("li")] == ["line", "<b>", "e"]
    assert page.select_one("svg text").get_text() == "<i>"
    assert page.select_one("svg")["aria-label"] == made.alt
    assert json.loads(page.select_one("script").string) == made.data()


# --- shown -----------------------------------------------------------------------------------


@pytest.fixture
def shown_made():
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


def test_without_a_script_it_shows_the_start(shown_made):
    page = BeautifulSoup(shown_made.html, "html.parser")
    assert page.select_one("li").get_text() == "</script><b> = −0.5\N{NO-BREAK SPACE}m"
    assert page.select_one("tbody td").get_text() == "−50.0"
    assert page.select_one(".marks path")["d"] == moving.path(shown_made.panels[0].marks[0], [-0.5])
    assert page.select_one("svg")["aria-label"] == "seen"
    assert page.select_one("figcaption").get_text() == shown_made.caption


def test_data_come_out_of_the_page_as_they_went_in(shown_made):
    text = shown_made.html
    assert text.count("<script") == text.count("</script") == 1
    element = BeautifulSoup(text, "html.parser").select_one("script")
    assert json.loads(element.string) == json.loads(json.dumps(shown_made.data()))


def test_a_notebook_shows_the_html_and_a_terminal_the_caption(shown_made):
    assert shown_made._repr_html_() == shown_made.html
    assert repr(shown_made) == shown_made.caption
