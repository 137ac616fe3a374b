"""What was rejected is taken out of a block, and nothing else."""

import numpy as np
import pytest

from acx4lib.bundle.gross_errors.rejections import Rejection, noncentrality, without
from support import blocks


def test_rejected_observations_are_taken_out_of_the_block(exact_block):
    rejected = [
        Rejection(kind="image_point", row=3, component=-1, statistic=9.0),
        Rejection(kind="control_point", row=2, component=1, statistic=9.0),
        Rejection(kind="gnss", row=4, component=-1, statistic=9.0),
        Rejection(kind="attitude", row=5, component=-1, statistic=9.0),
    ]
    cleaned = without(exact_block, rejected)
    for kind, sigma in blocks.observed_sigmas(cleaned).items():
        row = {"image_point": 3, "control_point": 2, "gnss": 4, "attitude": 5}[kind]
        out = np.isinf(sigma)
        assert np.flatnonzero(out.any(axis=1)).tolist() == [row]
        assert out[row].sum() == {"image_point": 2, "control_point": 1}.get(kind, 3)
        assert np.isfinite(blocks.observed_sigmas(exact_block)[kind]).all()  # unharmed


def test_a_rejected_distance_stays_in_the_block_without_a_weight(exact_block):
    block = blocks.taped(exact_block, [[11, 20], [12, 31]], sigma=0.1)
    one = Rejection(kind="distance", row=1, component=-1, statistic=9.0)
    assert without(block, [one]).distances.sigma_m.tolist() == [0.1, np.inf]


def test_a_control_point_without_a_component_goes_as_a_whole(exact_block):
    whole = Rejection(kind="control_point", row=2, component=-1, statistic=9.0)
    out = np.isinf(without(exact_block, [whole]).control.sigma_m)
    assert np.flatnonzero(out.any(axis=1)).tolist() == [2]
    assert out[2].all()


def test_delta_0_of_text_books():
    assert noncentrality(critical=3.29, power=0.8) == pytest.approx(4.13, abs=0.005)  # Baarda
    assert noncentrality() == pytest.approx(3.9 + 0.8416, abs=1e-4)
