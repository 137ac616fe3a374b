"""Solutions agree with what was found in another way, and say their numbers."""

import pytest

from acx4book.chapters.beyond.distortion_models import exercises


@pytest.mark.parametrize(
    ("solve", "number", "said"),
    [
        (exercises.orthogonal, 0, "diagonal"),
        (exercises.number_of_waves, 48, "16 for N = 1"),
        (exercises.price, 141.7, "= 142"),
        (exercises.shift_of_a_dent, 0.53, "r = 12.3 mm"),
    ],
)
def test_a_solution_is_found_in_two_ways(solve, number, said):
    found = solve()
    assert found.value == pytest.approx(found.again, rel=1e-5, abs=1e-12)
    assert found.value == pytest.approx(number, rel=0.05)
    assert said in found.text
