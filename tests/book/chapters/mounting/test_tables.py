"""Tables of chapter 3: what they have is what the library computed, in the units they name."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.mounting import tables
from acx4book.paper import printed
from acx4book.typesetting.myst import LABELS
from acx4lib import design
from acx4lib.attempts import attempt
from acx4lib.bundle.rejections import noncentrality
from acx4lib.calibration import mounting
from acx4lib.calibration.determination import (
    absorption,
    detectable,
    nested_f_ratio,
    parameter_correlations,
    strong_correlations,
)
from acx4lib.calibration.estimates import group_tests, undistorted
from acx4lib.calibration.mounting import single_step
from support import blocks

# --- what is determined together -------------------------------------------------------------


@pytest.fixture(scope="module")
def radial(noisy_block):
    return single_step(noisy_block, free=("f", "xp", "yp", "k1", "k2", "k3"))


def test_a_method_has_its_condition_and_its_correlations(radial):
    (row,) = tables.determination({"single-step": radial}).to_dict("records")
    assert row["Method"] == "single-step"
    power = f"{radial.bundle.solution.condition:.0e}"
    assert row["Condition"].startswith(power[0] + "·10")
    pair = strong_correlations(radial.calibration)[0]
    assert {pair.row, pair.column} <= {"CAM/k1", "CAM/k2", "CAM/k3"}
    assert row["Correlations above 0.9"].startswith(
        f"{LABELS[pair.row[4:]]}, {LABELS[pair.column[4:]]} {pair.correlation:+.2f}".replace(
            "-", "\N{MINUS SIGN}"
        )
    )
    assert row["Weakest combination"].split("; ")[0].endswith(" %")
    assert "CAM" not in row["Weakest combination"]


def test_several_cameras_are_told_apart():
    aft = replace(blocks.CAMERA, name="AFT")
    two = single_step(blocks.standard(cameras=(blocks.CAMERA, aft)), free=("k1", "k2"))
    (row,) = tables.determination({"single-step": two}).to_dict("records")
    listed = row["Correlations above 0.9"].split("; ")
    assert "CAM $k_1$, CAM $k_2$" in listed[0] or "AFT $k_1$, AFT $k_2$" in listed[0]


def test_correlations_are_those_of_the_covariance(mountings):
    matrix = parameter_correlations(mountings["single_step"].calibration)
    assert_allclose(np.diag(matrix), 1.0)
    assert matrix.loc["k2", "k3"] < -0.95
    assert matrix.loc["f_mm", "lever_z_m"] > 0.5


@pytest.fixture(scope="module")
def joint(ideal, mountings):
    single = mountings["single_step"]
    declared = single.bundle.network.block.cameras
    against = {"zero": [undistorted(c) for c in declared], **printed.cameras(ideal, declared)}
    dof = single.bundle.solution.redundancy
    return tables.joint_tests(
        {
            title: [
                (test, attempt(nested_f_ratio, single.bundle, test, cameras))
                for test in group_tests(single.calibration, cameras, redundancy=dof)
            ]
            for title, cameras in against.items()
        }
    )


def test_covariance_and_nested_adjustment_agree(joint):
    """Also hundreds of sigmas away: the problem is nearly linear."""
    assert_allclose(joint["F"], joint["F, adjusted without them"], rtol=0.01)


def test_the_printed_values_are_the_truth_and_zero_is_not(joint):
    of = joint.groupby("against", sort=False)["p"].agg(list)
    assert max(of["zero"]) < 0.0005
    assert len(of["paper"]) == 4
    assert min(of["paper"]) > 0.001


def test_single_tests_hide_what_the_radial_parameters_are_together(joint):
    radial = joint.iloc[0]
    assert np.sqrt(3 * radial["F"]) > 3 * radial["largest single t"]


# --- how well observations control each other ------------------------------------------------


@pytest.fixture(scope="module")
def reliability(mounted):
    return tables.reliability(mounted, detectable(mounted))


def test_every_component_has_a_row_with_its_unit(reliability):
    assert list(reliability["Observation"]) == [
        "Image points, col (px)",
        "Image points, row (px)",
        "Control points, east (m)",
        "Control points, north (m)",
        "Control points, height (m)",
        "GNSS positions, east (m)",
        "GNSS positions, north (m)",
        "GNSS positions, height (m)",
        "Attitudes, roll (°)",
        "Attitudes, pitch (°)",
        "Attitudes, heading (°)",
    ]
    assert list(reliability["Number"])[2:] == [9] * 3 + [12] * 6


def test_attitudes_are_in_degrees(reliability):
    heading = reliability.iloc[-1]
    expected = noncentrality() * 0.008 / np.sqrt(heading["Median"])
    assert heading["Detectable, median"] == pytest.approx(expected, rel=0.01)


def test_what_was_taken_out_does_not_count(mounted):
    groups = list(mounted.solution.groups)
    gnss = groups[2]
    redundancy = gnss.redundancy.copy()
    redundancy[3] = np.nan
    groups[2] = replace(gnss, redundancy=redundancy)
    without = replace(mounted, solution=replace(mounted.solution, groups=tuple(groups)))
    assert list(tables.reliability(without, detectable(without))["Number"])[5:8] == [11] * 3


def test_the_share_of_the_poorly_controlled_is_in_per_cent(mounted, reliability):
    r = mounted.solution.group("control_point").redundancy[:, 2]
    row = reliability[reliability["Observation"] == "Control points, height (m)"].iloc[0]
    assert row["Below 0.1 (%)"] == pytest.approx(100 * np.mean(r < 0.1))
    assert row["Redundancy, least"] == r.min()


# --- the lever arm that the interior orientation took up ---------------------------------------


@pytest.fixture(scope="module")
def seen(mountings):
    return tables.lever_arm_seen(mountings, absorption(mountings))


def test_least_squares_reads_the_lever_arm_that_the_mean_height_misses(seen):
    assert [*seen["Parameter"]] == ["$x_p$", "$y_p$", "$f$"]
    off_mm = np.abs(seen["Seen less estimated (mm)"])
    at_mean = np.abs(seen["At the mean height (m)"] - seen["Estimated (m)"])
    assert np.all(off_mm < 4 * seen["σ of the difference (mm)"])
    assert np.all(off_mm < 2)
    assert np.all(at_mean > 0.01)
    assert np.all(np.abs(seen["Difference (mm)"] - seen["Expected (mm)"]) < 1e-4)


def test_methods_that_share_their_data_are_not_two_opinions(seen):
    """The sigma of their difference is a fortieth of what either has."""
    assert np.all(1e-3 * seen["σ of the difference (mm)"] < seen["σ of it (m)"] / 20)


def test_effective_heights_lie_above_the_mean_height(seen):
    """They were 1411, 1362 and 1286 m for z, x, y where Table 3's lever arm is read as printed."""
    assert np.all(seen["Effective height (m)"] > 1250)
    assert np.all(seen["Effective height (m)"] < 1500)


