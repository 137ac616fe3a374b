"""Free networks against the bordered normal equations, and against other datums."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation, with_held_poses
from acx4lib.bundle.compiled import packing
from acx4lib.bundle.free_network import adjust_free, datum_defect
from acx4lib.bundle.reliability import parameter_effects
from acx4lib.bundle.unknowns import holding
from acx4lib.errors import AdjustmentError
from acx4lib.least_squares.adjustment import cross_covariance
from acx4lib.least_squares.normal_equations import PlainNormals
from support import blocks
from support.helpers import dense_jacobian, weighted_residuals

FREE = ("f", "xp", "yp")


def alone(block):
    """Return a block without control."""
    return replace(block, control=block.control[:0])


def network(block):
    return free_orientation(block, free=FREE)


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


def by_borders(net, state, chosen):
    """Return the inverse of the normal equations bordered by the inner constraints."""
    J = dense_jacobian(net, state)
    free, n = np.flatnonzero(net.free_points), net.n_columns
    H = np.zeros((J.shape[1], 7))
    rows = n + 3 * np.flatnonzero(chosen[free])[:, None] + np.arange(3)
    H[rows.ravel()] = helmert(state.x_m[free[chosen[free]]])
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


def test_error_free_control_and_held_poses_are_a_datum_too(noisy_block):
    control = noisy_block.control[[0, 8]]
    exact = replace(control, sigma_m=np.zeros((2, 3)))
    assert datum_defect(network(replace(noisy_block, control=exact))) == 1
    net = network(alone(noisy_block))
    for n, n_open in ((1, 1), (2, 0)):  # one pose leaves the scale
        held = with_held_poses(net, net.pose_names[:n], net.start.T_m_b[:n])
        assert datum_defect(held) == n_open


def test_with_a_datum_inner_constraints_add_nothing(noisy_block):
    found, usual = adjust_free(network(noisy_block)), adjust(network(noisy_block))
    assert found.n_open == 0
    assert_allclose(found.inner.state.x_m, usual.state.x_m, atol=1e-9)


TRUTH = blocks.standard_points()
ENDS = np.array([[11, 20], [12, 31], [13, 42], [14, 25], [15, 36], [16, 47], [17, 28], [11, 39]])
"""Pairs of tie points, hundreds of metres apart."""


# --- covariances -----------------------------------------------------------------------------


@pytest.fixture(params=["all points", "five points"])
def chosen(request, net):
    out = net.free_points.copy()
    if request.param == "five points":
        out[:] = False
        out[np.flatnonzero(net.free_points)[[0, 3, 9, 20, 31]]] = True
    return out


def test_covariances_are_those_of_the_bordered_normal_equations(net, chosen):
    found = adjust_free(net, chosen).inner
    expected = by_borders(net, found.state, chosen)
    n, free = net.n_columns, np.flatnonzero(net.free_points)
    sigma = np.sqrt(np.diag(expected))
    columns = np.outer(sigma[:n], sigma[:n])
    assert_allclose(found.solution.cov / columns, expected[:n, :n] / columns, atol=1e-6)
    for i, point in enumerate(free):
        own = slice(n + 3 * i, n + 3 * i + 3)
        scale = np.outer(sigma[own], sigma[own])
        cov = found.solution.cov_points[point]
        assert_allclose(cov / scale, expected[own, own] / scale, atol=1e-6)
    J = np.linspace(-1, 1, 2 * n).reshape(2, n) / sigma[:n]
    assert_allclose(found.solution.inverse.times(J), J @ found.solution.cov, atol=1e-9)


def test_points_stay_in_their_place_on_average(net, chosen):
    found = adjust_free(net, chosen).inner
    moved = (found.state.x_m - net.start.x_m)[chosen].ravel()
    assert np.abs(moved).max() > 0.01
    assert_allclose(helmert(found.state.x_m[chosen]).T @ moved, 0.0, atol=1e-4)  # of 1e3 m each


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
    # the state itself has the same residuals as the one that was adjusted
    assert_allclose(
        weighted_residuals(net, inner.state), weighted_residuals(net, other.state), atol=1e-4
    )


def test_errors_of_points_are_as_large_as_their_sigma(exact_block):
    """The sum of the points' squared errors has the trace as its mean, over 25 draws."""
    block, sums = alone(exact_block), []
    reference = adjust_free(network(block))
    x_m, used = reference.inner.state.x_m, network(block).free_points
    Q = by_borders(network(block), reference.inner.state, used)[network(block).n_columns :]
    Q = Q[:, -3 * int(used.sum()) :]
    rng = np.random.default_rng(5)
    for _ in range(25):
        net = network(blocks.noisy(block, rng))
        net = replace(net, start=replace(net.start, x_m=x_m))
        d = (adjust_free(net).inner.state.x_m - x_m)[used]
        sums.append(float(np.sum(d**2)))
    spread = np.sqrt(2 * np.sum(Q**2) / len(sums))
    assert abs(np.mean(sums) - np.trace(Q)) < 4 * spread


# --- forms -----------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["banded", "plain"])
def test_every_form_of_the_normal_equations_gives_the_same(net, fit, monkeypatch, form):
    if form == "plain":
        monkeypatch.setattr("acx4lib.bundle.network.COMPILED", False)
        assert isinstance(net.normals(net.start), PlainNormals)
    monkeypatch.setattr(packing, "DENSE_COLUMNS", 0)
    monkeypatch.setattr(packing, "DENSE_SHARE", 2.0)
    found, expected = adjust_free(network(net.block)).inner, fit.inner
    assert_allclose(found.state.x_m, expected.state.x_m, atol=1e-5)
    sigma = np.sqrt(np.diag(expected.solution.cov))
    scale = np.outer(sigma, sigma)
    assert_allclose(found.solution.cov / scale, expected.solution.cov / scale, atol=1e-5)
    assert_allclose(found.solution.cov_points, expected.solution.cov_points, rtol=1e-4, atol=1e-9)
    assert_allclose(
        found.camera_pose_covariances, expected.camera_pose_covariances, rtol=1e-3, atol=1e-9
    )


def test_what_depends_on_the_datum_is_refused_in_words(net, fit):
    with pytest.raises(ValueError, match="take that with minimal constraints"):
        cross_covariance(net, fit.inner.state, fit.inner.solution, np.array([0]))
    with pytest.raises(ValueError, match="take that with minimal constraints"):
        parameter_effects(fit.inner, np.array([0]))
    assert len(parameter_effects(fit.minimal, np.array([0]))) == len(fit.minimal.solution.groups)


def test_other_networks_and_too_few_points_are_refused(net, noisy_block):
    with pytest.raises(ValueError, match="free_orientation"):
        adjust_free(mounted_orientation(noisy_block, free=FREE))
    with pytest.raises(ValueError, match="refraction"):
        datum_defect(replace(net, refraction="standard"))
    with pytest.raises(ValueError, match="points"):
        adjust_free(net, np.array([1, 2]))
    two = np.zeros(net.n_points, dtype=bool)
    two[np.flatnonzero(net.free_points)[:2]] = True
    with pytest.raises(AdjustmentError, match="2 points do not fix the 7 motions"):
        adjust_free(net, two)
