"""The benchmark measures one problem: solvable, read alike by all, with one cost for all."""

import json
import subprocess

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import adjust
from acx4lib.geometry.frames import log
from benchmarks.adjusting import adjustment, bench_blocks

pytestmark = [pytest.mark.slow, pytest.mark.repeats]

SMALL = bench_blocks.Design(layout="52", ties=60)


@pytest.fixture(scope="module")
def made():
    return bench_blocks.make(bench_blocks.DESIGNS["a500"])


@pytest.fixture(scope="module")
def network(made):
    return bench_blocks.network(made)


@pytest.fixture(scope="module")
def adjusted(network):
    return adjust.adjust(network)


@pytest.fixture(scope="module")
def problem(network, tmp_path_factory):
    path = tmp_path_factory.mktemp("problem") / "a500"
    bench_blocks.write_problem(network, path)
    return path


@pytest.fixture(scope="module")
def ceres(problem):
    """Solve the problem with Ceres in one of its ways."""
    try:
        program = adjustment.build_ceres()
    except adjustment.NoCeres as why:
        pytest.skip(str(why))

    def solve(solver):
        command = adjustment.ceres_command(program, problem, solver)
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return json.loads(done.stdout)

    return solve


# --- the blocks ------------------------------------------------------------------------------


def test_the_truth_of_a_block_is_recovered(made, adjusted):
    """14 parameters, normal errors: their chi-square of 14 is below 36.1 in 99.9 % of seeds."""
    truth, found = bench_blocks.TRUTH, adjusted.cameras[0]
    error = np.concatenate(
        [
            (found.interior.to_array() - truth.interior.to_array())[:8],
            found.T_b_c.r - truth.T_b_c.r,
            log(truth.T_b_c.R.T @ found.T_b_c.R),
        ]
    )
    cov = adjusted.solution.cov[:14, :14]
    assert error @ np.linalg.solve(cov, error) < 36.1
    assert adjusted.solution.chi_square_p > 1e-3


def test_points_are_recovered_within_their_covariances(made, adjusted):
    """Normalised squares of three coordinates have mean 3, here to 10 % over 556 points."""
    error = adjusted.state.x_m - made.x_m
    weights = np.linalg.inv(adjusted.solution.cov_points)
    assert_allclose(np.mean(np.einsum("pi,pij,pj->p", error, weights, error)), 3.0, rtol=0.1)


# --- the file --------------------------------------------------------------------------------


# --- Ceres --------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", adjustment.CERES)
def test_ceres_has_our_cost_at_the_start_and_at_the_end(network, adjusted, ceres, solver):
    found = ceres(solver)
    start = sum(np.sum((v / s) ** 2) for v, s in network.residuals(network.start))
    assert_allclose(found["start_cost"], start, rtol=1e-12)  # rounding of 14 000 terms
    assert_allclose(found["cost"], adjusted.solution.cost, rtol=1e-10)  # its stopping criterion
    assert found["converged"]


def test_ceres_finds_our_parameters_and_standard_deviations(adjusted, ceres):
    found = ceres("ceres_covariance")
    sigma = np.sqrt(np.diagonal(adjusted.solution.cov)[:14])
    ours = {
        "interior": adjusted.state.interiors[0].to_array()[:8].tolist(),
        "lever": adjusted.state.T_b_c.r[0].tolist(),
        "cost": adjusted.solution.cost,
        "boresight_opk": adjusted.state.T_b_c.opk[0].tolist(),
        "sigma": sigma.tolist(),
    }
    agreed = adjustment.agreed("a500", ours, found, found)
    assert agreed["parameters_sigma"] < 1e-4
    assert agreed["sigma"] < 1e-8
    # positions, which only Ceres reports in full
    position = np.reshape(found["position"], (-1, 3)) - adjusted.state.T_m_b.r
    sigma_position = np.sqrt(np.diagonal(adjusted.solution.cov)[14:]).reshape(-1, 6)[:, :3]
    assert np.abs(position / sigma_position).max() < 1e-4


# --- pycolmap ----------------------------------------------------------------------------------


# --- the measuring ---------------------------------------------------------------------------
