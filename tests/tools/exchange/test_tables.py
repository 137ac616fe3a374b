"""Tables with the digits that they need, and names that a flight may use."""

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange import tables


def test_numbers_have_the_digits_that_they_need():
    points = tables.image_points(["a"], ["1"], np.array([[1.23456789, 2.0]]))
    assert points == {"image": ["a"], "point": ["1"], "col_px": [1.2346], "row_px": [2.0]}
    table = tables.trajectory_in_grid(
        ["a"], np.array([[1.123456789, 2.0, 3.0]]), np.radians([[0.1, 0.2, 1 / 3]])
    )
    assert table["east_m"] == [1.12346]
    assert table["kappa_deg"] == [0.333333333]


def test_names_that_stand_twice_get_the_program_s_number():
    assert tables.without_doubles(["a", "b", "a"], [7, 8, 9]) == (["a#7", "b", "a#9"], 2)
    names, place = tables.first_use(["b", "a", "b"])
    assert (names, place.tolist()) == (["b", "a"], [0, 1, 0])


@pytest.mark.parametrize(
    ("name", "said"), [("", "is empty"), ("=a", "would be computed"), ("a\nb", "U\\+000A")]
)
def test_a_name_that_no_flight_may_use_is_refused(name, said):
    def wrong(name, found, expected):
        return FlightError([f"f:1: name: {found}; {expected}"])

    with pytest.raises(FlightError, match=f"f:1: name: .*{said}"):
        tables.require_names(["good", name], wrong)
