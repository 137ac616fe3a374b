"""Solutions, each in two ways."""

import pytest

from acx4book.reference.heads import exercises


def test_both_ways_agree():
    heights, unit = exercises.two_heights(), exercises.unit_of_focal_length()
    assert heights.again == pytest.approx(heights.value)
    assert unit.again == pytest.approx(unit.value)
    high = exercises.high_enough()
    assert 0 <= high.again - high.value <= 1
    assert "mm" in unit.text
