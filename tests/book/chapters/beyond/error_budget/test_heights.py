"""Over the flying height: angles grow with it, and the two-step calibration fits one height."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.error_budget.examined import BARE, PAPERS
from acx4lib.georeferencing import budget


def test_image_points_grow_with_the_height(flown):
    """Within a percent: the lever arm, 0.2 m, moves the borders of low images on the ground."""
    image = np.sqrt(flown.variance[PAPERS][..., 0])
    assert_allclose(image[-1], 6 * image[0], rtol=1e-2)


def test_the_two_step_calibration_is_good_at_its_own_heights_only(flown):
    share = budget.shares(flown.variance[BARE][:, 1])["calibration"]
    best = flown.height_m[np.argmin(share)]
    assert 900 <= best <= 1500
    assert share[-1] > 10 * share.min()
    assert budget.shares(flown.variance[PAPERS][:, 1])["calibration"].max() < 0.03
