"""Tables and figures on the quality of the synthetic image have what was found."""

import re
from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.image_quality import tables
from acx4book.chapters.image_quality.deviations import every_refinement, repaired
from acx4book.chapters.image_quality.examined import (
    border_distortion_of_targets,
    drawn_calibration,
    drawn_errors,
    examine_all,
    geometry_errors,
    measured_ties,
    rms_of_coordinates,
)
from acx4book.chapters.image_quality.figures import (
    deviation_fields,
    distortion_taken_up,
    overlap_differences,
    overlap_picture,
    seam_profile,
    seam_profiles,
)
from acx4lib.geometry.camera import Camera, Interior, xy_from_colrow
from support.figures import drawn, quivers
from support.pictures.known import known
from support.pictures.known import response as response_of

WAYS = ["true", "before", "mean shift", "rotations", "six"]


@pytest.fixture(scope="module")
def exposure():
    return known(16)


@pytest.fixture(scope="module")
def response(exposure):
    return response_of(exposure)


@pytest.fixture(scope="module")
def heads(exposure):
    wrong = drawn_calibration(exposure.orientation, seed=1, angle_deg=0.01)
    ties = measured_ties(exposure, wrong)
    return {
        "true": exposure.orientation,
        **every_refinement(wrong, ties),
    }


@pytest.fixture(scope="module")
def examined(exposure, response, heads):
    return examine_all(exposure, heads, response)


@pytest.fixture(scope="module")
def draws(exposure):
    return drawn_errors(exposure, 3, seed=1, angle_deg=0.01)


@pytest.fixture(scope="module")
def targets(exposure):
    return border_distortion_of_targets(exposure, 20, sigma_px=0.5, seed=1)


# --- tables and sentences --------------------------------------------------------------------


def test_the_parts_of_the_frame_are_counted(exposure, examined):
    table = tables.zone_table(exposure, examined["true"])
    whole = table.loc["whole frame", "Points"]
    assert whole == len(examined["true"].found)
    assert table.loc["one head", "Points"] + table.loc["several heads", "Points"] == whole
    full, small = (table.loc["one head", f"RMS ({u})"] for u in ("px", "px of the picture"))
    assert full / small == pytest.approx(16)


def test_the_ways_are_tabled_with_pixels_beside_geometry(exposure, examined):
    geometry = geometry_errors(exposure, examined)
    table = tables.way_table(examined, geometry)
    assert list(table.index) == [tables.NAMES[name] for name in WAYS]
    for column, least in (("RMS (px)", 0.5), ("Radial (px)", 1.0)):
        pixels, exact = table.loc["as calibrated", column]
        assert exact > least
        assert pixels == pytest.approx(exact, rel=0.1)


def test_points_are_where_geometry_puts_them(exposure, examined):
    found = tables.acceptance(exposure, examined["true"])
    assert found["n"] == len(examined["true"].found)
    assert found["means"] < found["left"] / 2
    assert found["degrees"] == 2 * found["parts"]
    assert np.abs(found["mean"]).max() < found["left"] / 3


def test_measured_deviations_follow_those_of_geometry(examined):
    found = tables.agreement(examined)
    assert found["slope"] == pytest.approx(1, abs=0.02)
    assert found["far"] > 1
    assert found["worst"] < 2 * found["of_true"]


def test_a_perfect_image_has_no_lens(examined):
    found = tables.self_calibration(examined["true"])
    assert found["t"] < 4
    assert found["calibrated"] == pytest.approx(found["oriented"], rel=0.05)
    assert abs(found["f"] - found["held"]) < 10 * found["sigma"]


def test_the_draws_are_tabled_by_refinement(draws):
    table = tables.draw_table(draws, {"oriented_px": "Oriented (px)"})
    assert list(table.index) == [tables.NAMES[name] for name in WAYS[1:]]
    own = draws.loc[draws["refinement"] == "rotations", "oriented_px"]
    both = table.loc["three rotations", "Oriented (px)"]
    assert both["median"] == own.median()
    assert own.median() <= both["95 %"] <= own.max()


# --- figures ---------------------------------------------------------------------------------


def test_the_fields_have_one_scale(exposure, examined):
    fields = tables.self_calibration_fields(examined)
    assert len(fields) == 6
    fig = drawn(deviation_fields(fields, exposure.synthetic, exposure.orientation))
    keys = {text.get_text() for ax in fig.axes for text in ax.texts if "px" in text.get_text()}
    keys = {key for key in keys if re.fullmatch(r"[\d.]+ px", key)}
    assert len(keys) == 1
    longest = [np.hypot(q.U, q.V).max() for ax in fig.axes for q in quivers(ax)]
    assert longest[0] > 2 * longest[4]  # turned heads leave little


def test_the_fields_of_the_true_heads_are_measured_geometry_and_rest(examined):
    measured, geometry, left = tables.acceptance_fields(examined["true"]).values()
    np.testing.assert_allclose(measured.d_px, geometry.d_px + left.d_px, atol=1e-12)
    assert rms_of_coordinates(geometry.d_px) < rms_of_coordinates(left.d_px)


