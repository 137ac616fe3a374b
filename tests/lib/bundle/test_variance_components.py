"""Variance components: a closed form, brute force, and simulated flights of known noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import acx4sim
from acx4files.results import sentences
from acx4lib.bundle import variance_components
from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation
from acx4lib.calibration import mounting
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.adjustment import solve
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.model import Model
from acx4sim.plan import SlowErrors
from support import blocks
from support.flights import simulated as flown

SIGMA_GROUPS = [*variance_components.TESTED]
FREE = ("f", "xp", "yp", "k1")
PLAIN = Camera(
    name="CAM",
    width_px=4000,
    height_px=3000,
    pixel_mm=0.01,
    interior=Interior(f=50.0),
    T_b_c=Pose(R=np.eye(3), r=np.zeros(3)),
)


def component(found, group):
    return next(c for c in found if c.group == group)


def bundle_of(block):
    return adjust(mounted_orientation(block, Model(free=FREE)))


def of_block(block, **options):
    return variance_components.components(bundle_of(block), **options)


@pytest.fixture(scope="module")
def block():
    return blocks.balanced()


# --- closed form -----------------------------------------------------------------------------


def means(*, n_points=12, n_images=3, noise_px=0.9, noise_m=0.08):
    """Return a block in which every point is a weighted mean of survey and vertical images.

    All poses are held by tiny sigma, and every point is seen straight from above only.
    """
    rng = np.random.default_rng(11)
    x_m = np.column_stack([3000.0 * np.arange(n_points), np.zeros(n_points), np.zeros(n_points)])
    above = np.repeat(x_m, n_images, axis=0) + np.array([0.0, 0.0, 1000.0])
    poses = Pose(R=np.tile(np.eye(3), (len(above), 1, 1)), r=above)
    exact = blocks.simulate(poses, cameras=(PLAIN,), control=x_m)
    survey = noise_m * rng.normal(size=(n_points, 3)) * [1, 1, 0]
    measured = noise_px * rng.normal(size=(len(exact.image_points), 2))
    noisy = blocks.changed(blocks.changed(exact, "control_point", survey), "image_point", measured)
    held = replace(
        noisy.trajectory,
        sigma_position=np.full((len(above), 3), 1e-4),
        sigma_attitude=np.full((len(above), 3), 1e-7),
    )
    # 0.2 m on the ground is a pixel; rows count downward
    in_images = (0.2 * measured * [1, -1]).reshape(n_points, n_images, 2)
    on_ground = blocks.transform(noisy.control.R_g_m.swapaxes(1, 2), survey)[:, :2]
    return replace(noisy, trajectory=held), on_ground, in_images


@pytest.mark.parametrize("wrong", [1.0, 4.0])
def test_of_weighted_means_it_is_the_analysis_of_variance(wrong):
    """In a balanced design Helmert's estimates are those within and between points.

    Whatever the weights: the images' spread about their mean tells their variance, and the
    survey's about that mean its own and a third of theirs.
    """
    block, survey, images = means()
    block = mounting.scaled(block, {"control plan": wrong})
    found = variance_components.components(
        adjust(mounted_orientation(block, Model(fix=("lever_arm", "boresight"))))
    )
    n_points, n_images, _ = images.shape
    mean = images.mean(axis=1, keepdims=True)
    within = np.sum((images - mean) ** 2) / (2 * n_points * (n_images - 1))
    between = np.mean((survey - mean[:, 0]) ** 2) - within / n_images
    expected = {
        "image points": np.sqrt(within) / (0.5 * 0.2),
        "control plan": np.sqrt(between) / (0.01 * wrong),
    }
    for group, factor in expected.items():
        assert component(found, group).factor == pytest.approx(factor, rel=1e-4)


def test_of_weighted_means_the_effective_redundancy_is_that_of_the_spread_within():
    """2 n (m - 1) for the images, to which the survey adds what little it can."""
    block, _, images = means()
    # a survey ten times worse than the images' mean says nothing of them
    block = mounting.scaled(block, {"control plan": 60.0})
    found = variance_components.components(
        adjust(mounted_orientation(block, Model(fix=("lever_arm", "boresight"))))
    )
    n_points, n_images, _ = images.shape
    within = 2 * n_points * (n_images - 1)
    assert component(found, "image points").effective == pytest.approx(within, rel=0.01)
    assert component(found, "control plan").effective == pytest.approx(2 * n_points, rel=0.03)
    assert component(found, "control height").redundancy == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(component(found, "control height").factor)


@pytest.mark.parametrize("wrong", [0.5, 1.0, 3.0])
def test_of_weighted_means_the_test_of_sigma_is_chi_square_of_the_distance_to_the_mean(wrong):
    """A survey and the mean of the images differ by both errors; a share of it is the survey's."""
    block, survey, images = means(noise_m=0.08 * wrong)
    test = next(
        t
        for t in variance_components.sigma_tests(
            adjust(mounted_orientation(block, Model(fix=("lever_arm", "boresight"))))
        )
        if t.group == "control, plan"
    )
    n_points, n_images, _ = images.shape
    variance = 0.01**2 + (0.5 * 0.2) ** 2 / n_images  # as block and images declare them
    square = np.sum((survey - images.mean(axis=1)) ** 2) / variance
    below, above = (tail(square, 2 * n_points) for tail in (stats.chi2.cdf, stats.chi2.sf))
    assert test.effective == pytest.approx(2 * n_points, rel=1e-3)
    assert test.p == pytest.approx(2 * min(below, above), rel=1e-2)


