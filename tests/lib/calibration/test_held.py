"""Held values: what one solved system says of them, against really freeing them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.block import select_cameras
from acx4lib.bundle.adjust import adjust, free_orientation
from acx4lib.bundle.unknowns import holding, layout
from acx4lib.calibration import heads, held, mounting
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.geometry.camera import INTERIOR, inside
from acx4lib.geometry.collinearity import Measurement, directions, project
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.intersection import intersect
from acx4lib.geometry.parameters import AXES, LEVER_ARM, MOUNT, REPORTED, Prior
from acx4lib.georeferencing import budget
from acx4lib.least_squares.statistics import chi2_cdf
from acx4lib.least_squares.verdict import LEVEL
from acx4lib.model import Model
from acx4lib.synthetic_image.frame import displacements
from benchmarks.verdicts import faults
from support import blocks
from support.flights import simulated

LENS = ("xp", "yp", "k1", "k2", "k3", "p1", "p2")
COSTS = {"CAM1": 36.3, "CAM2": 8.1, "CAM3": 9.7, "CAM4": 30.0}
FREED = {"CAM1": 74.394, "CAM2": 74.174, "CAM3": 74.206, "CAM4": 74.377}
"""What holding f at 74 mm costs in the study's flight, and f if it is free, calibrated again."""


# --- flights -----------------------------------------------------------------------------------


@cache
def study():
    """Calibrate the heads of the study's flight as it does."""
    flown = simulated.fly("acx4", seed=SEED, blocks=("heads",)).flight
    found = heads.calibrate_heads(flown.heads, simulated.HEADS, Model(free=flown.estimate_heads))
    return flown, found


SEED = 1


@cache
def calibrated(name, fix=()):
    """Calibrate in a single step with f held where the flight's file has it."""
    if name in simulated.CAMERA:
        flown = simulated.fly(name, seed=SEED, blocks=("calibration",)).flight
    else:
        flown = simulated.read_back(faults.fly(name, seed=SEED)[0]).flight
    block = flown.block("calibration" if "calibration" in flown.blocks else "heads")
    block = replace(block, cameras=tuple(replace(c, prior=Prior()) for c in block.cameras))
    return mounting.single_step(block, Model(free=LENS, fix=fix))


# --- really freed ------------------------------------------------------------------------------


def really_freed(bundle, name, *, mounts):
    """Adjust again with one more unknown: its name is that of results."""
    network = bundle.network
    n_cameras, n_poses = len(network.block.cameras), len(network.pose_names)
    all_free = layout(
        n_cameras, n_poses, free=INTERIOR, free_mount=MOUNT if mounts else (), free_shift=AXES
    )
    names = replace(network, layout=all_free).column_names()
    key = {reported: key for key, (reported, _) in REPORTED.items()}
    camera, _, parameter = name.rpartition("/")
    wanted = f"{camera}/{key[parameter]}" if camera else f"GNSS/shift_{parameter.split('_')[2]}"
    own = {*network.column_names(), wanted}
    stays = np.array([i for i, column in enumerate(names) if column not in own])
    return adjust(replace(network, layout=holding(all_free, stays), start=bundle.state))


def value_of(bundle, name):
    if "/" not in name:
        return bundle.state.shift[AXES.index(name.split("_")[2])]
    found = {p.full_name: p for p in parameters(from_bundle(bundle))}
    return found[name].value


def assert_as_freed(bundle, tested, name, *, mounts):
    """Compare with a second adjustment, in sigma of the freed estimate."""
    i, real = tested.names.index(name), really_freed(bundle, name, mounts=mounts)
    off = (tested.estimate[i] - value_of(real, name)) / tested.sigma[i]
    far = abs(tested.difference[i]) / tested.sigma[i]
    assert abs(off) < max(0.1, 2.5e-4 * far)  # 0.12 where f is off by 600 sigma
    cost = bundle.solution.cost - real.solution.cost
    assert_allclose(tested.reduction[i], cost, rtol=0.02, atol=0.02)
    before, after = ({p.full_name: p for p in parameters(from_bundle(b))} for b in (bundle, real))
    moves = [(after[n].value - before[n].value) / before[n].sigma for n in tested.estimates]
    assert_allclose(tested.moves[i], moves, rtol=0.03, atol=0.05 + 0.01 * np.abs(moves).max())


@pytest.mark.parametrize("head", simulated.HEADS)
def test_held_values_of_heads_are_as_really_freed(head):
    bundle = study()[1].bundles[head]
    tested = held.of_bundle(bundle)
    for name in (f"{head}/f_mm", f"{head}/k2", f"{head}/b1", f"{head}/b2"):
        assert_as_freed(bundle, tested, name, mounts=False)


