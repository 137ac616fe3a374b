"""What a simulated flight knows of its heads."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.beyond.rig import truth
from acx4sim.optics import head_truth


def test_the_truth_is_that_of_the_simulation(flight, stage):
    true = truth.true_heads(flight, stage.block.cameras)
    known = head_truth.HEADS["CAM2"]
    assert true[1].interior.f == known.f_mm
    assert tuple(true[1].T_b_c.r) == known.lever_m
    exact = truth.true_orientation(flight, stage.rig)
    assert np.degrees(exact.opk[1]) == pytest.approx(known.boresight_deg)


def test_estimates_lie_within_four_standard_deviations_of_the_truth(flight, stage):
    off = truth.off_truth(flight, stage.rig)
    assert len(off) == 48
    assert off.max() < 4


def test_a_flight_that_was_not_simulated_has_no_truth(flight, stage, tmp_path):
    measured = replace(flight, pictures=tmp_path)
    assert truth.true_heads(measured, stage.block.cameras) == ()
    assert truth.true_orientation(measured, stage.rig) is None
    assert len(truth.off_truth(measured, stage.rig).groupby("parameter").max()) == 0