# --- brute force -----------------------------------------------------------------------------


def dense(block):
    """Return residuals over sigma, the projector on them, and the kind and component of each."""
    network = mounted_orientation(block, Model(free=FREE))
    state, _ = solve(network, network.start)
    n, n_points = network.n_columns, network.n_points
    rows, v, owner = [], [], []
    for e in network.equations(state):
        for i, d in np.argwhere(np.isfinite(e.sigma)):
            row = np.zeros(n + 1 + 3 * n_points)
            row[e.columns[e.unit[i]]] = e.A[i, d]
            row[n] = 0.0  # what is held
            if e.B is not None:
                row[n + 1 + 3 * e.point[i] : n + 4 + 3 * e.point[i]] = e.B[i, d]
            rows.append(row / e.sigma[i, d])
            v.append(e.v[i, d] / e.sigma[i, d])
            owner.append((e.kind, d))
    q, _ = np.linalg.qr(np.array(rows)[:, np.any(rows, axis=0)])
    return np.array(v), np.eye(len(q)) - q @ q.T, owner


def test_factors_and_effective_redundancies_are_those_of_the_whole_dense_problem(block):
    v, W, owner = dense(block)
    owner = [_group_of(*of) for of in owner]
    names = list(dict.fromkeys(owner))
    member = np.array([[name == o for o in owner] for name in names], dtype=float)
    h = member @ W**2 @ member.T
    variance = np.linalg.solve(h, member @ np.square(v))
    found = of_block(block)
    for name, s_sq, inverse in zip(names, variance, np.diag(np.linalg.inv(h)), strict=True):
        c = component(found, name)
        assert c.factor == pytest.approx(np.sqrt(max(s_sq, 0.0)), rel=1e-6)
        assert c.effective == pytest.approx(1 / inverse, rel=1e-6)
        assert c.n == owner.count(name)


def test_probabilities_of_sigma_are_those_of_simulated_residuals(block, rng):
    """Errors of the given sigma, and the residuals that any adjustment leaves of them."""
    v, W, owner = dense(block)
    found = {test.group: test for test in variance_components.sigma_tests(bundle_of(block))}
    errors = rng.standard_normal((len(W), 8_000), dtype=np.float32)
    left = W.astype(np.float32) @ errors
    for name, kind, components in [("image points", "image_point", (0, 1)), *SIGMA_GROUPS]:
        own = [k == kind and d in components for k, d in owner]
        part, test = W[np.ix_(own, own)], found[name]
        assert test.redundancy == pytest.approx(np.trace(part), rel=1e-6)
        assert test.effective == pytest.approx(np.trace(part) ** 2 / np.sum(part**2), rel=1e-5)
        cost = np.sum(v[own] ** 2)
        assert test.ratio == pytest.approx(np.sqrt(cost / np.trace(part)), rel=1e-6)
        below = np.mean(np.sum(left[own] ** 2, axis=0) < cost)
        of_chance = 4 * np.sqrt(below * (1 - below) / errors.shape[1]) + 1e-4
        assert min(below, 1 - below) == pytest.approx(test.p / 2, abs=of_chance)