def test_all_components_together_are_within_chance(mountings):
    found = tables.chi_square_seen(absorption(mountings))
    assert found["degrees"] == 3
    assert found["p"] > 0.001


def test_the_lever_arm_that_the_two_step_method_lacks_matters_here(mountings):
    told = tables.taken_up(mountings, absorption(mountings))
    assert told["matters"]
    assert told["rest_um"] < 0.1
    assert [name for name, _ in told["shifts"]] == ["$f$", "$x_p$", "$y_p$"]


def test_a_missing_method_leaves_nothing_to_compare(mountings):
    alone = mounting.Mountings(methods={"single_step": mountings["single_step"]}, failures={})
    found = absorption(alone)
    assert tables.lever_arm_seen(alone, found).empty
    assert tables.chi_square_seen(found) == {}
    assert not tables.taken_up(alone, found)["matters"]


# --- image by image, and with something else ---------------------------------------------------


def test_the_scatter_of_the_images_is_that_of_the_attitudes(mountings):
    table = tables.scatter(mountings["two_step"])
    sigma = np.degrees(
        np.median(mountings["two_step"].bundle.network.block.trajectory.sigma_attitude, axis=0)
    )
    assert_allclose(table["scatter of the images"], sigma, rtol=0.35)
    assert np.all(table["σ of the mean"] > table["scatter / √n"])


@pytest.fixture(scope="module")
def variants(ideal, mountings):
    single, free = mountings["single_step"], ideal.estimate_mounting
    block = single.bundle.network.block
    changed = {
        "lowest": design.lowest_height(block),
        "without control": design.without_control(block),
        "grid": design.as_if_cartesian(block),
    }
    found = {name: single_step(part, free=free, snooping=False) for name, part in changed.items()}
    return tables.variants({"as flown": single, **found})


def column(table, label):
    (name,) = {key for key in table.columns.get_level_values(0) if str(key).startswith(label)}
    return table[name]


def test_one_flying_height_does_not_separate_focal_length_and_lever_arm(variants):
    assert variants["images", ""]["lowest"] == 30
    for label in ("$f$", "lever arm $z$"):
        sigma = column(variants, label)["sigma"]
        assert sigma["lowest"] > 10 * sigma["as flown"]


def test_without_control_the_lever_arms_height_is_open_and_the_rest_is_not(variants):
    z, x = (column(variants, f"lever arm ${axis}$")["sigma"] for axis in "zx")
    assert z["without control"] > 10 * z["as flown"]
    assert x["without control"] < 1.2 * x["as flown"]


def test_the_map_grid_as_cartesian_bends_the_focal_length_and_not_the_variance(variants):
    f = column(variants, "$f$")["value"]
    # the geodesy note has +0.0083 mm near Curitiba, for another layout
    assert f["grid"] - f["as flown"] == pytest.approx(0.0083, abs=0.005)
    variance = variants["variance of unit weight", ""]
    assert variance["grid"] == pytest.approx(variance["as flown"], abs=0.01)


def test_a_variant_without_an_outcome_has_an_empty_row_and_one_without_effect_has_none(noisy_block):
    nothing_seen = replace(noisy_block, image_points=noisy_block.image_points[:0])
    good = single_step(noisy_block, free=("f",))
    table = tables.variants(
        {
            "good": good,
            "the same": good,
            "failed": attempt(single_step, nothing_seen, free=("f",)),
        }
    )
    assert list(table.index) == ["good", "failed"]
    assert np.isnan(table["variance of unit weight", ""]["failed"])
