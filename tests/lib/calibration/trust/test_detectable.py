"""Detectable errors by group, and what those that escape do."""

import numpy as np
import pytest

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.gross_errors.rejections import noncentrality
from acx4lib.bundle.uses import mounted_orientation
from acx4lib.calibration.trust.detectable import detectable
from support import blocks

FREE = ("f", "xp", "yp")


@pytest.fixture(scope="module")
def bundle():
    return adjust(mounted_orientation(blocks.standard(), free=FREE))


def test_every_component_of_every_group_is_there(bundle):
    found = [(one.kind, one.component) for one in detectable(bundle)]
    sizes = {"image_point": 2, "control_point": 3, "gnss": 3, "attitude": 3}
    assert found == [(kind, d) for kind, n in sizes.items() for d in range(n)]


def test_the_redundancy_numbers_add_up_and_the_errors_follow_from_them(bundle):
    found = detectable(bundle)
    total = sum(one.redundancy.sum() for one in found)
    assert total == pytest.approx(bundle.solution.redundancy)
    gnss = bundle.network.observed.sigma_position
    for one in (one for one in found if one.kind == "gnss"):
        expected = noncentrality() * gnss[:, one.component] / np.sqrt(one.redundancy)
        np.testing.assert_allclose(one.bias, expected)


def test_an_error_that_just_escapes_moves_the_parameter_by_what_is_said(bundle):
    one = next(one for one in detectable(bundle) if (one.kind, one.component) == ("gnss", 2))
    assert one.on.split("/")[1] in (*FREE, "lever_x", "lever_y", "lever_z", *BORESIGHT)
    # no effect on a parameter is above delta_0 sqrt((1 - r) / r), that on the worst function
    r = one.redundancy.min()
    assert 0 < one.effect <= noncentrality() * np.sqrt((1 - r) / r)


BORESIGHT = ("boresight_x", "boresight_y", "boresight_z")


def test_without_parameters_nothing_is_moved():
    held = adjust(mounted_orientation(blocks.standard(), free=(), free_mount=()))
    assert all(np.isnan(one.effect) and one.on == "" for one in detectable(held))
