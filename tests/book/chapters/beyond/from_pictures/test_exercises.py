import pytest

from acx4book.chapters.beyond.from_pictures import exercises


@pytest.mark.parametrize("solve", [exercises.search, exercises.turned, exercises.shares])
def test_two_ways_agree_and_the_text_has_the_number(solve):
    solved = solve()
    assert solved.again == pytest.approx(solved.value, abs=1e-6)
    said = f"{solved.value:.0f}" if solved.value > 1 else f"{solved.value:.3f}"
    assert said in solved.text
