"""What the two-step interior orientation took up, as chapter 3 shows it."""

import numpy as np
import pytest

from acx4book.chapters.mounting import absorbed
from acx4lib.calibration import mounting


@pytest.fixture(scope="module")
def seen(mountings):
    return absorbed.lever_arm_seen(mountings)


def test_least_squares_reads_the_lever_arm_that_the_mean_height_misses(seen):
    assert [*seen["parameter"]] == ["xp", "yp", "f"]
    off = np.abs(seen["lever_seen_m"] - seen["lever_estimated_m"])
    at_mean = np.abs(seen["at_mean_height_m"] - seen["lever_estimated_m"])
    assert np.all(off < 4 * seen["sigma_difference_m"])
    assert np.all(off < 0.002)
    assert np.all(at_mean > 0.01)
    assert np.all(np.abs(seen["shift_mm"] - seen["expected_mm"]) < 1e-4)


def test_methods_that_share_their_data_are_not_two_opinions(seen):
    """The sigma of their difference is a fortieth of what either has."""
    assert np.all(seen["sigma_difference_m"] < seen["sigma_estimated_m"] / 20)


def test_effective_heights_lie_above_the_mean_height(seen):
    """They were 1411, 1362 and 1286 m for z, x, y where Table 3's lever arm is read as printed."""
    assert np.all(seen["height_m"] > 1250)
    assert np.all(seen["height_m"] < 1500)


def test_the_table_and_the_sentence_say_so(mountings, seen):
    table = absorbed.table(seen)
    assert set(absorbed.FORMATS) <= set(table.columns)
    assert len(table) == 3
    sentence = absorbed.sentence(mountings, seen)
    assert "with 3 degrees of freedom" in sentence


def test_a_missing_method_leaves_nothing_to_compare(mountings):
    alone = mounting.Mountings(methods={"single_step": mountings["single_step"]}, failures={})
    seen = absorbed.lever_arm_seen(alone)
    assert seen.empty
    assert absorbed.table(seen).empty
    assert absorbed.sentence(alone, seen) == absorbed.NOTHING
