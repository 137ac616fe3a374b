"""The orientation of the paper's heads, and what held focal lengths make of it."""

from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import heads as chapter
from acx4book.chapters.heads import (
    mean_residuals,
    radial_distortion,
)
from acx4book.paper import printed
from acx4book.typesetting import style
from acx4files.stages import attempt
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
from support.figures import (
    assert_labelled,
    assert_texts_apart,
    drawn,
    legend,
    panels,
    quivers,
)
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
        return calibrate_heads(block, f, free=free, after=heads)

    return held


@pytest.fixture(scope="session")
def held(hold):
    return {change: hold(change) for change in (-0.5, 0.0, 0.5)}


# --- Figures of the heads: residuals, distortion, correlations, held focal lengths


def test_mean_residuals_have_one_field_per_head(fits):
    fig = drawn(mean_residuals(fits))
    assert_labelled(fig)
    assert_texts_apart(fig)
    assert [ax.get_title(loc="left") for ax in panels(fig)] == list(HEADS)
    for ax, fit in zip(panels(fig), fits.values(), strict=True):
        (arrows,) = quivers(ax)
        assert 80 <= len(arrows.U) <= 108  # 12 x 9 cells, some with too few points
        assert ax.get_ylim() == (fit.cameras[0].height_px, 0)  # rows run down


def test_a_pattern_in_the_residuals_is_told_from_noise(fits):
    fit = fits["CAM1"]
    group = fit.solution.group("image_point")
    shifted = replace(group, v=group.v + np.array([1.0, 0.0]))
    groups = tuple(shifted if g is group else g for g in fit.solution.groups)
    spoilt = replace(fit, solution=replace(fit.solution, groups=groups))
    colours = [
        {tuple(c) for c in quivers(panels(mean_residuals({"CAM1": f}))[0])[0].get_facecolor()}
        for f in (fit, spoilt)
    ]
    orange = mpl.colors.to_rgba(style.ORANGE)
    assert orange not in colours[0]
    assert orange in colours[1]


def test_radial_distortion_ends_at_the_corner_beside_the_papers_values(fits):
    printed = dict.fromkeys(HEADS, 14.0)
    fig = drawn(radial_distortion(fits, printed_px=printed, claim_px=15.0))
    assert_labelled(fig)
    assert_texts_apart(fig)
    wide, near = panels(fig)
    assert len(wide.lines) == 4 + 1
    assert len(near.lines) == 4 + 4 + 1
    assert wide.lines[0].get_xdata()[-1] == pytest.approx(33.68, abs=0.01)  # half the diagonal, mm
    assert wide.lines[0].get_ydata()[-1] == pytest.approx(15.0, abs=1.0)
    assert legend(fig)[-2:] == ["the paper's Table 1", "its text: about 15 px"]


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


def test_distances_from_print_are_those_of_the_values(flight, stage):
    relative = stage.orientation.table()
    off = printed.off_heads(flight, relative)
    assert_allclose(off["CAM2", "Zc", "mm"], stage.orientation.xyz_mm[1, 2] - 74.272, rtol=1e-12)
    beside = printed.heads(flight, relative)
    apart = abs(off / relative["sigma"])  # nothing is printed of the precision
    assert_allclose(beside["apart (σ)"].dropna(), apart.dropna())


def test_other_heads_are_not_compared_with_the_paper(other):
    stage = stage_of_heads.calibrate(other)
    assert [head.name for head in stage.orientation.heads] == ["port", "starboard"]
    for table in (stage.heads.table(), stage.orientation.table()):
        assert printed.heads(other, table).shape == (len(table), 0)
        assert len(printed.off_heads(other, table)) == 0
    assert printed.of_heads(other, "sigma0_squared").empty
    assert chapter.printed_border_px(other) == {}
    assert chapter.claim(other, "max_correlation") is None


def test_nothing_stands_beside_an_orientation_that_failed(flight):
    failed = attempt(
        relative_orientation, stage_of_heads.Heads(bundles={}, failures={"A": ""}), None
    )
    table = failed.table()
    assert printed.heads(flight, table).shape == (0, 0)
    assert printed.off_heads(flight, table).groupby("parameter").max().to_dict() == {}


def test_the_paper_is_beside_no_other_choice_of_heads(flight):
    three = replace(flight.synthetic, heads=HEADS[:3])
    assert printed.applies(flight)
    assert not printed.applies(replace(flight, synthetic=three))


# --- What the heads hold


def test_every_held_focal_length_stands_with_what_holding_costs(heads):
    table = chapter.held_values({name: of_bundle(fit) for name, fit in heads.bundles.items()})
    costs = table[chapter.COSTS].xs("f", level="parameter")
    assert_allclose(costs, [36.3, 8.1, 9.7, 30.0], atol=0.15)  # by really estimating f
    p = table["p"].xs("f", level="parameter")
    assert all(float(one.lstrip("<\N{NO-BREAK SPACE}")) < 0.005 for one in p)


def test_where_f_is_estimated_nothing_of_it_is_held(flown, heads):
    free = calibrate_heads(
        flown.flight.heads,
        HEADS[1:2],
        free=("f", *flown.flight.estimate_heads),
        after=heads,
    )
    tested = {name: of_bundle(fit) for name, fit in free.bundles.items()}
    assert chapter.held_values(tested).empty
    assert chapter.held_values({}).empty


# --- Heads with wrong focal lengths: what must show, and what must not


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


def test_only_the_sum_of_squares_minds_a_wrong_focal_length(held, heads, flown):
    """It rises by ((f - f_free) / sigma)^2 from the f of an adjustment that estimates it."""
    nothing = {title: Failed(method="", reason="", error=AdjustmentError("")) for title in held}
    table = chapter.held(held, nothing, held[0.0])
    free = calibrate_heads(
        flown.flight.heads, HEADS, free=("f", *flown.flight.estimate_heads), after=heads
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
    table = chapter.held(tried, turned, heads)
    assert list(table.index) == list(tried)
    assert table.loc["unchanged", "Lifted by up to (m)"] < 1e-3
    assert_allclose(table["Lifted by up to (m)"].iloc[[0, 2]], 13.0, atol=0.2)  # 0.5 / 74 of H
    words = table.iloc[:, -1]
    assert words["CAM4"].startswith(words["unchanged"][:3])
    said = chapter.by_wrong_lengths(table)
    assert 0.1 < said["moved_mm"] < 0.2
    assert said["lifted_m"] == table.loc["all", "Lifted by up to (m)"]
