"""The stored tables, whatever is on this machine."""

import numpy as np
import pytest

from acx4book.reference import comparisons, heads
from acx4book.reference.heads import FIVE, predicted_px, solved
from acx4lib.tie_points.refinement import refine_by_rotations
from acx4lib.tie_points.ties import overlaps
from support.helpers import needs


@pytest.fixture
def stored(tmp_path):
    return lambda name: comparisons.computed_or_stored(name, folder=str(tmp_path)).table


# --- Five real heads over an orchard: pixels to rotations, beside an independent trial


@pytest.fixture(scope="module")
def five():
    return solved(FIVE)


@needs(FIVE)
def test_all_heads_are_bound_and_fit_to_a_tenth_of_a_pixel(five):
    table = heads.pairs(FIVE)
    assert (table["ties"] > 1000).all()
    assert table["rms_px"].max() < 0.15
    assert table["chain"].sum() == len(five.heads) - 1


@needs(FIVE)
def test_the_independent_trial_found_the_same_rotations(five):
    """Its points have 0.4 px; a pixel is 0.04 deg."""
    table = heads.rotations(FIVE)
    assert np.abs(table.filter(like="minus_trial").to_numpy()).max() < 0.005


@needs(FIVE)
def test_halves_of_the_picture_turn_the_heads_alike(five):
    """An estimate fits what it has not seen: the ties of one half, heads turned by the other."""
    ties = five.found.ties[~five.fits["rotations"].rejected]
    left = ties.colrow_a[:, 0] < five.synthetic.width_px / 2
    fit = refine_by_rotations(five.factory, ties[left])
    for one in overlaps(ties[~left], fit.orientation):
        assert np.sqrt(np.mean(one.d**2)) / five.synthetic.pixel_mm < 0.35


@needs(FIVE)
def test_alternating_blocks_of_a_single_picture_agree_within_sigma_that_count_what_they_share(five):
    fit = five.fits["rotations"]
    assert max(fit.by_exposure) > 1e-5  # rad: ties alone say less than a microradian
    assert "scatter between exposures is not seen" in fit.sentence


# --- What RigRelatives mean


def test_only_one_direction_fits_and_the_order_does_not_matter(stored):
    table = stored("ten_readings").set_index("reading")["median_px"]
    to_reference, to_head = table.iloc[:2], table.iloc[2:]
    assert to_reference.max() < 1.5
    assert to_head.min() > 10
    assert abs(to_reference.diff().iloc[1]) < 0.05


# --- Ten heads: the stored rotations beside the trial's and the factory's


def test_the_trial_found_the_same_rotations_of_all_ten_heads(stored):
    table = stored("ten_rotations")
    assert len(table) == 9
    assert np.abs(table.filter(like="minus_trial").to_numpy()).max() < 0.005
    assert (table["x_sigma_deg"] < 0.001).all()


def test_the_factory_is_off_by_hundredths_of_a_degree_where_it_says_anything(stored):
    table = stored("ten_rotations").set_index("head")
    off = table.filter(like="minus_factory")
    assert off.loc["7 Green-531"].isna().all()
    assert 0.01 < np.nanmax(np.abs(off.to_numpy())) < 0.07


@pytest.mark.parametrize(("name", "dof"), [("ten_rotations", 27), ("five_rotations", 12)])
def test_sigma_of_loops_do_not_explain_the_differences_from_the_trial(stored, name, dof):
    table = stored(name)
    chi2, n = heads.chi_square(table)
    by_hand = sum(
        row[f"{a}_minus_trial_deg"] ** 2 / (row[f"{a}_sigma_deg"] ** 2 + 1e-6 / 12)
        for _, row in table.iterrows()
        for a in "xyz"
    )
    assert n == dof
    assert chi2 == pytest.approx(by_hand)
    assert 3.0 < np.sqrt(chi2 / n) < 6.0  # several sigma: the page must not say that they agree


# --- Which bands tie


def test_alike_bands_tie_best_and_infrared_ties_to_red_edge(stored):
    table = stored("ten_pairs").set_index(["head", "other"])
    assert table.loc[("2 Green", "7 Green-531"), "share"] > 0.9
    near, far = table.loc[[("4 NIR", "10 Red edge-740"), ("4 NIR", "6 Blue-444")], "share"]
    assert near > 0.9
    assert far < 0.3
    assert table["chain"].sum() == 9
    assert table.loc[table["chain"], "share"].min() > 0.6


# --- Parallax of a small base


def test_the_shift_is_the_base_over_the_size_of_a_pixel_on_the_ground():
    assert predicted_px(0.03, height_m=60.0, f_px=1500.0) == pytest.approx(0.03 / (60.0 / 1500.0))


def test_free_places_bring_the_rotations_nearer_to_the_factory(stored):
    table = stored("ten_parallax")
    rms = [
        np.sqrt(np.mean(table[[f"x{way}_px", f"y{way}_px"]].to_numpy() ** 2))
        for way in ("", "_left")
    ]
    assert rms[1] < 0.65 * rms[0]
    assert np.hypot(table["base_x_mm"], table["base_y_mm"]).max() < 60  # the camera is larger


# --- Falloff of similar heads against each other


def test_the_response_finds_the_falloff_that_the_factory_states(stored):
    table = stored("ten_vignetting")
    assert np.sqrt(np.mean((table["library"] - table["factory"]) ** 2)) < 1.2  # per cent
    infrared = table[table["head"] == "4 NIR"].iloc[-1]
    assert infrared[["seen", "factory", "library"]].between(-8, -4).all()
