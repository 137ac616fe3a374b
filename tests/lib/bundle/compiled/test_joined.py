"""Points that distances join: compiled against plain, in every kind of bundle."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.compiled import normals
from acx4lib.bundle.compiled.joined import by_points
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.adjustment import of_points
from acx4lib.least_squares.normal_equations import point_normals
from support import blocks

ENDS = np.array([[12, 20], [20, 30], [3, 40], [0, 1], [14, 45], [5, 33], [12, 20]])
"""Two tie points, one of them twice; tie and control; control alone, one or both error-free."""


@pytest.fixture(scope="module")
def block(noisy_block):
    sigma_m = noisy_block.control.sigma_m.copy()
    sigma_m[[1, 5]] = 0.0
    held = replace(noisy_block, control=replace(noisy_block.control, sigma_m=sigma_m))
    off = 0.01 * np.random.default_rng(3).normal(size=len(ENDS))
    return blocks.taped(held, ENDS, sigma=0.01, off=off)


def held(net):
    return uses.with_held_poses(net, net.pose_names[:2], net.start.T_m_b[:2])


NETWORKS = {
    "mounted": lambda b: uses.mounted_orientation(b, free=("f", "xp", "yp")),
    "free": lambda b: uses.free_orientation(b, free=("f", "k1")),
    "held poses": lambda b: held(uses.free_orientation(b, free=("f",))),
    "nothing but poses": lambda b: uses.mounted_orientation(b, free=(), free_mount=()),
}


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_a_step_is_the_plain_one(block, name, damping, form, plain):
    net = NETWORKS[name](block)
    found, expected = net.normals(net.start, damping), plain(net, net.start, damping)
    assert isinstance(found, normals.NetworkNormals)
    assert len(net.distances) == len(ENDS)
    assert found.cost == pytest.approx(expected.cost, rel=1e-12)
    assert found.n_observations == expected.n_observations
    (dx, dp), (dx_0, dp_0) = found.step(), expected.step()
    assert_allclose(dx, dx_0, atol=1e-9 * np.abs(dx_0).max())
    assert_allclose(dp, dp_0, atol=1e-9 * np.abs(dp_0).max())
    assert found.promised == pytest.approx(expected.promised, rel=1e-9)


@pytest.mark.parametrize("name", NETWORKS)
def test_covariances_and_tests_are_the_plain_ones(block, name, form, plain):
    net = NETWORKS[name](block)
    state, _ = adjustment.solve(net, net.start)
    found, expected = net.normals(state).precision(), plain(net, state).precision()
    sigma = np.sqrt(np.diag(expected.inverse.dense))
    scale = np.outer(sigma, sigma)
    assert_allclose(found.inverse.dense / scale, expected.inverse.dense / scale, atol=1e-9)
    sigma = np.sqrt(np.maximum(np.einsum("pii->pi", expected.cov_points), 1e-30))
    scale = sigma[:, :, None] * sigma[:, None, :]
    assert_allclose(found.cov_points / scale, expected.cov_points / scale, atol=1e-9)
    for group, oracle in zip(found.groups, expected.groups, strict=True):
        assert group.kind == oracle.kind
        assert_allclose(group.redundancy, oracle.redundancy, atol=1e-9)


def test_observations_of_some_points_are_those_of_all(block):
    net = NETWORKS["free"](block)
    equations = [e for e in net.equations(net.start)[1:] if e.B is not None]
    points = net.observed_points
    V, h = point_normals(np.ones(net.n_points, dtype=bool), equations)
    found = by_points(points, equations)
    assert_allclose(found[0], V[points], rtol=1e-14)
    assert_allclose(found[1], h[points], rtol=1e-14)
    own, rows = of_points(equations[0], points[:3])
    assert set(points[own.point]) <= set(points[:3])
    assert_allclose(own.v, equations[0].v[rows])
