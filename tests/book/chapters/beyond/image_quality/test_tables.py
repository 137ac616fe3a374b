"""Tables, sentences and figures on the quality of the synthetic image say what was found."""

import re

import numpy as np
import pytest

from acx4book.chapters.beyond.image_quality import sentences, tables
from acx4book.chapters.beyond.image_quality.examined import (
    border_distortion_of_targets,
    drawn_calibration,
    drawn_errors,
    examine_all,
    geometry_errors,
    measured_ties,
    rms_of_coordinates,
)
from acx4book.chapters.beyond.image_quality.figures import (
    deviation_fields,
    distortion_taken_up,
    overlap_differences,
    seam_profiles,
)
from acx4book.chapters.beyond.image_quality.known_exposure import heads_response
from acx4book.chapters.beyond.image_quality.seams import overlap_picture, seam_profile
from acx4book.chapters.beyond.image_quality.wrong_heads import every_refinement, repaired
from acx4book.paper import printed
from support.figures import drawn, quivers
from support.pictures.known import known

WAYS = ["true", "before", "mean shift", "rotations", "six"]


@pytest.fixture(scope="module")
def exposure():
    return known(16)


@pytest.fixture(scope="module")
def response(exposure):
    return heads_response(exposure)


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
    table = tables.zone_table(exposure, examined["true"]).set_index("Part")
    whole = table.loc["whole frame", "Points"]
    assert whole == len(examined["true"].found)
    assert table.loc["one head", "Points"] + table.loc["several heads", "Points"] == whole
    full, small = (float(table.loc["one head", f"RMS ({u})"]) for u in ("px", "px of the picture"))
    assert full / small == pytest.approx(16, rel=0.1)  # three decimals


def test_the_ways_are_tabled_with_pixels_beside_geometry(exposure, examined):
    geometry = geometry_errors(exposure, examined)
    table = tables.way_table(examined, geometry)
    assert list(table["Heads"]) == [tables.NAMES[name] for name in WAYS]
    for column, least in (("RMS (px)", 0.5), ("Radial (px)", 1.0)):
        pixels, exact = map(float, re.findall(r"[\d.]+", table.loc[1, column]))
        assert exact > least
        assert pixels == pytest.approx(exact, rel=0.1)


def test_sentences_have_the_numbers_found(exposure, examined, draws, targets):
    said = tables.acceptance_sentence(exposure, examined["true"])
    assert said.startswith(f"Of {len(examined['true'].found)} points")
    assert f"{exposure.height_m:.0f} m below" in said
    said = tables.agreement_sentence(examined)
    slope = float(re.search(r"measured as ([\d.]+) times", said)[1])
    assert slope == pytest.approx(1, abs=0.02)
    assert "decentring" in tables.self_calibration_sentence(examined["true"])
    assert "98 %" in tables.draw_sentence(draws) or "three rotations" in tables.draw_sentence(draws)


def test_the_papers_numbers_stand_beside_ours(exposure, examined, draws, targets):
    said = tables.paper_sentence(examined, exposure)
    assert "about 3 µm (0.5 px)" in said
    assert "close to 2 px" in said
    said = tables.target_sentence(targets, draws)
    share = 100 * np.mean(targets.radial_px >= printed.statement("synthetic_border_distortion_px"))
    assert f"reaches 2 px in {share:.0f} %" in said


def test_the_draws_are_tabled_by_refinement(draws):
    table = tables.draw_table(draws)
    assert list(table["Heads"]) == [tables.NAMES[name] for name in WAYS[1:]]
    middle = draws.loc[draws["refinement"] == "rotations", "oriented_px"].median()
    assert table.loc[2, "Oriented (px)"].startswith(f"{middle:.2f} (")


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
    turned = table[table["Errors"].str.startswith("heads turned")].set_index("Refined by")
    turned = turned.drop(columns="Errors").astype(float)
    rotations, shift = (turned.loc[tables.NAMES[way]] for way in ("rotations", "mean shift"))
    assert rotations["Overlaps, RMS (px)"] < 0.01
    assert rotations["at most in the frame (px)"] < 0.02
    assert shift["at most in the frame (px)"] > 1.0


def test_the_answer_has_what_each_refinement_leaves(exposure, examined):
    said = sentences.answer(exposure, examined)
    left = [tables.left_px(examined[way], "oriented") for way in ("true", "mean shift")]
    assert f"With true heads {left[0]:.2f} px" in said
    assert f"leave {left[1]:.2f} px after the paper's mean differences" in said
