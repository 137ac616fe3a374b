"""Tables of chapter 3: what they have is what the library computed, in the units they name."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.mounting import tables
from acx4book.paper import printed
from acx4lib import design
from acx4lib.attempts import attempt
from acx4lib.calibration.determination import (
    absorption,
    nested_f_ratio,
    parameter_correlations,
)
from acx4lib.calibration.estimates import group_tests, undistorted
from acx4lib.calibration.mounting import single_step
from acx4lib.model import Model

# --- what is determined together -------------------------------------------------------------


@pytest.fixture(scope="module")
def radial(noisy_block):
    return single_step(noisy_block, Model(free=("f", "xp", "yp", "k1", "k2", "k3")))


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


def test_effective_heights_lie_above_the_mean_height(seen):
    """They were 1411, 1362 and 1286 m for z, x, y where Table 3's lever arm is read as printed."""
    assert np.all(seen["Effective height (m)"] > 1250)
    assert np.all(seen["Effective height (m)"] < 1500)


def test_all_components_together_are_within_chance(mountings):
    found = tables.chi_square_seen(absorption(mountings))
    assert found["degrees"] == 3
    assert found["p"] > 0.001


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
    found = {
        name: single_step(part, Model(free=free), snooping=False) for name, part in changed.items()
    }
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
