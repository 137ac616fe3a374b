"""Every solution is found in two ways."""

import pytest

from acx4book.chapters.beyond.error_budget import exercises


@pytest.mark.parametrize(
    ("solve", "within"),
    [
        (exercises.roll_of_half_a_pixel, 1e-6),
        (exercises.more_overlap, 1e-6),
        (exercises.harmless_height, 50.0),
        (exercises.a_fifth_better, 1e-3),
    ],
)
def test_both_ways_agree(found, solve, within):
    solved = solve(found)
    assert solved.again == pytest.approx(solved.value, abs=within)


def test_half_a_pixel_is_an_angle_at_any_height(found):
    """0.5 x 5.6 um / 74.44 mm."""
    assert exercises.roll_of_half_a_pixel(found).value == pytest.approx(0.002155, abs=1e-6)


def test_the_harmless_height_lies_between_those_of_the_calibration(found):
    assert 1000 <= exercises.harmless_height(found).value <= 1500