def test_seams_and_overlaps_are_drawn(exposure, response, heads):
    profile = seam_profile(exposure, heads["rotations"], response)
    fig = drawn(seam_profiles(profile))
    assert [len(ax.lines) for ax in fig.axes] == [3, 3, 3]
    pair = heads["before"], heads["rotations"]
    picture = overlap_picture(exposure, pair, response, size_px=(60, 80))
    fig = drawn(overlap_differences(picture))
    assert [len(ax.images) for ax in fig.axes[:4]] == [1, 1, 1, 1]


def test_the_papers_two_pixels_are_drawn_beside_the_distortion(examined, draws, targets):
    fits = tables.lens_fits(examined)
    assert list(fits) == [name for name in WAYS if name != "before"]
    fig = drawn(distortion_taken_up(fits, tables.NAMES, draws, targets))
    left, right = fig.axes
    diamonds = [line.get_ydata()[0] for line in left.lines if line.get_marker() == "D"]
    assert sorted(diamonds) == [-2, 2]
    assert len(right.get_yticks()) == 4


@pytest.mark.slow
def test_turned_heads_are_repaired_by_rotations_and_not_by_shifts(exposure):
    """With 0.01 degrees: 0.01 px in the overlaps, 0.02 px in the frame; a shift leaves 3 px."""
    found = repaired(exposure.orientation, exposure.synthetic, seed=1, trials=1)
    table = tables.repaired(found)
    turned = table.xs("heads turned by 0.01°")
    rotations, shift = (turned.loc[tables.NAMES[way]] for way in ("rotations", "mean shift"))
    assert rotations["Overlaps, RMS (px)"] < 0.01
    assert rotations["at most in the frame (px)"] < 0.02
    assert shift["at most in the frame (px)"] > 1.0


# --- What one camera takes up of the pattern of the synthetic image


CAMERA = Camera(
    name="SYN", width_px=10000, height_px=15200, pixel_mm=0.006, interior=Interior(f=73.8)
)


@pytest.fixture(scope="module")
def pattern():
    return tables.pattern(CAMERA)


def models(pattern):
    radial = tables.effects(pattern, tables.RADIAL)
    waves = tables.waves(pattern)
    brown = tables.effects(pattern, tables.BROWN)
    return brown, np.concatenate([radial, waves], axis=2)


def rms(d):
    return np.sqrt(np.mean(d**2))


def test_what_a_camera_can_do_is_taken_up(pattern):
    """A longer lens, and a lever arm 10 cm off along x, at both heights."""
    xy = xy_from_colrow(CAMERA, pattern.colrow)
    lever = 0.1 * CAMERA.interior.f / pattern.height_m / CAMERA.pixel_mm
    d = 1e-4 * xy / CAMERA.pixel_mm * [1, -1] + np.stack([lever, 0 * lever], axis=1)
    assert rms(d) > 0.1
    for A in models(pattern):
        assert rms(tables.left(d, A)) < 1e-9


def test_a_wave_is_taken_up_by_waves_alone(pattern):
    """One pixel to the right on the left and right borders, one to the left in the middle."""
    u = 2 * np.pi * (pattern.colrow[:, 0] / CAMERA.width_px - 0.5)
    d = np.stack([-np.cos(u), 0 * u], axis=1)
    brown, fourier = (rms(tables.left(d, A)) for A in models(pattern))
    assert fourier < 1e-9
    assert brown > 0.1


def test_smooth_models_leave_most_of_the_seams_and_four_cameras_nearly_nothing(pattern):
    low = pattern.height_m == pattern.height_m.min()
    before = rms(pattern.d_px[low])
    brown, fourier = models(pattern)
    for A in (brown, fourier):
        assert 0.7 * before < rms(tables.left(pattern.d_px, A)[low]) <= before
    assert rms(tables.left_by_heads(pattern, brown)[low]) < 0.1 * before


def test_the_table_has_a_row_for_each_fit_and_a_column_for_each_height(pattern):
    fields = {"nothing": pattern.d_px, "all": 0 * pattern.d_px}
    table = tables.left_table(pattern, fields)
    assert [*table.columns] == ["From 1000 m (px)", "From 1500 m (px)"]
    np.testing.assert_allclose(
        table.loc["nothing"].iloc[0], rms(pattern.d_px[pattern.height_m == 1000])
    )
    assert not table.loc["all"].any()


def test_arrows_are_drawn_at_the_lower_height_in_the_colours_of_the_heads(pattern):
    other = replace(pattern, d_px=2 * pattern.d_px)
    fig = tables.left_figure(pattern, {"a": pattern.d_px, "b": other.d_px})
    one, two = (ax.collections[0] for ax in fig.axes)
    np.testing.assert_allclose(np.array(two.U), 2 * np.array(one.U))
    assert len(np.unique(one.get_facecolor(), axis=0)) == 4
