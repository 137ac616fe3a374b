"""Distances against a box whose sides and diagonals are whole numbers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.distances import Distances, lengths
from support.helpers import numeric_jacobian

BOX = np.array([[0.0, 0.0, 0.0], [2.0, 3.0, 6.0], [2.0, 3.0, 0.0], [2.0, 7.0, 3.0]])


def test_a_box_of_2_by_3_by_6_has_a_diagonal_of_7():
    length, along = lengths(BOX, np.array([[0, 1], [1, 0], [2, 3]]))
    assert_allclose(length, [7.0, 7.0, 5.0], rtol=1e-15)
    assert_allclose(along[0], np.array([2, 3, 6]) / 7, rtol=1e-15)
    assert_allclose(along[1], -along[0], atol=0)


def test_the_unit_vector_is_the_derivative_by_the_second_end():
    ends = np.array([[0, 3]])

    def to(x):
        return lengths(np.vstack([BOX[:3], x]), ends)[0]

    assert_allclose(numeric_jacobian(to, BOX[3]), lengths(BOX, ends)[1], atol=1e-9)


def test_points_in_one_place_have_no_direction():
    length, along = lengths(np.zeros((2, 3)), np.array([[0, 1]]))
    assert length == 0.0
    assert not along.any()


def test_some_of_many_are_taken_in_their_order():
    many = Distances(
        point_idx=np.array([[0, 1], [1, 2], [2, 0]]),
        distance_m=np.array([1.0, 2.0, 3.0]),
        sigma_m=np.full(3, 0.001),
    )
    some = many[np.array([2, 0])]
    assert (len(many), len(some), len(Distances())) == (3, 2, 0)
    assert_allclose(some.distance_m, [3.0, 1.0])
    assert some.point_idx.tolist() == [[2, 0], [0, 1]]


@pytest.mark.parametrize(
    ("part", "value", "says"),
    [
        ("distance_m", [0.0, 1.0], "distance_m"),
        ("distance_m", [np.inf, 1.0], "distance_m"),
        ("sigma_m", [0.1], "sigma_m"),
        ("sigma_m", [0.1, np.nan], "sigma_m"),
        ("point_idx", [[0, 1, 2], [1, 2, 3]], "point_idx"),
        ("point_idx", [[0, 1], [4, 4]], "got point 4 twice in row 1"),
    ],
)
def test_what_is_no_distance_is_named(part, value, says):
    parts = {
        "point_idx": np.array([[0, 1], [1, 2]]),
        "distance_m": np.array([1.0, 2.0]),
        "sigma_m": np.array([0.1, 0.1]),
    }
    with pytest.raises(ValueError, match=says):
        Distances(**{**parts, part: np.array(value)})
