"""Reliability against closed forms, against the adjustment of changed observations, and bounds."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.bundle.rejections import noncentrality
from acx4lib.bundle.reliability import gains, one_ray, parameter_effects, reliability
from acx4lib.geometry.camera import distort
from acx4lib.least_squares.normal_equations import Equations
from acx4lib.least_squares.reduced_system import Dense
from acx4lib.least_squares.statistics import Group
from acx4lib.model import Model
from support import blocks

FREE = ("f", "xp", "yp", "k1", "p1", "p2")
STEP = 0.02  # of sigma: effects of second order are then 1e-4 of those of first order


def columns_of(bundle):
    """Return the columns of interior orientation and mounting."""
    layout = bundle.network.layout
    columns = np.concatenate([layout.interior.ravel(), layout.mount.ravel()])
    return columns[columns >= 0]


def parameters(bundle):
    """Return the estimates in the order of `FREE`, then the lever arm."""
    interior = bundle.state.interiors[0]
    return np.append([getattr(interior, name) for name in FREE], bundle.state.T_b_c.r[0])


def with_redundancy(r, sigma):
    r = np.atleast_2d(r).T
    return Group(kind="y", v=np.zeros_like(r), sigma=np.full_like(r, sigma), redundancy=r)


@pytest.mark.parametrize("n", [3, 8])
def test_a_levelling_loop_of_equal_lines(n):
    """One condition, the sum is zero: every line has 1/n of its redundancy."""
    found = reliability(with_redundancy(np.full(n, 1 / n), 0.002), critical=3.29)
    assert_allclose(found.detectable, 4.1316 * 0.002 * np.sqrt(n), rtol=1e-4)
    assert_allclose(found.external, 4.1316 * np.sqrt(n - 1), rtol=1e-4)


def test_what_nothing_controls_hides_errors_of_any_size():
    found = reliability(with_redundancy([0.0, 1.0], 0.5))
    assert_allclose(found.detectable[:, 0], [np.inf, noncentrality() * 0.5])
    assert_allclose(found.external[:, 0], [np.inf, 0.0])


def test_what_takes_no_part_has_no_reliability():
    found = reliability(with_redundancy([np.nan, np.nan], np.inf))
    assert np.isnan(found.detectable).all()
    assert np.isnan(found.external).all()


def test_what_a_straight_line_takes_over_from_a_point():
    """The slope changes by (x - mean) / sum (x - mean)^2, the value at the mean by 1/n."""
    x = np.array([0.0, 1.0, 2.0, 5.0, 9.0])
    design = np.column_stack([np.ones(5), x - x.mean()])
    N = design.T @ design / 0.3**2
    line = Equations(
        kind="y",
        v=np.zeros((5, 1)),
        sigma=np.full((5, 1), 0.3),
        A=design[:, None, :],
        columns=np.array([[0, 1]]),
        unit=np.zeros(5, dtype=int),
    )
    inverse = Dense(N=N, diagonal=np.diagonal(N)).inverse()
    (found,) = gains([line], inverse.dense[[1, 0]], np.zeros(0, dtype=bool))
    spread = x - x.mean()
    assert_allclose(found[:, 0, 0], spread / np.sum(spread**2), rtol=1e-12)
    assert_allclose(found[:, 0, 1], 1 / 5, rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "row", "component"),
    [("image_point", 100, 1), ("control_point", 5, 2), ("gnss", 7, 0), ("attitude", 4, 1)],
)
def test_gains_are_what_changed_observations_do(exact_block, kind, row, component):
    sigma = blocks.observed_sigmas(exact_block)[kind]
    by = np.zeros_like(sigma)
    by[row, component] = STEP * sigma[row, component]

    def adjusted(sign):
        spoilt = blocks.changed(exact_block, kind, sign * by)
        return adjust(mounted_orientation(spoilt, Model(free=FREE)))

    exact, ahead, behind = (adjusted(sign) for sign in (0.0, 1.0, -1.0))
    network, columns = exact.network, columns_of(exact)[: len(FREE) + 3]  # and the lever arm
    inverse = exact.solution.inverse.dense
    found = gains(network.equations(exact.state), inverse[columns], network.free_points)
    number = [g.kind for g in exact.solution.groups].index(kind)
    at = np.flatnonzero(network.rows == row)[0] if kind == "image_point" else row
    numeric = (parameters(ahead) - parameters(behind)) / (2 * by[row, component])
    # count in sigmas of the parameters for one sigma of the observation
    unit = sigma[row, component] / np.sqrt(np.diag(exact.solution.cov))[columns]
    # a corrected image point moves by up to 0.3 % more or less than a measured one
    assert_allclose(unit * numeric, unit * found[number][at, component], atol=1e-4)
    assert np.max(np.abs(unit * numeric)) > 0.01  # or there would be nothing to see


def test_no_parameter_is_moved_by_more_than_baardas_bound(mounted):
    effects = parameter_effects(mounted, columns_of(mounted))
    for group, effect in zip(mounted.solution.groups, effects, strict=True):
        bound = reliability(group).external
        assert np.all(np.abs(effect).max(axis=2, initial=0.0) <= bound * (1 + 1e-9))
    # a position's error along the flight is mostly the lever arm's
    assert max(np.abs(effect).max(initial=0.0) for effect in effects) > 0.5


def test_effects_are_the_same_however_many_are_computed_together(mounted, monkeypatch):
    whole = parameter_effects(mounted, columns_of(mounted))
    monkeypatch.setattr("acx4lib.bundle.reliability.TOGETHER", 7)
    for effect, expected in zip(
        parameter_effects(mounted, columns_of(mounted)), whole, strict=True
    ):
        np.testing.assert_array_equal(effect, expected)


def test_a_height_that_alone_holds_the_block_moves_it_without_bound(exact_block):
    """With control in plan and one position's height, that height is what all others hang on."""
    trajectory, control = exact_block.trajectory, exact_block.control
    position = np.full_like(trajectory.sigma_position, np.inf)
    position[5, 2] = 0.02
    in_plan = control.sigma_m * [1, 1, np.inf]
    block = replace(
        exact_block,
        trajectory=replace(trajectory, sigma_position=position),
        control=replace(control, sigma_m=in_plan),
    )
    fit = adjust(mounted_orientation(block, Model(free=("xp",), fix=("lever_arm", "boresight"))))
    xp, height = 0, fit.network.layout.pose[8, 2]
    number = [g.kind for g in fit.solution.groups].index("gnss")
    effect = parameter_effects(fit, np.array([xp, height]))[number]
    assert np.isinf(reliability(fit.solution.groups[number]).detectable[5, 2])
    assert effect[5, 2, 1] == np.inf
    assert effect[5, 2, 0] == 0  # the principal point does not hang on it
    assert np.all(effect[:5] == 0)


