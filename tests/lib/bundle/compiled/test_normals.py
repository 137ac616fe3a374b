"""Compiled normal equations equal the plain ones."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4lib.bundle import adjust
from acx4lib.bundle.compiled import normals, packing
from acx4lib.bundle.compiled.normals import by_points
from acx4lib.bundle.observations import PoseObservations
from acx4lib.bundle.unknowns import holding
from acx4lib.geometry.parameters import Prior
from acx4lib.least_squares import adjustment, processors
from acx4lib.least_squares.adjustment import of_points
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.least_squares.normal_equations import PlainNormals, point_normals
from acx4lib.least_squares.reduced_system import BandedInverse
from acx4lib.model import Model
from support.flights.simulated import read_back


@pytest.fixture(scope="session")
def plain():
    """Return what computes the plain normal equations, which the compiled ones must equal."""

    def plain(net, state, damping=0.0):
        return PlainNormals(
            n_columns=net.n_columns,
            free_points=net.free_points,
            equations=net.equations(state),
            damping=damping,
        )

    return plain


@pytest.fixture(params=["dense", "banded"])
def form(request, monkeypatch):
    """Make the reduced system of any block dense, or any banded."""
    if request.param == "banded":
        monkeypatch.setattr(packing, "DENSE_COLUMNS", 0)
        monkeypatch.setattr(packing, "DENSE_SHARE", 2.0)
    return request.param


# --- the compiled normal equations against the plain ones, for every kind of bundle ----------


ALL = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2", "b1", "b2")
SIGMAS = 1e-10  # of a step and of covariances, in standard deviations: the bound


@pytest.fixture(scope="module")
def flight():
    options = acx4sim.Options(
        tie_points={"heads": 60, "calibration": 150}, blocks=("heads", "calibration")
    )
    return read_back(acx4sim.acx4_ideal(options=options)).flight


def with_positions(block):
    n = len(block.images)
    observed = PoseObservations(
        T_m_b=block.T_m_b_images,
        R_g_m=block.trajectory.R_g_m[block.images.exposure_idx],
        sigma_position=block.trajectory.sigma_position[block.images.exposure_idx],
        sigma_attitude=np.full((n, 3), np.inf),
    )
    return adjust.free_orientation(block, Model(free=("f", "xp")), positions=observed)


def with_declared_mountings(block):
    """One camera has a lever arm with sigma, another all, f and yp, too; the others nothing."""
    lever = Prior(declared=(True,) * 3 + (False,) * 3, sigma=(0.02, 0.03, 0.04) + (np.inf,) * 3)
    everything = Prior(
        declared=(True,) * 6,
        sigma=(0.01, np.inf, 0.02, 1e-4, 2e-4, 3e-4),
        interior=(0.05, np.inf, 0.01),
    )
    priors = (lever, everything, *(Prior() for _ in block.cameras[2:]))
    cameras = tuple(
        replace(camera, prior=prior) for camera, prior in zip(block.cameras, priors, strict=True)
    )
    return adjust.mounted_orientation(replace(block, cameras=cameras), Model(free=ALL[:4]))


def slowly(block, gnss=()):
    """Errors of positions and attitudes are correlated; one position takes no part."""
    sigma = block.trajectory.sigma_position.copy()
    sigma[4] = np.inf
    trajectory = replace(
        block.trajectory,
        sigma_position=sigma,
        slow_positions=GaussMarkov(share=0.9, time_constant_s=120.0),
        slow_attitudes=GaussMarkov(share=0.6, time_constant_s=30.0),
    )
    return adjust.mounted_orientation(
        replace(block, trajectory=trajectory), Model(free=ALL[:4], gnss=gnss)
    )


def with_held_control(block):
    sigma_m = block.control.sigma_m.copy()
    sigma_m[::3] = 0.0  # error-free
    sigma_m[1, 2] = np.inf  # a height that was taken out
    held = replace(block, control=replace(block.control, sigma_m=sigma_m))
    return adjust.free_orientation(held, Model(free=ALL[:5]))


def with_held_poses(net, every=3):
    """Some poses are held at their approximate values."""
    columns = net.layout.pose[1::every]
    return net.with_layout(holding(net.layout, columns[columns >= 0]))


NETWORKS = {
    "single step": lambda f: adjust.mounted_orientation(f.calibration, Model(free=ALL[:8])),
    "all interior": lambda f: adjust.mounted_orientation(f.calibration, Model(free=ALL)),
    "boresight only": lambda f: adjust.mounted_orientation(
        f.calibration, Model(fix=("lever_arm",))
    ),
    "refraction": lambda f: adjust.mounted_orientation(
        f.calibration, Model(free=("f",), refraction="standard")
    ),
    "distortion at the measured points": lambda f: replace(
        adjust.mounted_orientation(f.calibration, Model(free=ALL)), distortion_at="measured"
    ),
    "a rig of four heads": lambda f: adjust.mounted_orientation(
        f.heads, Model(free=("f", "xp", "yp", "k1"))
    ),
    "declared mountings of a rig": lambda f: with_declared_mountings(f.heads),
    "free exteriors": lambda f: adjust.free_orientation(f.calibration, Model(free=ALL[:3])),
    "positions observed": lambda f: with_positions(f.calibration),
    "held control": lambda f: with_held_control(f.calibration),
    "a shift and drifts of GNSS positions": lambda f: adjust.mounted_orientation(
        f.calibration, Model(free=ALL[:3], gnss=("shift", "drift"))
    ),
    "errors that change slowly": lambda f: slowly(f.calibration),
    "slow errors, delays, shift and drifts of a rig": lambda f: slowly(
        f.heads, gnss=("shift", "drift", "delay", "deviation")
    ),
    "slow errors beside held poses": lambda f: with_held_poses(slowly(f.calibration)),
    "held poses": lambda f: with_held_poses(
        adjust.mounted_orientation(f.calibration, Model(free=ALL[:5]))
    ),
    "held poses of free exteriors": lambda f: with_held_poses(
        adjust.free_orientation(f.calibration, Model(free=("f",))), every=8
    ),
    "all poses held": lambda f: with_held_poses(
        with_held_poses(adjust.mounted_orientation(f.heads, Model(free=("f",))), every=2)
    ),
    "a shift in height of a rig": lambda f: adjust.mounted_orientation(
        f.heads, Model(free=("f",), fix=("lever_arm",), gnss=("shift",))
    ),
}


@pytest.fixture(params=[1, 3], ids=["one part", "three parts"])
def parts(request, monkeypatch):
    monkeypatch.setattr(packing, "RAYS_PER_PART", 1 if request.param > 1 else 10**9)
    monkeypatch.setattr(packing, "MOST_PARTS", request.param)


def assert_equal_normals(compiled, oracle):
    assert isinstance(compiled, normals.NetworkNormals)
    assert compiled.n_observations == oracle.n_observations
    assert compiled.cost == pytest.approx(oracle.cost, rel=1e-13)
    (dx, dp), (dx_0, dp_0) = compiled.step(), oracle.step()
    # steps in units of the step: far from the minimum they are many sigma
    sigma = np.sqrt(np.diag(oracle.precision().inverse.dense))
    assert_allclose(dx / sigma, dx_0 / sigma, atol=1e-9 * np.abs(dx_0 / sigma).max())
    assert_allclose(dp, dp_0, atol=1e-9 * np.abs(dp_0).max())
    assert compiled.promised == pytest.approx(oracle.promised, rel=1e-9)
    n = compiled.n_columns - np.count_nonzero(compiled.pose_columns >= 0)
    (rows, right), (rows_0, right_0) = compiled.first_rows(n), oracle.first_rows(n)
    assert_allclose(rows * sigma[:n, None] * sigma, rows_0 * sigma[:n, None] * sigma, atol=1e-8)
    assert_allclose(right * sigma, right_0 * sigma, atol=1e-9 * np.abs(right_0 * sigma).max())


@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_a_step_is_the_plain_one(flight, name, damping, form, plain):
    net = NETWORKS[name](flight)
    assert_equal_normals(net.normals(net.start, damping), plain(net, net.start, damping))


def test_parts_change_nothing(flight, form, parts, plain):
    net = NETWORKS["a rig of four heads"](flight)
    assert_equal_normals(net.normals(net.start), plain(net, net.start))


@pytest.mark.parametrize("name", ["a rig of four heads", "single step"])
def test_memory_that_was_taken_over_changes_nothing(flight, name, form, plain):
    """Nor what the normal equations return that had it before."""
    net = NETWORKS[name](flight)
    before = net.normals(net.start)
    state = net.moved(net.start, *before.step())
    assert_equal_normals(net.normals(state, 0.0, before), plain(net, state))
    assert_equal_normals(before, plain(net, net.start))
    found, expected = before.precision(), net.normals(net.start).precision()
    assert_allclose(found.cov_points, expected.cov_points, atol=0)
    assert_allclose(found.inverse.dense, expected.inverse.dense, atol=0)


@pytest.mark.parametrize("name", NETWORKS)
def test_covariances_and_tests_are_the_plain_ones(flight, name, form, plain):
    net = NETWORKS[name](flight)
    state, _ = adjustment.solve(net, net.start)
    found, expected = net.normals(state).precision(), plain(net, state).precision()
    assert isinstance(found.inverse, BandedInverse) == (form == "banded")
    sigma = np.sqrt(np.diag(expected.inverse.dense))
    assert_allclose(
        found.inverse.dense / np.outer(sigma, sigma),
        expected.inverse.dense / np.outer(sigma, sigma),
        atol=SIGMAS,
    )
    sigma = np.sqrt(np.maximum(np.einsum("pii->pi", expected.cov_points), 1e-30))
    scale = sigma[:, :, None] * sigma[:, None, :]
    assert_allclose(found.cov_points / scale, expected.cov_points / scale, atol=SIGMAS)
    for group, oracle in zip(found.groups, expected.groups, strict=True):
        assert group.kind == oracle.kind
        assert_allclose(group.v, oracle.v, atol=1e-9)  # px, m, rad
        assert_allclose(group.sigma, oracle.sigma, rtol=1e-15)
        assert_allclose(group.redundancy, oracle.redundancy, atol=1e-10)


def test_a_point_measured_twice_in_one_image_counts_twice(flight, plain):
    block = flight.calibration
    again = np.concatenate([np.arange(len(block.image_points)), [3, 40]])
    doubled = replace(block, image_points=block.image_points[again])
    net = adjust.mounted_orientation(doubled, Model(free=("f",)))
    assert_equal_normals(net.normals(net.start), plain(net, net.start))


def test_a_point_behind_a_camera_costs_infinitely_much(flight, plain):
    net = NETWORKS["single step"](flight)
    turned = replace(net.start.T_m_b, R=net.start.T_m_b.R @ np.diag([1.0, -1.0, -1.0]))
    state = replace(net.start, T_m_b=turned)
    assert net.normals(state).cost == np.inf
    assert plain(net, state).cost == np.inf


class Plain:
    """A network without compiled normal equations."""

    def __init__(self, network):
        self.network = network

    def __getattr__(self, name):
        if name == "normals":
            raise AttributeError(name)
        return getattr(self.network, name)


def test_without_compiled_code_the_answer_is_the_same(flight):
    net = NETWORKS["single step"](flight)
    state, solution = adjustment.solve(net, net.start)
    assert isinstance(adjustment.normals(Plain(net), net.start), PlainNormals)
    state_0, solution_0 = adjustment.solve(Plain(net), net.start)
    assert solution.cost == pytest.approx(solution_0.cost, rel=1e-12)
    sigma = np.sqrt(np.diag(solution_0.cov))
    interior = np.array([i.to_array() for i in state.interiors])[0, :8]
    assert_allclose(
        interior / sigma[:8], state_0.interiors[0].to_array()[:8] / sigma[:8], atol=1e-5
    )


def test_one_thread_or_many_give_the_same_bytes(flight, monkeypatch, parts):
    net = NETWORKS["single step"](flight)
    first = net.normals(net.start).step()
    monkeypatch.setattr(processors, "cores", lambda: 1)
    second = net.normals(net.start).step()
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a, b)


def test_large_singular_blocks_are_refused_in_words(flight, monkeypatch):
    monkeypatch.setattr(packing, "DENSE_COLUMNS", 0)
    monkeypatch.setattr(packing, "DENSE_SHARE", 2.0)
    monkeypatch.setattr(normals, "LARGEST_DENSE", 10)
    block = flight.calibration
    without = replace(block, control=block.control[np.zeros(len(block.control), dtype=bool)])
    net = adjust.free_orientation(without, Model(free=("f",)))
    with pytest.raises(adjustment.AdjustmentError, match="singular and too large"):
        net.normals(net.start).step()


def test_poses_along_a_strip_make_a_narrow_band(rng):
    """Twenty poses in random order, each sharing points with its two neighbours only."""
    along = rng.permutation(20)
    point = np.repeat(np.arange(19), 2)
    pose = along[np.stack([np.arange(19), np.arange(1, 20)], axis=1).ravel()]
    anywhere = rng.uniform(size=(20, 3))
    order = packing.ordered(point, pose.astype(np.int32), anywhere, np.zeros((0, 2), dtype=int))
    place = np.argsort(order)
    assert np.abs(np.diff(place[along])).max() == 1


def test_strips_and_cross_strips_make_the_same_narrow_band_in_any_order_and_direction(rng):
    """Eight strips of thirty poses and a cross strip, each pose linked to its neighbours."""
    row, column = (a.ravel() for a in np.meshgrid(np.arange(8), np.arange(30), indexing="ij"))
    row, column = np.append(row, np.arange(8)), np.append(column, np.full(8, 20.4))
    n = len(row)
    near = np.abs(row - row[:, None]) <= 1
    near &= np.abs(column - column[:, None]) <= 3
    pairs = np.argwhere(near)
    plan = np.column_stack([column, 3.0 * row]) + rng.uniform(-0.1, 0.1, (n, 2))
    bands = set()
    for turn in (0.0, 0.1, 0.35, 1.9):
        R = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        name, positions = rng.permutation(n), np.zeros((n, 3))
        positions[name, :2] = plan @ R
        point, pose = np.repeat(np.arange(len(pairs)), 2), name[pairs].ravel().astype(np.int32)
        place = np.argsort(packing.ordered(point, pose, positions, np.zeros((0, 2), dtype=int)))
        bands.add(int(np.abs(np.diff(place[name[pairs]], axis=1)).max()))
    assert len(bands) == 1
    assert bands.pop() <= 8 * 3 + 8 + 8  # three columns of eight, less than one, the cross strip


def test_the_order_of_the_measurements_changes_nothing(flight, rng, parts):
    net = NETWORKS["a rig of four heads"](flight)
    order = rng.permutation(len(net.image_points))
    mixed = replace(net, image_points=net.image_points[order])
    (dx, dp), (dx_0, dp_0) = mixed.normals(net.start).step(), net.normals(net.start).step()
    assert_allclose(dx, dx_0, rtol=1e-6, atol=1e-9 * np.abs(dx_0).max())
    assert_allclose(dp, dp_0, atol=1e-9 * np.abs(dp_0).max())
    found, expected = mixed.normals(net.start).precision(), net.normals(net.start).precision()
    for name in ("v", "redundancy"):  # in the order in which they were given
        there = getattr(found.groups[0], name)
        assert_allclose(there, getattr(expected.groups[0], name)[order], atol=1e-9)


def test_only_pairs_of_images_that_share_points_are_numbered():
    start, image = np.array([0, 2, 5, 6]), np.array([0, 3, 1, 1, 2, 4], dtype=np.int32)
    nothing = [-1] * 3
    assert packing._numbered_pairs(start, image, 5).tolist() == [
        [0, -1, -1, 1],
        [2, 3, -1, -1],
        [4, *nothing],
        [5, *nothing],
        [6, *nothing],
    ]


def test_observations_of_some_points_are_those_of_all(noisy_block):
    sigma_m = noisy_block.control.sigma_m.copy()
    sigma_m[[1, 5]] = 0.0
    block = replace(noisy_block, control=replace(noisy_block.control, sigma_m=sigma_m))
    net = adjust.free_orientation(block, Model(free=("f", "k1")))
    equations = [e for e in net.equations(net.start)[1:] if e.B is not None]
    points = net.observed_points
    V, h = point_normals(np.ones(net.n_points, dtype=bool), equations)
    found = by_points(points, equations)
    assert_allclose(found[0], V[points], rtol=1e-14)
    assert_allclose(found[1], h[points], rtol=1e-14)
    own, rows = of_points(equations[0], points[:3])
    assert set(points[own.point]) <= set(points[:3])
    assert_allclose(own.v, equations[0].v[rows])


# --- compiled products of small matrices against numpy ---------------------------------------


numba = pytest.importorskip("numba")
small_products = pytest.importorskip("acx4lib.bundle.compiled.small_products")


def compiled(**shape):
    product = small_products.SmallProduct(**shape).compiled()

    @numba.njit
    def call(out, out_at, left, left_at, right, right_at):
        product(out, out_at, left, left_at, right, right_at)

    return call


@pytest.mark.parametrize(("add", "before", "sign"), [(0, 0, 1), (1, 1, 1), (-1, 1, -1)])
def test_a_product_is_written_added_or_taken_off_where_it_is_told(rng, add, before, sign):
    call = compiled(rows=3, inner=2, width=8, left=(2, 1), right=16, out=8, add=add)
    left, right, out = (
        rng.normal(size=(4, 3, 2)),
        rng.normal(size=(2, 16)),
        rng.normal(size=(2, 3, 8)),
    )
    expected = out.copy()
    expected[1] = before * expected[1] + sign * left[2] @ right[:, 8:]
    call(out, 24, left, 12, right, 8)
    assert_allclose(out, expected, rtol=1e-14, atol=1e-14)


def test_strides_take_the_transpose_of_the_left_matrix(rng):
    call = compiled(rows=6, inner=3, width=16, left=(1, 16), right=16, out=16)
    left, right, out = rng.normal(size=(3, 16)), rng.normal(size=(3, 16)), np.zeros((6, 16))
    call(out, 0, left, 0, right, 0)
    assert_allclose(out, left[:, :6].T @ right, rtol=1e-14, atol=1e-14)


def test_a_dot_product_begins_where_it_is_told(rng):
    product, a, b = small_products.dot(16), rng.normal(size=40), rng.normal(size=(2, 16))

    @numba.njit
    def call(a, b):
        return product(a, 3, b, 16)

    assert_allclose(call(a, b), a[3:19] @ b[1], rtol=1e-14)


def test_what_is_aligned_begins_where_a_line_of_the_cache_does():
    for shape in ((3,), (5, 2, 24), (1, 3, 3)):
        made = small_products.aligned(*shape)
        assert made.shape == shape
        assert not made.any()
        assert made.ctypes.data % 64 == 0
        assert made.flags.c_contiguous


def test_the_lower_triangle_of_a_symmetric_product_may_be_left_out(rng):
    call = compiled(rows=16, inner=2, width=16, left=(1, 16), right=16, out=16, add=1, upper=True)
    J, out = rng.normal(size=(2, 16)), np.zeros((16, 16))
    call(out, 0, J, 0, J, 0)
    assert_allclose(np.triu(out), np.triu(J.T @ J), rtol=1e-14, atol=1e-14)
    assert not out[8:, :8].any()
