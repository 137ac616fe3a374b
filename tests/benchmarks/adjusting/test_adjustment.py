"""The benchmark measures one problem: solvable, read alike by all, with one cost for all."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib.bundle import adjust
from acx4lib.geometry.frames import exp, log
from benchmarks import harness
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
def small():
    return bench_blocks.network(bench_blocks.make(SMALL))


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


@pytest.mark.parametrize("name", bench_blocks.LAYOUTS)
def test_layouts_have_their_number_of_images(name):
    assert sum(strip.n for strip in bench_blocks.LAYOUTS[name]) == int(name)


def test_the_forward_overlaps_are_those_of_the_papers_blocks(made):
    camera = bench_blocks.TRUTH
    forward_m = camera.width_px * camera.pixel_mm / camera.interior.f
    overlap = {
        name: {round(1 - s.base_m / (s.height_m * forward_m), 2) for s in strips}
        for name, strips in bench_blocks.LAYOUTS.items()
    }
    assert overlap == {"52": {0.80}, "268": {0.60}, "1000": {0.60}, "4000": {0.60}}


def test_there_are_as_many_tie_points_as_asked_and_each_has_two_rays(made):
    assert len(made.block.points) - len(made.block.control) == 500
    assert made.block.rays[len(made.block.control) :].min() >= 2


def test_start_values_lie_off_the_truth_as_stated(made, network):
    ties = np.arange(len(made.block.control), network.n_points)
    off = np.abs(network.start.x_m - made.x_m)[ties].max(axis=0)
    # the largest of 500 uniform ones lies within 2 % of the bound in all but e-5 of seeds
    assert_allclose(off, bench_blocks.START_TIES_M, rtol=0.02)
    assert network.start.interiors[0].to_array().tolist() == [74.0] + 9 * [0.0]
    assert_array_equal(network.start.T_b_c.R[0], np.eye(3))
    assert_array_equal(network.start.T_b_c.r[0], np.zeros(3))
    assert network.left_out == {}


def test_the_same_seed_gives_the_same_block(made):
    again = bench_blocks.make(bench_blocks.DESIGNS["a500"])
    assert_array_equal(again.block.image_points.colrow, made.block.image_points.colrow)


# --- the file --------------------------------------------------------------------------------


def test_a_network_comes_back_from_its_file(network, problem):
    read = bench_blocks.read_problem(problem)
    for ours, theirs in zip(
        network.residuals(network.start), read.residuals(read.start), strict=True
    ):
        assert_array_equal(theirs[0], ours[0])
        assert_array_equal(theirs[1], ours[1])
    assert_array_equal(read.layout.pose, network.layout.pose)
    assert_array_equal(read.layout.mount, network.layout.mount)
    assert_array_equal(read.layout.interior, network.layout.interior)


def test_a_network_with_images_that_share_poses_has_no_file(small, tmp_path):
    shared = replace(small, pose_idx=np.zeros_like(small.pose_idx))
    with pytest.raises(ValueError, match="one image per exposure"):
        bench_blocks.write_problem(shared, tmp_path / "problem")


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


def test_a_difference_of_parameters_is_told_in_sigma():
    ours = {
        "interior": [74.0] + 7 * [0.0],
        "lever": [0.0, 0.0, 0.0],
        "boresight_opk": [0.0, 0.0, 0.0],
        "sigma": 8 * [0.1] + 3 * [0.01] + 3 * [1e-4],
        "cost": 100.0,
    }
    exact = {**ours, "boresight_opk": [0.0, 0.0, 5e-4], "lever": [0.0, 0.03, 0.0]}
    exact["sigma"] = 8 * [0.1] + 3 * [9.0] + [0.01, 0.01, 0.011]  # angles, then the lever arm
    found = adjustment.agreed("a500", ours, {"cost": 101.0}, exact)
    assert_allclose(found["parameters_sigma"], 5.0)
    assert_allclose(found["cost_timed"], 0.01)
    assert_allclose(found["sigma"], 0.1)


# --- pycolmap ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def free(tmp_path_factory):
    """A network that pycolmap can state, too, and its file."""
    made = bench_blocks.pinhole_network(bench_blocks.make(SMALL))
    path = tmp_path_factory.mktemp("free") / "problem"
    bench_blocks.write_problem(made, path)
    return made, path


@pytest.mark.parametrize("solver", adjustment.PYCOLMAP)
def test_pycolmap_has_our_cost_at_the_start_and_at_the_end(free, solver):
    pytest.importorskip("pycolmap", reason=adjustment.NO_PYCOLMAP)
    network, path = free
    run = adjustment.runner(path, None, free=True)
    found, ours = run(solver), run("ours")
    start = sum(np.sum((v / s) ** 2) for v, s in network.residuals(network.start))
    assert_allclose(found["start_cost"], start, rtol=1e-9)  # pixels of 1e4 less others
    assert_allclose(found["cost"], ours["cost"], rtol=1e-9)
    assert found["converged"]
    # thousandths of a sigma of GNSS, which is 5 cm
    assert_allclose(found["position"], ours["position"], atol=5e-5)


def test_a_block_without_lens_is_adjusted_within_its_sigma(free):
    network, _ = free
    found = adjust.adjust(network)
    assert found.solution.chi_square_p > 1e-3
    interior = found.state.interiors[0].to_array()
    sigma = np.sqrt(found.solution.inverse.at(np.arange(3), np.arange(3)))
    # the corrected points have the true focal length, and their principal point in the middle
    off = (interior[:3] - [bench_blocks.TRUTH.interior.f, 0, 0]) / sigma
    assert np.abs(off).max() < 4


def test_pycolmap_runs_on_its_own_problems_where_it_is_installed(monkeypatch):
    assert set(adjustment.solvers("free-5k", None)) <= {"ours", *adjustment.PYCOLMAP}
    monkeypatch.setattr(adjustment, "find_spec", lambda _: None)
    assert adjustment.solvers("free-5k", Path("program")) == ("ours",)


# --- the measuring ---------------------------------------------------------------------------


def test_solvers_take_turns_and_what_is_slower_in_all_respects_has_only_one():
    seconds = {
        "ours": (0.1, 0.1),
        "ceres_automatic_dense_1": (1.0, 1.0),
        "ceres_automatic_dense_2": (0.5, 1.3),  # takes less time, though more of the processor
        "ceres_automatic_sparse_1": (1.3, 1.3),
        "ceres_analytic_sparse_1": (1.3, 1.3),  # the only one with its derivatives
    }
    rows, order = [], []
    for number, solver in adjustment.turns(tuple(seconds), 2, rows):
        wall_s, cpu_s = seconds[solver]
        order.append((number, solver))
        rows.append({"solver": solver, "run": number, "wall_s": wall_s, "cpu_s": cpu_s})
    again = [solver for solver in seconds if solver != "ceres_automatic_sparse_1"]
    assert order == [(1, solver) for solver in seconds] + [(2, solver) for solver in again]


def test_all_ways_of_ceres_run_on_every_size_and_none_where_it_is_missing():
    for name in set(bench_blocks.DESIGNS) - set(adjustment.ALONE):
        assert set(adjustment.CERES) <= set(adjustment.solvers(name, Path("program")))
    assert adjustment.solvers("a500", None) == ("ours",)


def test_our_process_reports_time_and_the_memory_of_the_adjustment(problem, adjusted):
    script = Path(adjustment.HERE, "ours.py")
    done = subprocess.run(
        [sys.executable, str(script), str(problem)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | harness.ENVIRONMENT,
    )
    found = json.loads(done.stdout)
    assert_allclose(found["cost"], adjusted.solution.cost, rtol=1e-12)
    assert 0 < found["growth_mb"] < found["peak_mb"]
    assert 0 < found["wall_s"] < 60


@pytest.mark.slow
def test_a_benchmark_has_a_row_for_every_run():
    design = {"sweep-30": bench_blocks.Design(layout="52", ties=30)}
    rows, about = adjustment.of_problems(design, ceres=None, repeat=2)
    assert [row["run"] for row in rows] == [1, 2]
    assert rows[0]["points"] == 86
    assert tuple(rows[0]) == adjustment.COLUMNS
    assert about["agreement"] == []


def test_rotations_of_the_file_turn_as_in_the_library(adjusted, ceres):
    """Attitudes of Ceres, in angles, are ours: compared as rotations."""
    found = ceres("ceres_analytic_dense_1")
    from_angles = bench_blocks.rotation_from_opk(np.reshape(found["attitude_opk"], (-1, 3)))
    apart = log(np.swapaxes(adjusted.state.T_m_b.R, 1, 2) @ from_angles)
    assert np.abs(apart).max() < 1e-8  # 1e-4 of sigma, which is 1e-4 rad
    assert_allclose(exp(apart), np.tile(np.eye(3), (len(apart), 1, 1)), atol=1e-8)
