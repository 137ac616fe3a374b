"""A shift and drifts of GNSS positions as unknowns: recovered, held, and said."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4files.results import folder as results
from acx4files.results import sentences
from acx4files.results.sentences import not_determined
from acx4files.stages import diagnosed
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.observations import position_errors
from acx4lib.calibration import mounting, trajectory_errors
from acx4lib.calibration.estimates import parameters
from acx4lib.geometry.parameters import AXES
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.model import Model
from support import blocks
from support.flights import simulated as flown
from support.helpers import dense_covariance
from support.run_results import put

FREE = ("f", "xp", "yp", "k1", "p1", "p2")
GNSS = ("shift", "drift")
SHIFT = np.array([0.30, -0.20, 0.15])
DRIFT = 0.01 * np.array([[1.0, -0.5, 0.3], [-0.2, 0.4, 0.6], [0.0, 0.7, -0.8]])  # m/s


def off(block, shift, drift):
    """The block with positions that are shifted and drift."""
    net = mounted_orientation(block, Model(gnss=("drift",)))
    return blocks.changed(
        block, "gnss", position_errors(net.observed, replace(net.start, shift=shift, drift=drift))
    )


def single_step(block, model=Model()):
    return mounting.single_step(block, replace(model, free=model.free or FREE)).bundle


@pytest.fixture(scope="module")
def striped():
    """Exact; three strips of four exposures."""
    return blocks.in_strips(blocks.standard(), 4)


# --- recovery --------------------------------------------------------------------------------


def test_an_exact_shift_and_drifts_are_recovered_with_the_mounting(striped):
    block = off(striped, SHIFT * [1, 1, 0], DRIFT)
    found = single_step(blocks.approximate(block), Model(gnss=GNSS))
    assert_allclose(found.state.shift, SHIFT * [1, 1, 0], atol=1e-8)
    assert_allclose(found.state.drift, DRIFT, atol=1e-9)
    assert_allclose(found.state.T_b_c.r[0], striped.cameras[0].T_b_c.r, atol=1e-8)


def test_a_table_has_the_shift_and_the_drifts_by_strips_and_axes(striped):
    block = off(striped, SHIFT * [1, 1, 0], DRIFT)
    found = single_step(blocks.approximate(block), Model(gnss=GNSS))
    table = trajectory_errors.table(found)
    strips = found.network.observed.strips.names
    per = "min" if found.network.observed.strips.unit == "s" else "exposure"
    drifts = [(f"GNSS drift {s} {axis}", f"m/{per}") for s in strips for axis in AXES]
    shift = [(f"GNSS shift {axis}", "m") for axis in AXES[:2]]
    assert set(table.index) <= {*shift, *drifts}
    assert table.index[:2].tolist() == shift
    assert_allclose(table["value"].iloc[:2], SHIFT[:2], atol=1e-8)
    assert (table["sigma"] >= 0).all()
    assert len(trajectory_errors.table(single_step(striped))) == 0


@pytest.mark.slow
def test_errors_over_seeds_are_as_large_as_the_covariance_says():
    """Camera, shift and drifts together; the lever arm's z has the height of the shift in it."""
    chi_squares = []
    options = {"blocks": ("calibration",), "tie_points": {"calibration": 100}}
    for seed in flown.SEEDS:
        truth, bundle = shifted_flight(seed, options)
        cov = trajectory_errors.reported_covariance(bundle) / bundle.solution.sigma0_sq
        listed = [*parameters(mounting.from_bundle(bundle)), *trajectory_errors.parameters(bundle)]
        errors = np.array([p.value for p in listed]) - truth
        chi_squares.append(flown.chi_square(errors, cov))
    assert chi_squares[0][1] == 14 + 2 + 15
    flown.assert_errors_fit(chi_squares)


