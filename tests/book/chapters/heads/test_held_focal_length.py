"""Heads with wrong focal lengths: what must show, and what must not."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.heads.held_focal_length import asked_by_gnss
from acx4book.chapters.heads.held_focal_length import hold as hold_heads
from acx4lib.calibration.heads import Heads
from acx4lib.stages.heads import HeadsStage
from support.flights.simulated import HEADS


def hold(flown, fits, orientation, *change_mm):
    stage = HeadsStage(heads=Heads(bundles=fits, failures={}), orientation=orientation)
    return hold_heads(flown.flight, stage, np.array(change_mm))


def test_an_unchanged_focal_length_gives_the_same_heads(held, fits, orientation):
    for name, fit in held[1].bundles.items():
        found, sound = (f.cameras[0].interior.to_array() for f in (fit, fits[name]))
        assert_allclose(found, sound, rtol=1e-6, atol=1e-8)
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
