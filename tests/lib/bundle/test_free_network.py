"""Free networks against the bordered normal equations, and against other datums."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust, free_orientation
from acx4lib.bundle.free_network import adjust_free, datum_defect
from acx4lib.bundle.unknowns import holding
from acx4lib.model import Model
from support.helpers import dense_jacobian

FREE = ("f", "xp", "yp")


def alone(block):
    """Return a block without control."""
    return replace(block, control=block.control[:0])


def network(block):
    return free_orientation(block, Model(free=FREE))


@pytest.fixture(scope="module")
def net(noisy_block):
    return network(alone(noisy_block))


@pytest.fixture(scope="module")
def fit(net):
    return adjust_free(net)


def helmert(x_m):
    """Return d(points) / d(shifts, turns, scale), written out, shape (3 n, 7)."""
    x, y, z = (x_m - x_m.mean(axis=0)).T
    o, i = np.zeros_like(x), np.ones_like(x)
    rows = [[i, o, o, o, z, -y, x], [o, i, o, -z, o, x, y], [o, o, i, y, -x, o, z]]
    return np.transpose(rows, (2, 0, 1)).reshape(-1, 7)


def by_borders(net, state):
    """Return the inverse of the normal equations bordered by the inner constraints."""
    J = dense_jacobian(net, state)
    H = np.zeros((J.shape[1], 7))
    H[net.n_columns :] = helmert(state.x_m[net.free_points])
    scale = 1 / np.linalg.norm(J, axis=0)
    border = scale[:, None] * H
    border /= np.linalg.norm(border, axis=0)
    N = (J * scale).T @ (J * scale)
    whole = np.block([[N, border], [border.T, np.zeros((7, 7))]])
    return scale[:, None] * np.linalg.inv(whole)[: len(N), : len(N)] * scale


# --- the datum -------------------------------------------------------------------------------


@pytest.mark.parametrize(("n_control", "n_open"), [(0, 7), (1, 4), (2, 1), (3, 0), (9, 0)])
def test_control_points_leave_so_many_motions_open(noisy_block, n_control, n_open):
    some = replace(
        noisy_block, control=noisy_block.control[[0, 4, 6, 8, 1, 2, 3, 5, 7][:n_control]]
    )
    assert datum_defect(network(some)) == n_open


def test_error_free_control_is_a_datum_too(noisy_block):
    control = noisy_block.control[[0, 8]]
    exact = replace(control, sigma_m=np.zeros((2, 3)))
    assert datum_defect(network(replace(noisy_block, control=exact))) == 1


def test_with_a_datum_inner_constraints_add_nothing(noisy_block):
    found, usual = adjust_free(network(noisy_block)), adjust(network(noisy_block))
    assert found.n_open == 0
    assert_allclose(found.inner.state.x_m, usual.state.x_m, atol=1e-9)


# --- covariances -----------------------------------------------------------------------------


def test_covariances_are_those_of_the_bordered_normal_equations(net, fit):
    found = fit.inner
    expected = by_borders(net, found.state)
    n, free = net.n_columns, np.flatnonzero(net.free_points)
    sigma = np.sqrt(np.diag(expected))
    columns = np.outer(sigma[:n], sigma[:n])
    assert_allclose(found.solution.cov / columns, expected[:n, :n] / columns, atol=1e-6)
    for i, point in enumerate(free):
        own = slice(n + 3 * i, n + 3 * i + 3)
        scale = np.outer(sigma[own], sigma[own])
        cov = found.solution.cov_points[point]
        assert_allclose(cov / scale, expected[own, own] / scale, atol=1e-6)


def test_residuals_do_not_depend_on_the_datum(net, fit):
    """Other minimal constraints: all of the first pose, and the second one's distance from it."""
    away = np.abs(net.start.T_m_b.r[1] - net.start.T_m_b.r[0]).argmax()
    held = [*net.layout.pose[0], net.layout.pose[1, away]]
    other = adjust(replace(net, layout=holding(net.layout, np.array(held))))
    inner, interior = fit.inner, net.layout.interior
    own = interior[interior >= 0]
    assert fit.n_open == 7
    assert inner.solution.redundancy == other.solution.redundancy
    assert inner.solution.sigma0_sq == pytest.approx(other.solution.sigma0_sq, rel=1e-9)
    for a, b in zip(inner.solution.groups, other.solution.groups, strict=True):
        assert_allclose(a.v[a.used], b.v[b.used], atol=1e-5)
        assert_allclose(a.redundancy[a.used], b.redundancy[b.used], atol=1e-6)
    a, b = (one.state.interiors[0].to_array() for one in (inner, other))
    assert_allclose(a, b, atol=1e-6)
    at = np.ix_(own, own)
    assert_allclose(inner.solution.cov[at], other.solution.cov[at], rtol=1e-5, atol=1e-12)
    traces = [np.einsum("pii->", one.solution.cov_points) for one in (inner, fit.minimal, other)]
    assert traces[0] < traces[1] < 1e3 * traces[0]
    assert traces[0] < traces[2]
