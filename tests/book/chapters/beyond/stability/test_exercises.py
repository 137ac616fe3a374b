"""Solutions agree with what was found in another way, and say their numbers."""

import pytest

from acx4book.chapters.beyond.stability import exercises


@pytest.mark.parametrize(
    ("solve", "number", "said"),
    [
        (exercises.pooled, 0.4, "σ = 0.89 µm"),
        (exercises.most_parameters, 18, "Times 18"),
        (exercises.corner, 0.134, "r = 33.4 mm"),
        (exercises.temperatures, 1.2, "times smaller"),
    ],
)
def test_a_solution_is_found_in_two_ways(solve, number, said):
    found = solve()
    assert found.value == pytest.approx(found.again, rel=1e-6)
    assert found.value == pytest.approx(number, rel=0.1)
    assert said in found.text