def whitened(bundle):
    """Return the rows of the whole design, in sigmas of the observations, and their places."""
    network = bundle.network
    rows, places = [], []
    for number, e in enumerate(network.equations(bundle.state)):
        for n, d in np.argwhere(np.isfinite(e.sigma)):
            row = np.zeros(network.n_columns + 3 * len(network.free_points))
            columns = e.columns[e.unit[n]]
            row[columns[columns >= 0]] = e.A[n, d][columns >= 0]
            if e.B is not None and network.free_points[e.point[n]]:
                row[network.n_columns + 3 * e.point[n] + np.arange(3)] = e.B[n, d]
            rows.append(row / e.sigma[n, d])
            places.append((number, n, d))
    rows = np.array(rows)
    return rows[:, rows.any(axis=0)], places


@pytest.fixture(scope="module")
def two_rays(exact_block):
    """Two rays of one point, the base along the rows: columns are controlled by 0.0007 only."""
    points, rows = exact_block.image_points, exact_block.image_points.colrow[:, 1]
    tie = np.setdiff1d(points.point_idx, exact_block.control.point_idx)
    pairs = [
        pair for point in tie for pair in combinations(np.flatnonzero(points.point_idx == point), 2)
    ]
    i, j = min(pairs, key=lambda pair: abs(np.subtract(*rows[list(pair)])))
    sigma = points.sigma_px.copy()
    others = (points.point_idx == points.point_idx[i]) & ~np.isin(np.arange(len(rows)), [i, j])
    sigma[others] *= 1e5
    block = replace(exact_block, image_points=replace(points, sigma_px=sigma))
    fit = adjust(mounted_orientation(block, Model(free=FREE)))
    return fit, int(np.flatnonzero(fit.network.rows == i)[0])


def test_the_effect_is_the_accuracy_that_is_lost_without_the_observation(two_rays):
    """By the whole normal matrix without one row: delta_0 times the root of what sigma^2 gains."""
    fit, row = two_rays
    columns = columns_of(fit)
    A, places = whitened(fit)
    without = np.delete(A, places.index((0, row, 0)), axis=0)
    of_all, of_others = (np.diag(np.linalg.inv(a.T @ a))[columns] for a in (A, without))
    expected = noncentrality() * np.sqrt(of_others / of_all - 1)
    effect = np.abs(parameter_effects(fit, columns)[0][row])
    assert_allclose(effect[0], expected, rtol=1e-3, atol=1e-4)
    # all four measurements contradict each other in one way only
    assert_allclose(effect[0], effect[1], rtol=1e-3)
    assert effect.max() > 0.05


def test_an_error_that_hardly_anything_controls_has_a_finite_effect_if_its_own_point_takes_it_up(
    two_rays, monkeypatch
):
    fit, row = two_rays
    columns = columns_of(fit)
    with_division = parameter_effects(fit, columns)[0][row]
    monkeypatch.setattr("acx4lib.bundle.reliability.LEAST", 1e-3)
    assert np.isinf(reliability(fit.solution.groups[0]).detectable[row, 0])
    assert_allclose(parameter_effects(fit, columns)[0][row], with_division, rtol=1e-6)


# --- One ray of an adjustment closes its equation: by hand, its residual is the library's


@pytest.mark.parametrize("i", [0, 7])
def test_the_residual_of_a_ray_is_what_equation_14_leaves(mounted, i):
    ray = one_ray(mounted, i)
    camera, body = ray.camera, ray.T_m_b
    r_c = camera.T_b_c.R.T @ (body.R.T @ (ray.x_m - body.r) - camera.T_b_c.r)
    ideal = -camera.interior.f * r_c[:2] / r_c[2]
    seen = distort(camera.interior, ideal[None])[0]
    by_hand = (seen - ray.xy_mm) / camera.pixel_mm * np.array([1, -1])
    assert_allclose(by_hand, ray.residual_px, atol=1e-6)


def test_the_poses_of_a_ray_hang_together(mounted):
    ray = one_ray(mounted, 3)
    again = ray.T_m_b @ ray.camera.T_b_c
    assert_allclose(again.r, ray.T_m_c.r, atol=1e-6)
    assert "point " in repr(ray)


def test_a_ray_that_is_not_there_is_an_error(mounted):
    n = len(mounted.network.image_points)
    with pytest.raises(ValueError, match=f"i: expected less than {n}"):
        one_ray(mounted, n)