def _group_of(kind, d):
    return {
        "image_point": "image points",
        "control_point": "control height" if d == 2 else "control plan",
        "gnss": "GNSS",
        "attitude": "heading" if d == 2 else "roll, pitch",
    }[kind]


# --- what it means ---------------------------------------------------------------------------


def test_redundancies_sum_to_that_of_the_adjustment(block):
    bundle = adjust(mounted_orientation(block, Model(free=FREE)))
    found = variance_components.components(bundle)
    assert sum(c.redundancy for c in found) == pytest.approx(bundle.solution.redundancy, rel=1e-9)
    assert sum(c.n for c in found) == bundle.solution.n_observations


def test_sigma_all_wrong_by_one_factor_show_it_in_every_group(block):
    groups = [c.group for c in of_block(block)]
    twice = of_block(mounting.scaled(block, dict.fromkeys(groups, 2.0)))
    for a, b in zip(of_block(block), twice, strict=True):
        assert b.factor == pytest.approx(a.factor / 2, rel=1e-5)
        assert b.effective == pytest.approx(a.effective, rel=1e-5)


def test_every_camera_is_a_group_of_its_own(block):
    other = replace(blocks.CAMERA, name="CAM2")
    two = blocks.simulate(
        blocks.fly(),
        cameras=(blocks.CAMERA, other),
        ties=blocks.terrain(40),
        control=blocks.crosses(),
    )
    camera_idx = two.images.camera_idx[two.image_points.image_idx]
    noise = np.random.default_rng(4).normal(size=(len(camera_idx), 2)) * 0.5
    noise[camera_idx == 1] *= 3
    spoilt = blocks.changed(two, "image_point", noise)
    assert component(of_block(spoilt), "image points CAM2").is_significant
    factors = mounting.estimated_factors(
        spoilt, lambda b: adjust(mounted_orientation(b, Model(free=FREE)))
    )
    found = of_block(mounting.scaled(spoilt, factors), applied=factors)
    for name, true in (("CAM", 1.0), ("CAM2", 3.0)):
        c = component(found, f"image points {name}")
        assert abs(c.factor - true) < 3.3 * c.sigma
        assert c.effective > 500


def test_what_is_no_observation_is_no_group(block):
    bundle = adjust(free_orientation(block, Model(free=("xp",))))
    groups = [c.group for c in variance_components.components(bundle)]
    assert groups == ["image points", "control plan", "control height"]


def test_a_wrong_sigma_is_said_with_its_direction(block):
    for group, wrong, direction in (
        ("heading", 0.4, "optimistic"),
        ("image points", 3.0, "pessimistic"),
    ):
        found = of_block(mounting.scaled(block, {group: wrong}))
        factor = component(found, group).factor
        assert factor == pytest.approx(1 / wrong, rel=0.25)
        assert sentences.sigmas(found) == [
            f"the sigma of {group} are {max(factor, 1 / factor):.1f} times too {direction}"
        ]
    assert sentences.sigmas(of_block(block)) == []


def test_what_was_applied_is_part_of_the_factor_and_said(block):
    applied = {"GNSS": 2.0}
    plain, after = of_block(block), of_block(mounting.scaled(block, applied), applied=applied)
    # the same data: the same answer but for the weights, which move it by one of its sigma
    c = component(after, "GNSS")
    assert abs(c.factor - component(plain, "GNSS").factor) < c.sigma
    assert "the sigma were multiplied by 2.00 ± " in sentences.sigmas(after)[0]
    assert c.applied == 2.0


