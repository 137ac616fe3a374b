import json

import numpy as np
import pytest

from acx4book.typesetting.moving import Column, Explorer, Linear, Mark, Roots, Slider, Stops

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
