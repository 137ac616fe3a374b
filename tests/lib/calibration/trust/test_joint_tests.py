"""Tests of several parameters at once."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.bundle.unknowns import layout
from acx4lib.calibration.correlations import nested_f_ratio
from acx4lib.calibration.estimates import Calibration, parameters
from acx4lib.calibration.mounting import single_step
from acx4lib.calibration.trust.joint_tests import GROUPS, group_tests
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, exp
from acx4lib.geometry.parameters import BORESIGHT, LEVER_ARM, MOUNT
from support import blocks

FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")


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


def test_one_parameter_of_a_group_needs_no_joint_test():
    said = calibration(np.diag([1e-3, 1e-7, 1e-7]) ** 2, free=("f", "k1", "p1"))
    assert group_tests(said, [blocks.CAMERA], redundancy=9) == []


def test_what_the_observations_leave_open_is_not_tested():
    said = calibration(np.diag([1e-7, 1e-7]) ** 2, free=("p1", "p2"))
    said = replace(said, open_columns=np.array([False, True]))
    assert group_tests(said, [blocks.CAMERA], redundancy=9) == []


def test_k1_to_k3_are_significant_together_and_none_is_alone(noisy_block):
    """Their correlations are near -0.99, and each single one may well be zero."""
    found = single_step(noisy_block, free=FREE)
    redundancy = found.bundle.solution.redundancy
    zero = replace(blocks.CAMERA, interior=Interior(f=50.0))
    radial = group_tests(found.calibration, [zero], redundancy=redundancy)[0]
    assert radial.keys == ("k1", "k2", "k3")
    assert radial.largest < 3
    assert radial.p < 1e-12
    assert nested_f_ratio(found.bundle, radial, [zero]) == pytest.approx(radial.f_ratio, rel=0.01)


@pytest.mark.parametrize(("share", "agreement"), [(1.0, 3e-3), (0.1, 3e-4), (0.01, 3e-5)])
def test_in_the_linear_limit_a_nested_adjustment_has_the_same_f(exact_block, share, agreement):
    """Without noise both differ in proportion to the step, since the problem bends."""
    found = single_step(exact_block, free=FREE)
    unit = replace(found.calibration, sigma0_sq=1.0)
    sigma = {p.key: share * p.sigma for p in parameters(unit)}
    mount = np.array([sigma[key] for key in MOUNT]) * np.repeat([1.0, np.radians(1.0)], 3)
    other = moved(
        found.calibration.cameras[0], mount, k1=sigma["k1"], p1=sigma["p1"], p2=-sigma["p2"]
    )
    tests = group_tests(unit, [other], redundancy=100)
    assert [test.keys for test in tests] == list(GROUPS)
    nested = [nested_f_ratio(found.bundle, test, [other]) for test in tests]
    chi_squares = np.array(nested) * found.calibration.sigma0_sq
    assert_allclose(chi_squares, [test.f_ratio for test in tests], rtol=agreement)


@pytest.mark.slow
def test_p_values_of_true_values_are_uniform(exact_block):
    p = []
    for seed in range(60):
        block = blocks.noisy(exact_block, np.random.default_rng(seed))
        found = single_step(block, free=FREE)
        tests = group_tests(
            found.calibration, [blocks.CAMERA], redundancy=found.bundle.solution.redundancy
        )
        p.append([test.p for test in tests])
    for of_group in np.transpose(p):
        assert stats.kstest(of_group, "uniform").pvalue > 0.0025  # 1 % for the four together