def shifted_flight(seed, options):
    """Return the true parameters in the order of the estimates, and the adjustment."""
    shifted = acx4sim.Options(
        gnss_shift_m=tuple(SHIFT), gnss_strip_drift_m_per_min=(0.3, 0.3, 0.2), **options
    )
    with_drift = flown.read_back(acx4sim.DESIGNS["single-head"](seed=seed, options=shifted))
    no_drift = flown.read_back(
        acx4sim.DESIGNS["single-head"](
            seed=seed, options=replace(shifted, gnss_strip_drift_m_per_min=(0.0, 0.0, 0.0))
        )
    )
    block, free = with_drift.flight.calibration, with_drift.flight.estimate_mounting
    enh, still = (
        b.frame.to_grid(b.trajectory.T_m_b.r) for b in (block, no_drift.flight.calibration)
    )
    bundle = adjust(mounted_orientation(block, Model(free=free, gnss=GNSS)))
    strips = bundle.network.observed.strips
    drift = []
    for k in range(len(strips.names)):
        here = strips.idx == k
        t = strips.elapsed[here]
        drift.append(60 * t @ (enh - still)[here] / (t @ t))
    truth = np.array([with_drift.truth["cameras"]["CAM"][name] for name in flown.MOUNTING_NAMES])
    truth[flown.MOUNTING_NAMES.index("lever_z_m")] -= SHIFT[2]
    return np.concatenate([truth, SHIFT[:2], np.ravel(drift)]), bundle


# --- precision -------------------------------------------------------------------------------


def level(directions, *, per_strip=3):
    """Level strips whose camera positions images and control know far better than GNSS."""
    strips = [(1000.0, 100.0 * i - 150.0, way) for i, way in enumerate(directions)]
    block = blocks.simulate(
        blocks.fly(strips, per_strip=per_strip, tilt_deg=0.0),
        ties=blocks.terrain(30),
        control=blocks.crosses(),
    )
    points = replace(block.image_points, sigma_px=np.full(len(block.image_points), 0.005))
    control = replace(block.control, sigma_m=np.full((9, 3), 1e-4))
    gnss = np.full((len(block.trajectory), 3), 0.5)
    trajectory = replace(block.trajectory, sigma_position=gnss)
    return replace(block, image_points=points, control=control, trajectory=trajectory)


def lever_sigma(block, gnss):
    bundle = adjust(mounted_orientation(block, Model(gnss=gnss)))
    return np.sqrt(np.diag(bundle.solution.cov))[bundle.network.layout.mount[0, :3]]


@pytest.mark.parametrize(("directions", "balance"), [((0, 180, 0, 180), 0), ((0, 0, 180, 0), 0.5)])
def test_a_lever_arm_beside_a_shift_is_known_as_well_as_directions_are_balanced(
    directions, balance
):
    """Closed form: of n positions, n (1 - b^2) are left, b the surplus of one direction."""
    block = level(directions)
    alone, beside = lever_sigma(block, ()), lever_sigma(block, ("shift",))
    assert_allclose(alone, 0.5 / np.sqrt(12), rtol=1e-3)
    assert_allclose(beside[:2] / alone[:2], 1 / np.sqrt(1 - balance**2), rtol=1e-3)
    assert beside[2] == pytest.approx(alone[2], rel=1e-3)


def test_a_shift_is_as_precise_as_the_mean_of_the_positions():
    block = level((0, 0, 180, 0))
    bundle = adjust(mounted_orientation(block, Model(fix=("lever_arm",), gnss=("shift",))))
    cov = trajectory_errors.reported_covariance(bundle)[3:, 3:] / bundle.solution.sigma0_sq
    assert_allclose(np.sqrt(np.diag(cov)), 0.5 / np.sqrt(12), rtol=1e-3)


def test_a_drift_is_as_precise_as_the_slope_of_a_line():
    block = blocks.in_strips(level((0, 180), per_strip=4), 4)
    bundle = adjust(mounted_orientation(block, Model(gnss=("drift",))))
    t = block.trajectory.time_s[:4]
    p = trajectory_errors.parameters(bundle)[0]
    unit = np.sqrt(bundle.solution.sigma0_sq)
    assert p.sigma / unit == pytest.approx(60 * 0.5 / np.sqrt(4 * np.var(t)), rel=1e-3)


def test_the_covariance_is_that_of_the_whole_normal_matrix(striped):
    bundle = adjust(mounted_orientation(striped, Model(free=FREE, gnss=GNSS)))
    whole = dense_covariance(bundle.network, bundle.state)
    n = bundle.network.layout.drift.max() + 1
    sigma = np.sqrt(np.diag(whole)[:n])
    assert_allclose(
        bundle.solution.cov[:n, :n] / np.outer(sigma, sigma),
        whole[:n, :n] / np.outer(sigma, sigma),
        atol=1e-8,
    )


# --- not determined --------------------------------------------------------------------------


