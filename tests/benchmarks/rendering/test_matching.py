"""The benchmark of tie points at a small size; truth by the simulator's own geometry."""

import pytest

from benchmarks.rendering import matching

pytestmark = [pytest.mark.slow, pytest.mark.repeats]


@pytest.fixture(scope="module")
def rows():
    return {row["method"]: row for row in matching.measure(matching.simulated(8))}


def test_ties_of_simulated_pictures_are_true_to_hundredths_of_a_pixel(rows):
    """Goals of full-size images, less the points: an eighth of the size has fewer cells."""
    ours = rows["corners + least-squares matching"]
    assert ours["rms_px"] < 0.04
    assert ours["within_0.1_px"] > 0.98
    assert ours["within_1_px"] == 1.0
    assert ours["points"] > 800


def test_they_are_three_times_as_good_as_those_of_sift(rows):
    ours, sift = rows["corners + least-squares matching"], rows["SIFT + brute force"]
    assert ours["rms_px"] < sift["rms_px"] / 3
    assert sift["cpu_by_sift"] == 1.0
