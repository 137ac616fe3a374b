"""Declared mountings: what agrees is confirmed, what an unknown absorbed is not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4files.results import sentences
from acx4lib.bundle.unknowns import layout
from acx4lib.calibration.determination import nested_f_ratio
from acx4lib.calibration.diagnosis import ALPHA, confirmations
from acx4lib.calibration.estimates import Calibration, group_tests
from acx4lib.calibration.mounting import single_step
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, exp, log
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM, Prior
from acx4lib.model import Model
from support import blocks

FREE = ("f", "xp", "yp", "k1", "p1", "p2")
CONVERGENCE_DEG = -0.73
"""Of the blocks' CRS in their middle, by PROJ's command `proj -V`."""


def declared(block, *, lever_m=(0.0, 0.0, 0.0), turn_deg=(0.0, 0.0, 0.0), prior):
    """Return the block with cameras declared off by so much from the truth, along body axes."""
    return replace(
        block,
        cameras=tuple(
            replace(
                camera,
                prior=prior,
                T_b_c=Pose(
                    R=exp(np.radians(turn_deg)) @ camera.T_b_c.R, r=camera.T_b_c.r + lever_m
                ),
            )
            for camera in block.cameras
        ),
    )


def known(lever_m=np.inf, turn_deg=np.inf):
    sigma = np.repeat([lever_m, np.radians(turn_deg)], 3)
    return Prior(declared=(True,) * 6, sigma=tuple(sigma.tolist()))


def compared(block):
    return {c.part: c for c in confirmations(single_step(block, Model(free=FREE)).bundle)}


def test_the_convergence_of_the_blocks_is_as_said():
    lonlat = blocks.FRAME.to_geographic(np.zeros((1, 3)))[:, :2]
    assert_allclose(
        np.degrees(blocks.FRAME.grid.convergence(lonlat)[0]), CONVERGENCE_DEG, atol=0.005
    )


@pytest.mark.parametrize("prior", [known(), known(0.05, 0.1)])
def test_what_is_declared_rightly_is_confirmed(noisy_block, prior):
    found = compared(declared(noisy_block, prior=prior))
    assert set(found) == {"lever arm", "boresight"}
    assert all(c.confirmed for c in found.values())
    assert np.isnan(found["lever arm"].p) == np.isinf(prior.sigma[0])


def test_what_is_not_declared_is_not_compared(noisy_block):
    assert compared(declared(noisy_block, prior=Prior())) == {}
    kappa = replace(Prior(), declared=(False,) * 5 + (True,))
    found = compared(declared(noisy_block, prior=kappa))
    assert set(found) == {"boresight"}
    assert found["boresight"].declared.tolist() == [False, False, True]


@pytest.mark.parametrize(("off_m", "said"), [(0.04, False), (0.5, True), (2.0, True)])
def test_a_lever_arm_without_sigma_is_an_approximation(exact_block, off_m, said):
    """More than what a survey and the estimate are off by is said, and is no contradiction."""
    found = compared(declared(exact_block, lever_m=(0.0, off_m, 0.0), prior=known()))["lever arm"]
    assert found.confirmed
    assert sentences.approximation(found).startswith("lever arm of CAM differs") == said
    assert found.difference[1] == pytest.approx(-off_m, abs=1e-6)


def test_what_is_significant_with_sigma_is_too_much_and_shown_as_the_others_say(exact_block):
    """The estimate is pulled to the declared value; the difference shown is that without it."""
    off = {"lever_m": (0.0, 2.5, 0.0)}
    free = compared(declared(exact_block, **off, prior=known()))["lever arm"]
    tied = compared(declared(exact_block, **off, prior=known(0.02)))["lever arm"]
    assert np.isnan(free.p)
    assert tied.p < ALPHA
    assert "differs from the declared one by (" in sentences.not_confirmed(tied)
    assert_allclose(tied.difference, free.difference, atol=0.05)  # of a linear model, the same


def test_the_test_is_that_of_an_independent_estimate(noisy_block):
    """d' (D + Q)^-1 d without the observation is d' (D - Q)^-1 d with it."""
    block = declared(noisy_block, lever_m=(0.02, -0.03, 0.05), prior=known())
    fit = single_step(block, Model(free=FREE))
    columns = fit.calibration.layout.mount[0, :3]
    Q = fit.calibration.cov[np.ix_(columns, columns)]
    d = fit.calibration.cameras[0].T_b_c.r - block.cameras[0].T_b_c.r
    chi_square = d @ np.linalg.solve(Q + 0.04**2 * np.eye(3), d)
    tied = compared(declared(noisy_block, lever_m=(0.02, -0.03, 0.05), prior=known(0.04)))
    assert tied["lever arm"].p == pytest.approx(stats.chi2.sf(chi_square, 3), rel=0.02)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("sigma_deg", [np.inf, 0.05])
def test_a_kappa_off_by_the_convergence_says_so(noisy_block, sign, sigma_deg):
    turn = (0.0, 0.0, sign * CONVERGENCE_DEG + 0.03)
    found = compared(declared(noisy_block, turn_deg=turn, prior=known(turn_deg=sigma_deg)))
    said = sentences.not_confirmed(found["boresight"])
    assert "meridian convergence, 0.73°" in said
    assert "true or grid north?" in said


@pytest.mark.parametrize("off_deg", [0.0, 0.4, 1.0])
def test_another_kappa_is_not_taken_for_it(noisy_block, off_deg):
    found = compared(declared(noisy_block, turn_deg=(0.0, 0.0, off_deg), prior=known()))
    assert found["boresight"].confirmed


def test_an_undeclared_lever_arm_of_tens_of_metres_is_a_height_system(noisy_block):
    by = np.zeros((9, 3))
    by[:, 2] = 31.0
    lifted = blocks.changed(declared(noisy_block, prior=Prior()), "control_point", by)
    found = compared(lifted)
    assert "m long, and none is declared" in sentences.not_confirmed(found["lever arm"])


def test_p_is_uniform_over_flights(exact_block):
    """Of declared values drawn with their sigma; 40 flights, Kolmogorov-Smirnov at 0.1 %."""
    p = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        block = declared(
            blocks.noisy(exact_block, rng),
            lever_m=rng.normal(0.0, 0.04, 3),
            turn_deg=rng.normal(0.0, 0.01, 3),
            prior=known(0.04, 0.01),
        )
        p += [c.p for c in compared(block).values()]
    assert len(p) == 80
    assert stats.kstest(p, "uniform").pvalue > 0.001
    assert min(p) > ALPHA


def test_the_boresight_is_compared_about_the_bodys_axes(noisy_block):
    turn = np.array([0.5, -0.3, 0.2])
    found = compared(declared(noisy_block, turn_deg=turn, prior=known()))["boresight"]
    (camera,) = single_step(noisy_block, Model(free=FREE)).calibration.cameras
    truth = noisy_block.cameras[0].T_b_c.R
    expected = np.degrees(log(camera.T_b_c.R @ truth.T @ exp(np.radians(turn)).T))
    assert_allclose(found.difference, expected, atol=1e-4)


# --- Tests of several parameters at once


JOINT_TESTS_FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")


def calibration(cov, *, free, free_mount=(), sigma0_sq=1.0):
    """A calibration of one camera with the given covariance."""
    return Calibration(
        cameras=(blocks.CAMERA,),
        layout=layout(1, 0, free=free, free_mount=free_mount),
        cov=np.asarray(cov, dtype=float),
        sigma0_sq=sigma0_sq,
        open_columns=np.zeros(len(cov), dtype=bool),
    )


def moved(camera, mount=0.0, **interior):
    """The camera with parameters changed by the given amounts."""
    changed = {key: getattr(camera.interior, key) + by for key, by in interior.items()}
    lever, turn = np.split(np.broadcast_to(mount, 6), 2)
    T_b_c = Pose(R=camera.T_b_c.R @ exp(turn), r=camera.T_b_c.r + lever)
    return replace(camera, interior=replace(camera.interior, **changed), T_b_c=T_b_c)


def test_two_correlated_parameters_have_a_closed_form():
    """z = (2, 2), rho = -0.99: (4 + 4 + 2 * 0.99 * 4) / (1 - 0.99^2) = 800, of two parameters."""
    sigma = np.array([1e-7, 1e-6])
    cov = np.outer(sigma, sigma) * [[1.0, -0.99], [-0.99, 1.0]]
    said = calibration(cov / 4, free=("p1", "p2"), sigma0_sq=4.0)
    (test,) = group_tests(said, [moved(blocks.CAMERA, p1=2e-7, p2=2e-6)], redundancy=10**6)
    assert test.keys == ("p1", "p2")
    assert test.largest == pytest.approx(2.0)
    assert test.f_ratio == pytest.approx(400.0)
    assert test.p < 1e-100


def test_p_is_that_of_the_f_distribution():
    """F(3, 60) has its 5 % point at 2.758, by a printed table."""
    sigma_m = 0.02
    said = calibration(sigma_m**2 * np.eye(3), free=(), free_mount=LEVER_ARM)
    off = np.sqrt(2.758) * sigma_m * np.repeat([1.0, 0.0], 3)
    (test,) = group_tests(said, [moved(blocks.CAMERA, off)], redundancy=60)
    assert test.f_ratio == pytest.approx(2.758)
    assert test.p == pytest.approx(0.05, abs=1e-4)


def test_a_boresight_is_compared_about_the_cameras_axes():
    """Whatever angles describe it: here with phi of 90 degrees, where they are singular."""
    upright = replace(blocks.CAMERA, T_b_c=Pose(R=exp([0.0, np.pi / 2, 0.0]), r=np.zeros(3)))
    sigma = np.array([1e-4, 2e-4, 3e-4])
    said = replace(
        calibration(np.diag(sigma**2), free=(), free_mount=BORESIGHT), cameras=(upright,)
    )
    off = np.concatenate([np.zeros(3), [3e-4, 0.0, 0.0]])
    (test,) = group_tests(said, [moved(upright, off)], redundancy=100)
    assert 3 * test.f_ratio == pytest.approx(9.0, rel=1e-6)


def test_k1_to_k3_are_significant_together_and_none_is_alone(noisy_block):
    """Their correlations are near -0.99, and each single one may well be zero."""
    found = single_step(noisy_block, Model(free=JOINT_TESTS_FREE))
    redundancy = found.bundle.solution.redundancy
    zero = replace(blocks.CAMERA, interior=Interior(f=50.0))
    radial = group_tests(found.calibration, [zero], redundancy=redundancy)[0]
    assert radial.keys == ("k1", "k2", "k3")
    assert radial.largest < 3
    assert radial.p < 1e-12
    assert nested_f_ratio(found.bundle, radial, [zero]) == pytest.approx(radial.f_ratio, rel=0.01)


@pytest.mark.slow
def test_p_values_of_true_values_are_uniform(exact_block):
    p = []
    for seed in range(60):
        block = blocks.noisy(exact_block, np.random.default_rng(seed))
        found = single_step(block, Model(free=JOINT_TESTS_FREE))
        tests = group_tests(
            found.calibration, [blocks.CAMERA], redundancy=found.bundle.solution.redundancy
        )
        p.append([test.p for test in tests])
    for of_group in np.transpose(p):
        assert stats.kstest(of_group, "uniform").pvalue > 0.0025  # 1 % for the four together