def test_in_one_direction_a_shift_and_the_lever_arm_are_one_unknown():
    bundle = single_step(level((0, 0, 0)), Model(free=("f",), gnss=("shift",)))
    lines = sentences.trajectory_not_determined(bundle)
    assert [line.split()[0] for line in lines] == ["gnss_shift_east_m", "gnss_shift_north_m"]
    assert "left open by the observations" in lines[0]
    assert "strips flown in opposite directions" in lines[0]
    camera = [line.split()[1] for line in not_determined(mounting.from_bundle(bundle))]
    assert camera == ["lever_x_m", "lever_y_m"]
    held = single_step(level((0, 0, 0)), Model(free=("f",), fix=("lever_arm",), gnss=("shift",)))
    assert sentences.trajectory_not_determined(held) == []


def test_a_drift_is_judged_by_what_it_adds_up_to():
    """Of a line through four even times, an end is known to 0.67 sigma by the slope alone."""
    block = blocks.in_strips(level((0, 180), per_strip=4), 4)
    for sigma_m, determined in ((1.0, True), (2.0, False)):
        sigma = np.full((8, 3), sigma_m)
        noisy = replace(block, trajectory=replace(block.trajectory, sigma_position=sigma))
        bundle = adjust(mounted_orientation(noisy, Model(gnss=("drift",))))
        unit = np.sqrt(bundle.solution.sigma0_sq)
        # exact data: sigma a posteriori would be nothing
        known = replace(
            bundle,
            solution=replace(
                bundle.solution, cost=bundle.solution.cost + bundle.solution.redundancy
            ),
        )
        assert unit < 0.1
        assert np.all(trajectory_errors.is_determined(known) == determined)


# --- results ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def noisy(striped):
    rng = np.random.default_rng(11)
    return blocks.noisy(off(striped, SHIFT, DRIFT), rng)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, noisy):
    path = tmp_path_factory.mktemp("results")
    found = mounting.calibrate(noisy, Model(free=FREE, gnss=GNSS))
    put(path, "mounting", diagnosed.of_mountings(found))
    return path


def test_results_have_shift_and_drifts_with_their_covariance(folder, noisy):
    found = results.read(folder)
    own = results.parameters(found, "mounting/single_step", "")
    assert [*own.index[:4]] == [
        "gnss_shift_east_m",
        "gnss_shift_north_m",
        "gnss_drift_A_east_m_per_min",
        "gnss_drift_A_north_m_per_min",
    ]
    assert len(own) == 2 + 9
    expected = np.concatenate([SHIFT[:2], 60 * DRIFT.ravel()])
    assert np.all(np.abs(own["value"] - expected) < 4 * own["sigma"])
    cov = results.covariance(found, "mounting/single_step")
    variances = np.diag(cov.loc[own.index, own.index])
    assert_allclose(np.sqrt(variances), own["sigma"], rtol=1e-12)
    assert cov.loc["CAM/lever_x_m", "gnss_shift_east_m"] != 0
    assert results.cameras(found, "mounting/single_step") == ("CAM",)


def test_the_summary_says_what_is_held_and_that_the_shift_is_the_blocks_own(folder):
    found = results.read(folder)
    off_by, drift, held, own = found.summary["mounting/single_step"]["notes"][-4:]
    listed = results.parameters(found, "mounting/single_step", "")
    value, sigma = listed.iloc[0][["value", "sigma"]]
    plainest = (listed["value"].abs() / listed["sigma"])[2:].idxmax()
    value_there, sigma_there = listed.loc[plainest, ["value", "sigma"]]
    assert drift.endswith(f"{plainest}: {value_there:+.3f} ± {sigma_there:.3f}")
    assert f"GNSS positions are off by {value:+.3f} ± {sigma:.3f} m (east)" in off_by
    assert "(height)" not in off_by
    assert held.endswith("GNSS shift is held, since it and the lever arm's z are one unknown")
    assert "none is applied to another block" in own


def test_weights_that_know_of_slow_errors_are_said(striped):
    process = GaussMarkov(share=0.9, time_constant_s=600.0)
    timed = replace(striped.trajectory, time_s=np.arange(12.0), slow_positions=process)
    bundle = single_step(replace(striped, trajectory=timed))
    assert sentences.on_trajectory(bundle) == [
        "errors of positions are taken to be correlated: 0.9 of their sigma, with a time constant "
        "of 600 s"
    ]
