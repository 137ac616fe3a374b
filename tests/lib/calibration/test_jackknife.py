"""Sigma that contain what the points of an exposure share."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.calibration import common_errors
from acx4lib.calibration.estimates import from_bundle
from acx4lib.calibration.mounting import single_step
from acx4lib.flight.block import NO_POINTS
from acx4lib.least_squares.covariance import sigmas
from support import blocks

FREE = ("k1", "p1", "p2")


@pytest.fixture(scope="module")
def block():
    return replace(blocks.balanced(), control=NO_POINTS)


def breathing(block):
    """Return the block with a lens whose distortion is another one at every exposure."""
    points, (camera,) = block.image_points, block.cameras
    half = np.array([camera.width_px, camera.height_px]) / 2
    r = (points.colrow - half) / half[0]
    size = 2 * points.sigma_px.mean() * np.random.default_rng(0).normal(size=len(block.trajectory))
    moved = size[block.images.exposure_idx[points.image_idx], None] * r**3
    return replace(block, image_points=replace(points, colrow=points.colrow + moved))


def test_independent_errors_leave_sigma_as_they_are(block):
    found = single_step(block, free=FREE, snooping=False)
    assert found.calibration.enlarged == (1.0, 1.0)
    assert np.array_equal(found.calibration.cov, from_bundle(found.bundle).cov)


def test_errors_that_points_share_enlarge_sigma_of_the_lens_and_no_others(block):
    found = single_step(breathing(block), free=FREE, snooping=False)
    lens, between = found.calibration.enlarged
    assert (lens > 1.5, between) == (True, 1.0)
    ratio = sigmas(found.calibration.cov) / sigmas(from_bundle(found.bundle).cov)
    assert ratio[0] == pytest.approx(lens, rel=0.1)  # k1, which the mounting does not know of
    assert np.allclose(ratio[3:], 1.0)
    assert f"{lens:.1f} (interior orientations):" in common_errors.enlarged_sentence(
        found.calibration
    )