@pytest.mark.parametrize("head", simulated.HEADS)
def test_the_focal_lengths_of_the_study_cost_what_a_second_calibration_says(head):
    tested = held.of_bundle(study()[1].bundles[head])
    f = tested.names.index(f"{head}/f_mm")
    assert tested.reduction[f] == pytest.approx(COSTS[head], rel=0.01)
    assert tested.estimate[f] == pytest.approx(FREED[head], abs=0.002)  # mm, a thirtieth of sigma
    assert tested.rejected[0] == f"{head}/f_mm"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "fix"),
    [
        ("acx4-ideal", ()),
        ("acx4-ideal", ("lever_arm",)),
        ("single-head", ()),
        ("two-heights-crossing", ("lever_arm",)),
        ("oblique-heads", ()),
        ("oblique-heads", ("lever_arm",)),
    ],
)
def test_held_values_of_a_mounting_are_as_really_freed(name, fix):
    found = calibrated(name, fix)
    tested = held.of_mounting(found)
    camera = found.calibration.cameras[0].name
    wanted = [f"{camera}/f_mm", f"{camera}/b1", "gnss_shift_east_m"]
    for one in [*wanted, *(f"{camera}/{REPORTED[key][0]}" for key in LEVER_ARM if fix)]:
        assert_as_freed(found.bundle, tested, one, mounts=True)


@pytest.fixture(scope="module")
def block():
    return blocks.noisy(blocks.standard(), np.random.default_rng(3))


def test_a_held_lever_arm_of_two_steps_is_at_the_lowest_point_of_v_p_v(block):
    """Adjusted with three held lever arms each, v'Pv is a parabola over one component."""

    def at(change):
        camera = block.cameras[0]
        T = Pose(R=camera.T_b_c.R, r=camera.T_b_c.r + change)
        moved = replace(block, cameras=(replace(camera, T_b_c=T),))
        return mounting.two_step_gnss(moved, Model(free=("f", "xp", "yp")))

    found = at(np.zeros(3))
    tested = held.of_mounting(found)
    for axis, key in enumerate(LEVER_ARM[:2]):
        i = tested.names.index(f"CAM/{REPORTED[key][0]}")
        step = tested.sigma[i] * np.eye(3)[axis]
        costs = [at(k * step).bundle.solution.cost for k in (-1, 0, 1)]
        curve = np.polynomial.Polynomial.fit([-1, 0, 1], costs, 2).convert().coef
        lowest = -curve[1] / (2 * curve[2])  # in sigma
        assert tested.difference[i] / tested.sigma[i] == pytest.approx(lowest, abs=0.02)
        reduction = costs[1] - np.polynomial.Polynomial(curve)(lowest)
        assert tested.reduction[i] == pytest.approx(reduction, rel=0.02, abs=0.01)


# --- what the data cannot tell -----------------------------------------------------------------


def test_a_height_of_the_shift_cannot_be_told_beside_a_lever_arm():
    level = blocks.noisy(
        blocks.simulate(
            blocks.fly(tilt_deg=0.0), control=blocks.crosses(), ties=blocks.terrain(30)
        ),
        np.random.default_rng(1),
    )
    tested = held.of_mounting(mounting.single_step(level, Model(free=("f", "xp", "yp"))))
    i = tested.names.index("gnss_shift_height_m")
    assert np.isnan(tested.p[i])
    assert not tested.sigma[i] < held.LIMIT_LEVER_M
    assert "gnss_shift_height_m" not in tested.rejected


def test_a_value_that_another_explains_is_not_rejected(block):
    """f is 0.1 mm off: alone, other parameters would take a part of it, too."""
    camera = block.cameras[0]
    off = camera.with_interior(replace(camera.interior, f=camera.interior.f + 0.1))
    found = mounting.single_step(
        replace(block, cameras=(off,)), Model(free=("xp", "yp", "k1", "p1", "p2")), snooping=False
    )
    tested = held.of_mounting(found)
    assert tested.rejected == ("CAM/f_mm",)
    assert np.sum(tested.p < LEVEL) > 1


@pytest.mark.slow
def test_the_tests_of_right_values_reject_as_often_as_they_say():
    """-2 times the sum of the logarithms of 60 probabilities is chi-square of 120 (Fisher)."""
    p = []
    exact = blocks.standard()
    for seed in range(30):
        noisy = blocks.noisy(exact, np.random.default_rng(seed))
        tested = held.of_mounting(
            mounting.single_step(
                noisy, Model(free=("f", "xp", "yp", "k1", "p1", "p2")), snooping=False
            )
        )
        p += [tested.p[tested.names.index(f"CAM/{name}")] for name in ("b1", "b2")]
    below = chi2_cdf(-2 * float(np.sum(np.log(p))), 2 * len(p))
    assert 0.005 < below < 0.995


