"""The closed form of the lever arm's height, against the adjustment of exact data."""

import numpy as np
import pytest

from acx4book.chapters.beyond.synthetic_cost import lever_arm, study
from acx4book.paper import printed


def test_it_is_the_least_squares_factor_over_the_frame():
    size, f, side = np.array([60.0, 80.0]), 70.0, 0.2
    axes = [(np.arange(n) + 0.5) / n - 0.5 for n in (200, 300)]
    t = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) * size / f
    d = np.sign(t) * side / 2
    expected = np.linalg.lstsq(t.reshape(-1, 1), d.ravel(), rcond=None)[0][0]
    assert lever_arm.apparent_rise_m(side, f, size) == pytest.approx(expected, rel=1e-4)


def test_it_explains_the_exact_lever_arm_but_for_an_eighth():
    z = study.read().squares.query("parameter == 'lever_z_m'").set_index("side_m")["value"]
    size = np.ptp(printed.corners("SYN"), axis=0)
    rise = lever_arm.apparent_rise_m(0.16, 74.44, size)
    # the points do not fill the frame evenly, and GNSS positions have a say
    assert z.loc[0.16] - z.loc[0] == pytest.approx(rise, rel=0.15)
    assert z.loc[0.08] - z.loc[0] == pytest.approx((z.loc[0.16] - z.loc[0]) / 2, abs=0.001)
    assert z.loc[0] == pytest.approx(lever_arm.true_centre_m()[2], abs=0.01)
