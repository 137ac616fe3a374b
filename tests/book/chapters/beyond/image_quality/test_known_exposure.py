"""A synthetic image whose every pixel is known: geometry, pixels and self-calibration agree.

The simulator shares no code with what is tested here: neither lens nor rotations nor rendering.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.image_quality import examined as images
from acx4book.chapters.beyond.image_quality import known_exposure
from acx4book.chapters.beyond.image_quality.deviations import residuals_px
from acx4book.chapters.beyond.image_quality.examined import (
    border_distortion_of_targets,
    drawn_calibration,
    drawn_errors,
    errors_of,
    examine,
    frame_deviations,
    measured_ties,
)
from acx4book.chapters.beyond.image_quality.seams import overlap_picture, seam_profile
from acx4book.chapters.beyond.image_quality.wrong_heads import every_refinement
from acx4book.paper import printed
from support.pictures.known import known
from support.pictures.known import response as response_of

REDUCE = 16

MATCHING_PX = 0.012
"""RMS of a coordinate in pictures of waves, px of the picture: rounding, noise, interpolation."""


@pytest.fixture(scope="module")
def exposure():
    return known(REDUCE)


@pytest.fixture(scope="module")
def response(exposure):
    return response_of(exposure)


@pytest.fixture(scope="module")
def wrong(exposure):
    return drawn_calibration(exposure.orientation, seed=1, angle_deg=0.01)


@pytest.fixture(scope="module")
def true_image(exposure, response):
    return examine(exposure, exposure.orientation, response)


@pytest.fixture(scope="module")
def wrong_image(exposure, response, wrong):
    return examine(exposure, wrong, response)


def not_geometry(one):
    return one.found.d_px - one.geometry_px


# --- pixels ----------------------------------------------------------------------------------


def test_points_of_the_rendered_image_are_where_geometry_puts_them(exposure, true_image):
    """To a hundredth of a pixel of the picture each, and to a thousandth on average."""
    left = not_geometry(true_image)
    assert len(left) > 400
    assert images.rms_of_coordinates(left) < MATCHING_PX * REDUCE
    # the mean of n points is known to 1/sqrt(n) of that; four sigma
    assert np.abs(left.mean(axis=0)).max() < 4 * MATCHING_PX * REDUCE / np.sqrt(len(left))


def test_no_head_stands_aside_of_the_others(exposure, true_image):
    xy = known_exposure.xy_from_colrow(exposure.synthetic, true_image.found.ideal)
    left = not_geometry(true_image)
    for right in (False, True):
        for upper in (False, True):
            own = ((xy[:, 0] > 0) == right) & ((xy[:, 1] > 0) == upper)
            noise = MATCHING_PX * REDUCE / np.sqrt(own.sum())
            assert np.abs(left[own].mean(axis=0)).max() < 4 * noise


def test_errors_of_a_calibration_are_measured_as_large_as_they_are(wrong_image):
    found, geometry = wrong_image.found.d_px, wrong_image.geometry_px
    assert np.hypot(*geometry.T).max() > 3
    slope = np.sum(found * geometry) / np.sum(geometry**2)
    noise = MATCHING_PX * REDUCE / np.sqrt(np.sum(geometry**2))
    assert abs(slope - 1) < 4 * noise + 0.002  # correlation over steps between heads
    # windows that lie across a seam of wrong heads see both
    assert images.rms_of_coordinates(not_geometry(wrong_image)) < 1.5 * MATCHING_PX * REDUCE


def test_the_parallax_of_the_true_heads_is_that_of_their_bases_over_the_relief(exposure):
    """f B dh / (H (H - dh)), of a lens 8 cm aside in both directions."""
    places = known_exposure.nodes(exposure.synthetic, 30)[1:-1]
    shift = np.hypot(*known_exposure.predicted(exposure, exposure.orientation, places).T)
    dh = known_exposure.seen_ground(exposure, places)[:, 2] - (
        exposure.at.track.x_g[0, 2] - exposure.height_m
    )
    H, f_px = exposure.height_m, 74.0 / 0.0056
    largest = f_px * 0.08 * np.sqrt(2) * np.abs(dh) / (H * (H - dh))
    # heads are blended, and a tilt of 2 degrees changes depths at the border by some metres
    tilt_m = np.radians(2) * np.hypot(6000, 8100) / f_px * H
    assert np.all(shift < largest + f_px * 0.08 * np.sqrt(2) * tilt_m / H**2)
    assert shift.max() > 0.5 * largest.max()


def test_self_calibration_of_a_right_image_finds_no_lens(true_image):
    fit = true_image.fits["calibrated"]
    assert images.largest_radial(fit) < 0.5  # 475 points of 0.13 px
    before, after = (residuals_px(true_image.fits[step]) for step in ("oriented", "calibrated"))
    # five parameters of a thousand observations
    assert_allclose(images.rms_of_coordinates(after), images.rms_of_coordinates(before), rtol=0.02)


def test_tie_points_of_the_pictures_repair_a_calibration(exposure, wrong):
    ties = measured_ties(exposure, wrong)
    every = {
        "true": exposure.orientation,
        **every_refinement(wrong, ties),
    }
    found = {
        name: errors_of(frame_deviations(one, exposure), exposure) for name, one in every.items()
    }
    assert found["true"]["largest_px"] < 1e-9
    assert found["rotations"]["oriented_px"] < 0.2 * found["before"]["oriented_px"]
    assert found["rotations"]["oriented_px"] < found["mean shift"]["oriented_px"]
    assert_allclose(every["mean shift"].xyz_mm[0], wrong.xyz_mm[0])
    assert_allclose(every["rotations"].xyz_mm, wrong.xyz_mm)


def test_the_blend_joins_two_heads_without_a_step(exposure, response):
    profile = seam_profile(exposure, exposure.orientation, response)
    apart = [np.log(lines[1] / lines[0]) for lines in (profile.taken, profile.equalised)]
    assert np.sqrt(np.nanmean(apart[0] ** 2)) > 0.02
    # what noise of 0.5 sqrt(DN) and interpolation leave in means over eight rows
    assert np.sqrt(np.nanmean(apart[1] ** 2)) < 0.01
    assert_allclose(profile.blended / profile.equalised.mean(axis=0), 1, atol=0.02)
    assert profile.names == ("CAM1", "CAM4")


def test_refined_heads_agree_in_their_overlap(exposure, response, wrong):
    pair = (wrong, exposure.orientation)
    picture = overlap_picture(exposure, pair, response, size_px=(60, 80))
    rms = [np.sqrt(np.nanmean(d**2)) for d in picture.differences.values()]
    assert list(picture.differences) == ["as taken", "equalised", "equalised and refined"]
    assert rms[0] > rms[1] > rms[2]
    assert rms[2] < 0.02


# --- geometry --------------------------------------------------------------------------------


def test_heads_that_are_shifted_shift_the_image_and_an_orientation_takes_it_up(exposure):
    xyz = exposure.orientation.xyz_mm + np.array([0.0056, 0.0112, 0.0])
    shifted = replace(exposure.orientation, xyz_mm=xyz)
    off = frame_deviations(shifted, exposure)
    # x goes right as columns do, y goes up and rows go down
    assert_allclose(off.d_px, np.tile([1.0, -2.0], (len(off), 1)), atol=1e-9)
    found = errors_of(off, exposure)
    assert_allclose(found["rms_px"], np.sqrt(5 / 2), rtol=1e-9)
    assert found["oriented_px"] < 0.05  # a motion of the camera moves hills otherwise than plains


def test_drawn_errors_have_the_size_of_table_1s_sigma(exposure):
    """Of 240 normal numbers a standard deviation is known to a twentieth."""
    true, draws = exposure.orientation, range(15)
    drawn = [drawn_calibration(true, seed=i, angle_deg=0.01) for i in draws]
    normalised = [
        (getattr(head.interior, name) - getattr(right.interior, name))
        / printed.sigma(1, key, head.name)
        for one in drawn
        for head, right in zip(one.heads, true.heads, strict=True)
        for name, key in (("xp", "xp_mm"), ("yp", "yp_mm"), ("k1", "k1"), ("p2", "p2"))
    ]
    assert_allclose(np.mean(normalised), 0, atol=0.25)
    assert_allclose(np.std(normalised), 1, atol=0.2)
    turns = np.degrees([one.opk - true.opk for one in drawn])
    assert_allclose(turns[:, 0], 0, atol=1e-12)
    assert_allclose(np.std(turns[:, 1:]), 0.01, rtol=0.25)
    assert all(
        head.interior.f == right.interior.f
        for one in drawn
        for head, right in zip(one.heads, true.heads, strict=True)
    )


def test_a_lens_takes_up_what_an_orientation_does_not(exposure):
    draws = drawn_errors(exposure, 4, seed=3, angle_deg=0.01)
    assert set(draws["refinement"]) == {"before", "mean shift", "rotations", "six"}
    assert np.all(draws["oriented_px"] <= draws["rms_px"])
    assert np.all(draws["calibrated_px"] <= draws["oriented_px"])
    assert np.all(draws["interior_px"] <= draws["calibrated_px"])
    left = draws.groupby("refinement")["oriented_px"].median()
    assert left["rotations"] < left["mean shift"] / 2 < left["before"]


def test_measuring_errors_of_targets_invent_distortion_in_proportion(exposure):
    fine, coarse = (
        border_distortion_of_targets(exposure, 8, sigma_px=s, seed=5) for s in (0.05, 0.5)
    )
    assert fine.n_targets == coarse.n_targets > 10
    # so far as the adjustment is linear
    assert_allclose(coarse.radial_px, 10 * fine.radial_px, rtol=0.02)