# --- what it changes ---------------------------------------------------------------------------


def test_freed_heads_lie_where_a_second_calibration_puts_them():
    """In the synthetic image, px of 5.6 um; without b1, which the draw of CAM1 rejects, too."""
    flown, found = study()
    before = heads.relative_orientation(found, flown.synthetic_camera)
    free = ("f", *flown.estimate_heads)
    real = heads.calibrate_heads(flown.heads, simulated.HEADS, Model(free=free), after=found)
    after = {}
    for name, bundle in found.bundles.items():
        tested = held.of_bundle(bundle)
        vars(tested)["rejected"] = (f"{name}/f_mm",)
        after[name] = tested.freed(bundle)
    rms = [
        [float(np.sqrt(np.mean(np.sum((d / 0.0056) ** 2, axis=1)))) for d in moved]
        for moved in (
            displacements(before, heads.relative_orientation(of, flown.synthetic_camera))
            for of in (heads.Heads(bundles=after, failures={}), real)
        )
    ]
    assert_allclose(rms[0], rms[1], atol=0.005)
    assert max(rms[1]) < 0.25  # half the sigma of an image point


@pytest.mark.slow
def test_the_ground_moves_as_between_two_calibrations():
    """Where the freed one intersects what the held one shows, in neighbouring images."""
    found = calibrated("single-head")
    d, _ = budget.displacement(found, held.of_mounting(found))
    block = found.bundle.network.block
    real = mounting.single_step(block, Model(free=("f", *LENS)))
    flight = budget.like(block, found.calibration.cameras[0])
    mapping = budget.fly(found.calibration.cameras[0], flight)
    camera = found.calibration.cameras[0]
    size = np.array([camera.width_px - 1.0, camera.height_px - 1.0])
    corners = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    middle = len(mapping.images) // 2
    ground = on_plane(mapping, camera, middle, corners)
    before, after = (
        intersected(mapping, camera, of.calibration.cameras[0], ground) for of in (found, real)
    )
    assert_allclose(before, ground, atol=1e-6)
    assert_allclose(d, after - before, atol=0.02 * np.abs(d).max())


def on_plane(mapping, camera, image, colrow):
    T = (mapping.trajectory.T_m_b[[image]] @ camera.T_b_c)[np.zeros(len(colrow), int)]
    towards = directions(seen(camera, T, colrow))
    return T.r - towards * (T.r[:, 2] / towards[:, 2])[:, None]


def seen(camera, T_m_c, colrow):
    camera_idx = np.zeros(len(colrow), dtype=int)
    return Measurement(cameras=(camera,), camera_idx=camera_idx, T_m_c=T_m_c, colrow=colrow)


def intersected(mapping, shown_by, camera, ground):
    """Return points from all images of a mapping flight that show them, seen by another camera."""
    n = len(mapping.images)
    image, point = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(len(ground))))
    bodies = mapping.trajectory.T_m_b[image]
    colrow = project(shown_by, bodies @ shown_by.T_b_c, ground[point])
    shown = np.isfinite(colrow).all(axis=1) & inside(shown_by, colrow)
    T = (bodies @ camera.T_b_c)[shown]
    rays = directions(seen(camera, T, colrow[shown]))
    return intersect(T.r, rays, point[shown], len(ground))


# --- known from a laboratory -------------------------------------------------------------------


@pytest.mark.parametrize("sigma_mm", [0.2, 0.05, 0.01])
def test_a_known_focal_length_is_the_weighted_mean_of_laboratory_and_flight(sigma_mm):
    flown, _ = study()
    alone = select_cameras(flown.heads, ["CAM1"])
    free = ("f", *flown.estimate_heads)
    by_flight = adjust(free_orientation(alone, Model(free=free)))
    known = replace(alone.cameras[0], prior=Prior(interior=(sigma_mm, np.inf, np.inf)))
    both = adjust(free_orientation(replace(alone, cameras=(known,)), Model(free=free)))
    column = both.network.layout.interior[0, 0]
    values = [by_flight.state.interiors[0].f, known.interior.f]
    cofactor = [by_flight.solution.cov[column, column], sigma_mm**2]
    weights = 1 / np.array(cofactor)
    mean = weights @ values / weights.sum()
    sigma = weights.sum() ** -0.5
    assert both.state.interiors[0].f == pytest.approx(mean, abs=0.01 * sigma)
    assert np.sqrt(both.solution.cov[column, column]) == pytest.approx(sigma, rel=0.002)
    group = both.solution.group("interior")
    assert group.used.sum() == 1
    assert both.solution.n_observations == by_flight.solution.n_observations + 1
