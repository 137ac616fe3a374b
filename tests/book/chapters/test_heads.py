"""The orientation of the paper's heads, and what held focal lengths make of it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import heads as chapter
from acx4book.paper import printed
from acx4files.stages import heads as stage_of_heads
from acx4lib.attempts import Failed
from acx4lib.calibration.heads import (
    Heads,
    above_gnss,
    calibrate_heads,
    focal_lengths_by_gnss,
    relative_orientation,
)
from acx4lib.calibration.held import of_bundle
from acx4lib.design import with_focal_lengths
from acx4lib.errors import AdjustmentError
from acx4lib.model import Model
from support.flights.simulated import HEADS


@pytest.fixture(scope="session")
def heads(fits):
    return Heads(bundles=fits, failures={})


@pytest.fixture(scope="session")
def hold(flown, heads):
    """Return the heads with other focal lengths held: a change, mm, for each or for some."""

    def held(change_mm, only=None):
        f = {name: fit.cameras[0].interior.f for name, fit in heads.bundles.items()}
        f |= {name: f[name] + change_mm for name in only or f}
        block, free = with_focal_lengths(flown.flight.heads, f), flown.flight.estimate_heads
        return calibrate_heads(block, f, Model(free=free), after=heads)

    return held


@pytest.fixture(scope="session")
def held(hold):
    return {change: hold(change) for change in (-0.5, 0.0, 0.5)}


# --- Heads beside the paper's Table 1, of the paper's flight and of another one


def test_table_1_has_every_printed_number(flight, stage):
    interior = stage.heads.table()
    beside = printed.heads(flight, interior)
    assert beside["apart (σ)"].notna().sum() == 5 * 4  # f is held
    assert beside.loc[("CAM3", "xp", "mm"), "paper"] == "0.2619 ± 0.0032"
    relative = stage.orientation.table()
    beside = printed.heads(flight, relative)
    assert len(beside) == 6 * 4
    assert beside.loc[("CAM2", "Zc", "mm"), "paper"] == "74.272"
    first = beside.loc[("CAM1", "Zc", "mm")]
    assert first["apart (σ)"] != first["apart (σ)"]  # held, no sigma
    assert "σ over the paper's" not in beside  # which prints none of the orientation


def test_other_heads_are_not_compared_with_the_paper(other):
    stage = stage_of_heads.calibrate(other)
    assert [head.name for head in stage.orientation.heads] == ["port", "starboard"]
    for table in (stage.heads.table(), stage.orientation.table()):
        assert printed.heads(other, table).shape == (len(table), 0)
        assert len(printed.off_heads(other, table)) == 0
    assert printed.of_heads(other, "sigma0_squared").empty
    assert chapter.printed_border_px(other) == {}
    assert chapter.claim(other, "max_correlation") is None


# --- What the heads hold


def test_every_held_focal_length_stands_with_what_holding_costs(heads):
    table = chapter.held_values({name: of_bundle(fit) for name, fit in heads.bundles.items()})
    costs = table[chapter.COSTS].xs("f", level="parameter")
    assert_allclose(costs, [36.3, 8.1, 9.7, 30.0], atol=0.15)  # by really estimating f
    p = table["p"].xs("f", level="parameter")
    assert all(float(one.lstrip("<\N{NO-BREAK SPACE}")) < 0.005 for one in p)


# --- Heads with wrong focal lengths: what must show, and what must not


def oriented(flown, heads):
    return relative_orientation(heads, flown.flight.cameras["SYN"], weak=True)


def test_only_the_sum_of_squares_minds_a_wrong_focal_length(held, heads, flown):
    """It rises by ((f - f_free) / sigma)^2 from the f of an adjustment that estimates it."""
    nothing = {title: Failed(method="", reason="", error=AdjustmentError("")) for title in held}
    table = chapter.held(held, nothing, held[0.0])
    free = calibrate_heads(
        flown.flight.heads, HEADS, Model(free=("f", *flown.flight.estimate_heads)), after=heads
    )
    off = {
        change: [
            (74.0 + change - row["value"]) / row["sigma"] * fit.solution.sigma0_sq**0.5
            for fit, (_, row) in zip(
                free.bundles.values(),
                free.table().xs("f", level="parameter").iterrows(),
                strict=True,
            )
        ]
        for change in held
    }
    expected = [np.sum(np.square(off[change])) - np.sum(np.square(off[0.0])) for change in held]
    assert_allclose(table[chapter.COST], expected, rtol=0.02, atol=0.1)
    assert expected[0] > 100
    variances = [
        np.mean([fit.solution.sigma0_sq for fit in h.bundles.values()]) for h in held.values()
    ]
    assert max(variances) < 1.05 * min(variances)
    assert max(table["RMS at control points (mm)"]) < 5  # control's sigma is 1 and 2 cm


def test_the_cameras_rise_in_proportion_to_the_focal_length(held):
    low, high = (above_gnss(held[change].bundles["CAM2"]) for change in (-0.5, 0.5))
    mean_height = (10 * 2600 + 21 * 1600) / 31
    assert_allclose(high - low, mean_height / 74.0, rtol=0.02)


def test_gnss_heights_ask_for_the_true_focal_lengths(held, flown):
    """0.2 m of lever arm are 0.008 mm; the propagated sigma of such an f is about 0.005 mm."""
    asked = focal_lengths_by_gnss(list(held.values()))
    truth = {name: flown.truth["cameras"][name]["f_mm"] for name in HEADS}
    assert_allclose([asked[n] for n in HEADS], [truth[n] for n in HEADS], atol=0.025)


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
    found = calibrate_heads(some, HEADS, Model(free=("xp",)), after=heads)
    assert set(found.bundles) == {"CAM2", "CAM3", "CAM4"}
