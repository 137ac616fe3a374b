"""Heads and synthetic image spoilt on purpose: what must show, and what must not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.heads.held_focal_length import asked_by_gnss
from acx4book.chapters.heads.held_focal_length import hold as hold_heads
from acx4book.chapters.synthetic_image.wrong_heads import transposed
from acx4lib.calibration import correlations, lens
from acx4lib.calibration.heads import Heads, calibrate_heads, relative_orientation
from acx4lib.flight import design
from acx4lib.geometry.camera import Interior
from acx4lib.stages.heads import HeadsStage
from acx4lib.synthetic_image.frame import coverage
from acx4lib.tie_points import ties as tie_points
from flights_simulated import HEADS, fly


@pytest.fixture(scope="module")
def flown():
    return fly("acx4", seed=1, blocks=("heads",))


@pytest.fixture(scope="module")
def synthetic(flown):
    return flown.flight.cameras["SYN"]


@pytest.fixture(scope="module")
def fits(flown):
    free = flown.flight.estimate_heads
    return calibrate_heads(flown.flight.heads, HEADS, free=free).bundles


@pytest.fixture(scope="module")
def orientation(fits, synthetic):
    return relative_orientation(fits, synthetic)


@pytest.fixture(scope="module")
def ties(flown, orientation):
    return tie_points.shared_points(flown.flight.heads, orientation)


def hold(flown, fits, orientation, *change_mm):
    stage = HeadsStage(heads=Heads(bundles=fits, failures={}), orientation=orientation)
    return hold_heads(flown.flight, stage, np.array(change_mm))


@pytest.fixture(scope="module")
def held(flown, fits, orientation):
    return [hold(flown, fits, orientation, *[c] * 4) for c in (-0.5, 0.0, 0.5)]


# --- a wrong focal length --------------------------------------------------------------------


def test_an_unchanged_focal_length_gives_the_same_heads(held, fits, orientation):
    for name, fit in held[1].bundles.items():
        assert_allclose(
            fit.cameras[0].interior.to_array(), fits[name].cameras[0].interior.to_array(), rtol=1e-6
        )
    assert_allclose(held[1].orientation.xyz_mm, orientation.xyz_mm, atol=1e-6)


def test_the_focal_length_is_held_where_it_is_told(held):
    assert [h.bundles["CAM3"].cameras[0].interior.f for h in held] == [73.5, 74.0, 74.5]


def test_the_fit_hardly_minds_a_wrong_focal_length(held):
    """Two flying heights do not determine f beside free exterior orientation: sigma 0.06 mm."""
    variances = [h.sigma0_sq for h in held]
    assert max(variances) < 1.05 * min(variances)
    assert max(h.control_rms_m for h in held) < 0.005  # the control points' sigma is 1 and 2 cm


def test_the_cameras_rise_in_proportion_to_the_focal_length(held):
    rise = held[2].above_gnss_m["CAM2"] - held[0].above_gnss_m["CAM2"]
    mean_height = (10 * 2600 + 21 * 1600) / 31
    assert_allclose(rise, mean_height / 74.0, rtol=0.02)


def test_gnss_heights_ask_for_the_true_focal_lengths(held, flown):
    """0.2 m of lever arm are 0.008 mm; the propagated sigma of such an f is about 0.005 mm."""
    asked = asked_by_gnss(held)
    truth = {name: flown.truth["cameras"][name]["f_mm"] for name in HEADS}
    assert_allclose([asked[n] for n in HEADS], [truth[n] for n in HEADS], atol=0.025)


def test_one_wrong_head_shows_in_its_own_height_over_the_synthetic_image(flown, fits, orientation):
    one = hold(flown, fits, orientation, 0.0, 0.0, 0.5, 0.0)
    moved = one.orientation.xyz_mm[:, 2] - orientation.xyz_mm[:, 2]
    assert_allclose(moved, [0, 0, 0.5, 0], atol=0.02)


def test_all_heads_wrong_by_the_same_leave_their_differences(held, orientation):
    differences = [np.diff(h.orientation.xyz_mm[:, 2]) for h in held]
    assert_allclose(differences[0], differences[2], atol=0.02)


def test_a_head_that_cannot_be_adjusted_is_missing(flown, fits, orientation):
    fit = fits["CAM1"]
    block = fit.network.block
    empty = replace(block, image_points=block.image_points[:5])
    spoilt = {**fits, "CAM1": replace(fit, network=replace(fit.network, block=empty))}
    found = hold(flown, spoilt, orientation, 0.0, 0.0, 0.0, 0.0)
    assert set(found.bundles) == {"CAM2", "CAM3", "CAM4"}
    assert found.orientation is None


# --- a wrong reading, a wrong angle ----------------------------------------------------------


def test_transposed_rotations_leave_47_per_cent_uncovered(orientation, synthetic):
    """The share of the geometry of Table 1 read the other way round."""
    assert coverage(orientation, synthetic).share[0] == 0.0
    assert coverage(transposed(orientation), synthetic).share[0] == pytest.approx(0.47, abs=0.01)


def test_transposing_twice_changes_nothing(orientation):
    assert_allclose(transposed(transposed(orientation)).opk, orientation.opk, atol=1e-12)


# --- design, distortion, correlations --------------------------------------------------------


def test_the_papers_design_is_read_from_the_trajectory(flown):
    """Section 3.2: 2600 m with 10, 1600 m with three times 7 images, overlaps of 80 and 50 %."""
    high, low = design.levels(flown.flight.heads)
    assert_allclose([high.height_m, low.height_m], [2600, 1600], rtol=0.01)
    assert [len(high.strips), len(low.strips)] == [1, 3]
    assert [high.images_per_strip, low.images_per_strip] == [10, 7]
    assert_allclose([high.forward_overlap, low.forward_overlap], 0.8, atol=0.03)
    assert low.side_overlap == pytest.approx(0.5, abs=0.05)
    assert np.isnan(high.side_overlap)
    assert (high.n_directions, low.n_directions) == (1, 1)
    assert low.gsd_m == pytest.approx(0.13, abs=0.002)


def test_coincident_strips_overlap_wholly_and_are_flown_both_ways():
    high, low = design.levels(fly("acx4", seed=1).flight.calibration)
    assert high.side_overlap == pytest.approx(1.0, abs=0.02)
    assert (high.n_directions, low.n_directions) == (2, 2)


def test_a_block_without_surveyed_points_has_no_known_ground(flown):
    block = flown.flight.heads
    bare = replace(block, control=block.control[:0], check=block.check[:0])
    assert np.isnan(design.ground_height(bare))
    assert all(np.isnan(level.height_m) for level in design.levels(bare))
    assert np.isnan(design.footprints(bare)).all()


def test_footprints_lie_on_the_ground_around_the_exposure(flown):
    block = flown.flight.heads
    corners = design.footprints(block)
    assert_allclose(corners[..., 2], design.ground_height(block))
    at = block.T_m_b_images.r[:, None, :2]
    reach = np.linalg.norm(corners[..., :2] - at, axis=-1)
    assert reach.max() < 2600 * np.tan(np.radians(55))


def test_border_distortion_is_the_papers_15_pixels(fits):
    r, px, sigma = lens.radial_profile(fits["CAM1"])
    assert r[-1] == pytest.approx(np.hypot(8984, 6732) / 2 * 0.006)
    assert px[-1] == pytest.approx(15.0, abs=1.0)  # "approximately 15 pixels"
    assert 0 < sigma[-1] < 0.3


def test_the_worst_corner_has_the_decentring_too(fits):
    camera = fits["CAM1"].cameras[0]
    radial = replace(camera, interior=Interior(f=74.0, k1=2.27e-6))
    assert lens.largest_at_corners(radial) == pytest.approx(14.45, abs=0.01)
    assert lens.largest_at_corners(camera) == pytest.approx(18.3, abs=0.5)


def test_correlations_are_those_of_the_covariance(fits):
    """East, north, height turned back to the mapping frame's axes must give the raw ones."""
    fit = fits["CAM2"]
    found = correlations.interior_exterior(fit)
    assert found.interior == ("xp_mm", "yp_mm", "k1", "p1", "p2")
    assert found.values.shape == (31, 5, 6)
    assert np.abs(found.values).max() <= 1.0
    network = fit.network
    pose, interior = network.layout.pose[4], network.layout.interior[0]
    cov = fit.solution.cov
    # the share of an interior parameter's variance that the pose explains has no axes
    for j, column in enumerate(interior[interior >= 0]):
        raw = cov[column, pose] @ np.linalg.solve(cov[np.ix_(pose, pose)], cov[pose, column])
        assert np.all(found.values[4, j] ** 2 <= raw / cov[column, column] + 1e-12)
    sigma_z = np.sqrt(cov[pose[2], pose[2]] * cov[interior[1], interior[1]])
    # 2 km from its origin the mapping frame's z is the grid's height up to 0.02 degrees
    assert found.values[4, 0, 2] == pytest.approx(cov[interior[1], pose[2]] / sigma_z, abs=0.01)


def test_the_largest_pairs_are_named_as_results_name_them(fits):
    found = correlations.interior_exterior(fits["CAM1"])
    pairs = correlations.largest_pairs(found, n=3)
    assert list(pairs.values()) == sorted(pairs.values(), reverse=True)
    assert next(iter(pairs.values())) == np.abs(found.values).max()
    assert all(
        name.split("/")[0] in found.interior and name.split("/")[1] in correlations.EXTERIOR
        for name in pairs
    )
