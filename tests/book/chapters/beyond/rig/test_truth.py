"""What a simulated flight knows of its heads."""

import numpy as np
import pytest

from acx4book.chapters.beyond.rig import truth
from acx4sim.optics import head_truth


def test_the_truth_is_that_of_the_simulation(flight, stage):
    true = truth.true_heads(flight, stage)
    known = head_truth.HEADS["CAM2"]
    assert true[1].interior.f == known.f_mm
    assert tuple(true[1].T_b_c.r) == known.lever_m
    exact = truth.true_orientation(flight, stage)
    assert np.degrees(exact.opk[1]) == pytest.approx(known.boresight_deg)