def test_without_covariances_a_group_is_judged_by_its_redundancy(block, monkeypatch):
    monkeypatch.setattr(variance_components, "MOST_ROWS", 0)
    for c in of_block(block):
        assert c.effective == pytest.approx(c.redundancy, rel=1e-9)


def test_in_large_blocks_small_groups_keep_their_covariances_with_all(block, monkeypatch):
    whole = of_block(block)
    n = {c.group: c.n for c in whole}
    monkeypatch.setattr(variance_components, "MOST_ROWS", n["control plan"] + n["control height"])
    for name in ("control plan", "control height"):
        some = component(of_block(block), name)
        assert some.factor == pytest.approx(component(whole, name).factor, rel=0.05)
        assert some.effective == pytest.approx(component(whole, name).effective, rel=0.05)
        assert some.effective < 0.9 * some.redundancy


# --- simulated flights -----------------------------------------------------------------------

LITTLE = {"blocks": ("calibration",), "tie_points": {"calibration": 100}}


def fly(seed, **options):
    """Simulate noise that the flight's sigma do not know."""
    true = acx4sim.DESIGNS["single-head"](seed=seed, options=acx4sim.Options(**LITTLE, **options))
    told = acx4sim.DESIGNS["single-head"](seed=seed, options=acx4sim.Options(**LITTLE))
    return flown.read_back(replace(true, toml=told.toml)).flight


@pytest.mark.slow
def test_components_are_free_of_bias_and_scatter_as_they_say():
    """25 flights whose GNSS is 2.5 times worse than stated; variances in units of the true ones.

    Bounds are 3.3 standard deviations of the mean, and chi-square's 0.1 % of the spread, taken
    twice as wide since estimates from few observations are not normal. Only where the group's own
    sigma is right does the component know its own scatter.
    """
    n, ratios, scatter = 25, {}, {}
    for seed in range(1, n + 1):
        flight = fly(seed, gnss_noise=2.5)
        network = mounted_orientation(flight.calibration, Model(free=flight.estimate_mounting))
        for c in variance_components.components(adjust(network)):
            true = 2.5 if c.group == "GNSS" else 1.0
            ratios.setdefault(c.group, []).append((c.factor / true) ** 2)
            scatter.setdefault(c.group, []).append(np.sqrt(2 / c.effective))
    for group in ("image points", "GNSS", "roll, pitch", "heading"):
        ratio = np.array(ratios[group])
        assert abs(ratio.mean() - 1) < 3.3 * ratio.std(ddof=1) / np.sqrt(n), group
    for group in ("image points", "roll, pitch", "heading"):
        z = (np.array(ratios[group]) - 1) / scatter[group]
        assert 0.5 < z.std(ddof=1) < 1.65, group


def test_a_correlated_group_is_judged_by_all_its_weights():
    """Slow errors that are twice what their sigma say have a factor of two, and right ones one."""
    process = GaussMarkov(share=0.95, time_constant_s=600.0)
    for factor in (1.0, 2.0):
        options = acx4sim.Options(
            tie_points={"calibration": 100},
            slow_errors=SlowErrors(),
            gnss_noise=factor,
            attitude_noise=factor,
            blocks=("calibration",),
        )
        flight = flown.read_back(acx4sim.DESIGNS["acx4-ideal"](seed=1, options=options)).flight
        trajectory = replace(
            flight.calibration.trajectory, slow_positions=process, slow_attitudes=process
        )
        given = replace(
            trajectory,
            sigma_position=trajectory.sigma_position / factor,
            sigma_attitude=trajectory.sigma_attitude / factor,
        )
        block = replace(flight.calibration, trajectory=given)
        bundle = adjust(mounted_orientation(block, Model(free=flight.estimate_mounting)))
        found = {c.group: c for c in variance_components.components(bundle)}
        for name in ("roll, pitch", "heading"):
            one = found[name]
            assert abs(one.factor - factor) < 3.3 * factor * one.sigma
        total = sum(c.redundancy for c in found.values())
        assert total == pytest.approx(bundle.solution.redundancy, rel=1e-6)
