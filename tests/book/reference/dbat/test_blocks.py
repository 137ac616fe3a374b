"""Half of the photographs of `camcal` against the other half, as two campaigns.

The camera was held level or turned by a quarter, in turns, and its lens gives way: eight of the
images of either kind have another principal point. Comparing finds it, and finds nothing in the
same images with errors of measurement alone.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from acx4book.reference.dbat import blocks
from acx4lib.bundle import adjust, uses
from acx4lib.calibration.estimates import from_bundle
from acx4lib.flight.block import select_images
from acx4lib.geometry.collinearity import project
from acx4lib.results.campaigns import comparison
from acx4lib.results.campaigns.campaign import Campaign
from support.reference_files import needs

pytestmark = needs("dbat-camcal")

LEVEL, TURNED = np.arange(0, 16, 2), np.arange(1, 16, 2)
"""Images around the sheet, by the way in which the camera was held."""


@pytest.fixture(scope="module")
def adjusted():
    return blocks.camcal().bundle


@pytest.fixture(scope="module")
def block(adjusted):
    return adjusted.network.block


def campaign(block, images):
    part = select_images(block, np.isin(np.arange(len(block.images)), images))
    network = replace(uses.free_orientation(part, free=blocks.FREE), distortion_at="measured")
    bundle = adjust.adjust(network)
    return Campaign(
        name=part.images.names[0],
        method="single_step",
        calibration=from_bundle(bundle),
        redundancy=bundle.solution.redundancy,
        height_m=1.5,
    )


def found(block, first, second):
    """Return the comparison of two groups of images, and their difference."""
    both = comparison.compare([campaign(block, first), campaign(block, second)])
    return both, comparison.difference(both, 0, 1)


def test_a_camera_that_is_held_otherwise_has_another_principal_point(block):
    both, difference = found(block, LEVEL, TURNED)
    assert difference.test().p < 1e-12
    t = dict(zip(both.names, difference.d / difference.sigma, strict=True))
    moved = {name for name, value in t.items() if abs(value) > 6}
    assert {name.split("/")[1] for name in moved} == {"xp_mm", "yp_mm"}


def test_images_that_were_held_alike_differ_far_less(block):
    _, held = found(block, LEVEL, TURNED)
    per_dof = held.test().chi_square / held.test().dof
    for kind in (LEVEL, TURNED):
        _, alike = found(block, kind[::2], kind[1::2])
        assert alike.test().chi_square / alike.test().dof < 0.1 * per_dof


def test_errors_of_measurement_alone_are_no_change(adjusted, block):
    """The same halves, with image points where one camera would show them: bounds of 99 %."""
    points, (camera,) = block.image_points, adjusted.cameras
    exact = project(camera, adjusted.T_m_c[points.image_idx], adjusted.state.x_m[points.point_idx])
    chi_square = dof = 0.0
    for seed in range(6):
        noise = np.random.default_rng(seed).normal(size=exact.shape) * points.sigma_px[:, None]
        same = replace(block, image_points=replace(points, colrow=exact + noise))
        test = found(same, LEVEL, TURNED)[1].test()
        chi_square, dof = chi_square + test.chi_square, dof + test.dof
    assert 0.005 < stats.chi2.cdf(chi_square, dof) < 0.995
