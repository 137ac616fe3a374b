"""What a simulated flight knows of its heads."""

import numpy as np
import pytest

from acx4book.chapters.rig import truth


def test_the_truth_is_that_of_the_simulation(flight, stage):
    true = truth.true_heads(flight, stage)
    assert true[1].interior.f == 73.863353  # the simulator's constants
    assert list(true[1].T_b_c.r) == [0.143, -0.319, -0.201]
    assert np.degrees(true[1].T_b_c.opk) == pytest.approx([14.782598, 12.163894, -93.408507])
    exact = truth.true_orientation(flight, stage)
    assert np.degrees(exact.opk[1]) == pytest.approx([14.782598, 12.163894, -93.408507])
