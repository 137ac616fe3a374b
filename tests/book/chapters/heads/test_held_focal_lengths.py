"""Heads with wrong focal lengths: what must show, and what must not."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.heads import tables
from acx4lib.calibration.heads import (
    Heads,
    above_gnss,
    calibrate_heads,
    focal_lengths_by_gnss,
    relative_orientation,
)
from acx4lib.stages import attempt
from support.flights.simulated import HEADS


def oriented(flown, heads):
    return relative_orientation(heads, flown.flight.cameras["SYN"], weak=True)


def test_an_unchanged_focal_length_gives_the_same_heads(held, heads, flown):
    for name, fit in held[0.0].bundles.items():
        found, sound = (f.cameras[0].interior.to_array() for f in (fit, heads.bundles[name]))
        assert_allclose(found, sound, rtol=1e-6, atol=1e-8)
    xyz_mm = (oriented(flown, one).xyz_mm for one in (held[0.0], heads))
    assert_allclose(*xyz_mm, atol=1e-6)


def test_the_focal_length_is_held_where_it_is_told(held):
    assert [h.bundles["CAM3"].cameras[0].interior.f for h in held.values()] == [73.5, 74.0, 74.5]


def test_what_was_rejected_before_stays_out(held, heads):
    for name, fit in held[0.5].bundles.items():
        assert fit.rejected == heads.bundles[name].rejected
    assert sum(len(fit.rejected) for fit in heads.bundles.values()) > 0


def test_the_fit_hardly_minds_a_wrong_focal_length(held):
    """Two flying heights do not determine f beside free exterior orientation: sigma 0.06 mm."""
    variances = [tables.variance(h) for h in held.values()]
    assert max(variances) < 1.05 * min(variances)
    assert max(map(tables.control_rms, held.values())) < 0.005  # control's sigma is 1 and 2 cm


def test_the_cameras_rise_in_proportion_to_the_focal_length(held):
    low, high = (above_gnss(held[change].bundles["CAM2"]) for change in (-0.5, 0.5))
    mean_height = (10 * 2600 + 21 * 1600) / 31
    assert_allclose(high - low, mean_height / 74.0, rtol=0.02)


def test_gnss_heights_ask_for_the_true_focal_lengths(held, flown):
    """0.2 m of lever arm are 0.008 mm; the propagated sigma of such an f is about 0.005 mm."""
    asked = focal_lengths_by_gnss(list(held.values()))
    truth = {name: flown.truth["cameras"][name]["f_mm"] for name in HEADS}
    assert_allclose([asked[n] for n in HEADS], [truth[n] for n in HEADS], atol=0.025)


def test_a_head_that_once_failed_is_not_asked_for(held):
    fewer = Heads(bundles={"CAM1": held[0.5].bundles["CAM1"]}, failures={})
    assert set(focal_lengths_by_gnss([held[-0.5], fewer])) == {"CAM1"}
    assert focal_lengths_by_gnss([]) == {}


def test_one_wrong_head_shows_in_its_own_height_over_the_synthetic_image(flown, heads, hold):
    wrong = oriented(flown, hold(0.5, only=["CAM3"]))
    moved = wrong.xyz_mm[:, 2] - oriented(flown, heads).xyz_mm[:, 2]
    assert_allclose(moved, [0, 0, 0.5, 0], atol=0.02)


def test_all_heads_wrong_by_the_same_leave_their_differences(held, flown):
    differences = [np.diff(oriented(flown, h).xyz_mm[:, 2]) for h in held.values()]
    assert_allclose(differences[0], differences[2], atol=0.02)


def test_a_head_that_cannot_be_adjusted_is_missing(flown, heads):
    block = flown.flight.heads
    of_cam1 = block.images.camera_idx[block.image_points.image_idx] == 0
    some = replace(block, image_points=block.image_points[~of_cam1])
    found = calibrate_heads(some, HEADS, free=("xp",), after=heads)
    assert set(found.bundles) == {"CAM2", "CAM3", "CAM4"}


def test_the_table_has_what_changes_by_what_is_held(held, hold, heads, flown):
    tried = {"all": held[0.5], "unchanged": held[0.0], "CAM4": hold(0.5, only=["CAM4"])}
    synthetic = flown.flight.cameras["SYN"]
    turned = {k: attempt(relative_orientation, h, synthetic) for k, h in tried.items()}
    table = tables.held(tried, turned, heads)
    assert list(table.index) == list(tried)
    assert table.loc["unchanged", "Lifted by up to (m)"] < 1e-3
    assert_allclose(table["Lifted by up to (m)"].iloc[[0, 2]], 13.0, atol=0.2)  # 0.5 / 74 of H
    words = table.iloc[:, -1]
    assert words["CAM4"].startswith(words["unchanged"][:3])
    said = tables.by_wrong_lengths(table)
    assert 0.1 < said["moved_mm"] < 0.2
    assert said["lifted_m"] == table.loc["all", "Lifted by up to (m)"]


def test_without_any_head_the_table_is_empty():
    none = Heads(bundles={}, failures=dict.fromkeys(HEADS, "no"))
    table = tables.held({"unchanged": none}, {"unchanged": None}, none)
    assert table.empty
    assert tables.by_wrong_lengths(table) == {}
