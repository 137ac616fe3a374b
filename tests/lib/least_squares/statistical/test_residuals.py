"""Tests of correlated observations against what they claim: the estimate of one wrong one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.reliability import reliability
from acx4lib.least_squares.normal_equations import PlainNormals
from acx4lib.least_squares.problem import Equations
from acx4lib.least_squares.statistical.correlated import SlowErrors
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from acx4lib.least_squares.statistical.w_test import OUT, statistics

M, COLUMNS = 24, 4
TIME_S = np.cumsum(np.r_[np.full(12, 3.0), 120.0, np.full(11, 4.0)])


@pytest.fixture
def adjusted(rng):
    """A line in each of two components, through 24 observations of correlated errors."""

    def adjusted(sigma, **changed):
        process = GaussMarkov(share=0.9, time_constant_s=60.0)
        slow = SlowErrors(sigma=0.9 * SIGMA, together=process.together(TIME_S))
        A = np.zeros((M, 2, COLUMNS))
        A[:, 0, 0] = A[:, 1, 2] = 1.0
        A[:, 0, 1] = A[:, 1, 3] = TIME_S / TIME_S[-1]
        v = V.copy()
        parts = {
            "v": v,
            "sigma": sigma,
            "A": A,
            "columns": np.tile(np.arange(COLUMNS), (M, 1)),
            "correlation": slow.correlation(sigma),
        } | changed
        e = Equations(kind="y", unit=np.arange(M), **parts)
        normals = PlainNormals(
            n_columns=int(parts["columns"].max()) + 1,
            free_points=np.zeros(0, dtype=bool),
            equations=[e],
        )
        dx, _ = normals.step()
        after = e.v + np.einsum("mdk,mk->md", e.A, dx[e.columns])
        at_minimum = Equations(kind="y", unit=np.arange(M), **parts | {"v": after})
        precision = PlainNormals(
            n_columns=normals.n_columns, free_points=normals.free_points, equations=[at_minimum]
        ).precision()
        return precision.groups[0], at_minimum, dx, precision.inverse.dense

    return adjusted


SIGMA = np.random.default_rng(3).uniform(0.5, 2.0, (M, 2))
V = np.random.default_rng(4).normal(size=(M, 2))


def with_own_unknown(e, row, component):
    """The equations with an unknown for the error of one observation."""
    A = np.concatenate([e.A, np.zeros((M, 2, 1))], axis=2)
    A[row, component, -1] = 1.0
    return {"A": A, "columns": np.tile(np.arange(COLUMNS + 1), (M, 1))}


def test_redundancy_numbers_add_up_to_the_degrees_of_freedom(adjusted):
    group, _, _, _ = adjusted(SIGMA)
    assert np.sum(group.redundancy) == pytest.approx(2 * M - COLUMNS, rel=1e-9)
    assert not np.allclose(group.redundancy, group.control)


def test_squares_add_up_to_the_cost(adjusted):
    group, e, _, _ = adjusted(SIGMA)
    assert np.sum(group.squares) == pytest.approx(e.cost, rel=1e-12)


@pytest.mark.parametrize(("row", "component"), [(0, 0), (7, 1), (12, 0), (23, 1)])
def test_w_squared_is_what_an_unknown_for_that_error_takes_off_the_cost(adjusted, row, component):
    group, e, _, _ = adjusted(SIGMA)
    _, with_it, dx, Q = adjusted(SIGMA, **with_own_unknown(e, row, component))
    w = group.w[row, component]
    assert w**2 == pytest.approx(e.cost - with_it.cost, rel=1e-6)
    assert abs(w) == pytest.approx(abs(dx[-1]) / np.sqrt(Q[-1, -1]), rel=1e-6)


def test_the_smallest_error_that_is_found_is_a_multiple_of_its_standard_deviation(adjusted):
    group, e, _, _ = adjusted(SIGMA)
    found = reliability(group, critical=3.0, power=0.5)  # delta_0 is the critical value
    _, _, _, Q = adjusted(SIGMA, **with_own_unknown(e, 7, 1))
    assert found.detectable[7, 1] == pytest.approx(3.0 * np.sqrt(Q[-1, -1]), rel=1e-6)


def test_its_largest_effect_is_in_sigmas_of_any_function_of_the_unknowns(adjusted):
    group, e, _, Q = adjusted(SIGMA)
    bias = reliability(group, critical=3.0, power=0.5).detectable[7, 1]
    error = np.zeros((M, 2))
    error[7, 1] = bias
    dx = Q @ np.einsum("mdk,md->k", e.A, e.weighed(error))
    found = reliability(group, critical=3.0, power=0.5).external[7, 1]
    assert found == pytest.approx(np.sqrt(dx @ np.linalg.solve(Q, dx)), rel=1e-6)


def test_a_rejected_observation_is_tested_as_if_it_alone_were_used_again(adjusted):
    """Its correlation with the others tells what its slow error must have been."""
    within, _, _, _ = adjusted(SIGMA)
    sigma = SIGMA.copy()
    sigma[7] *= OUT
    out = np.zeros((M, 1), dtype=bool)
    out[7] = True
    group, _, _, _ = adjusted(sigma)
    w, controlled = statistics(group, out)
    # both components are out; they share no unknowns
    assert_allclose(w[7], np.abs(within.w[7]), rtol=2e-3)
    assert controlled.all()
