"""The accuracy that the front page tells is that of all stored flights."""

import numpy as np
import pytest

from acx4book.chapters.beyond.synthetic_cost import study
from acx4book.pages import accuracy

STORED = study.STORED


@pytest.fixture(scope="module")
def ideal():
    return accuracy.of_ideal(STORED, "single_step")


def test_the_median_is_that_of_all_flights_and_not_of_one(ideal):
    assert len(ideal) == 200
    assert np.median(ideal["height"]) == pytest.approx(0.314, abs=0.001)
    assert np.sqrt(np.mean(ideal["height"] ** 2)) == pytest.approx(0.335, abs=0.001)


def test_class_a_is_reached_in_part_of_the_flights(ideal):
    assert ideal["height_5000"].mean() == pytest.approx(0.56, abs=0.01)
    assert accuracy.of_ideal(STORED, "two_step")["height_5000"].mean() == pytest.approx(
        0.48, abs=0.01
    )


def test_flights_of_four_heads_stand_first():
    said = accuracy.page(STORED)
    assert said.index("four heads, single-step") < said.index("ideal camera")
    assert f"| {study.read().n_flights} |" in said
