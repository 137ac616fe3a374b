"""Gross errors: one of each kind is found exactly, and clean data lose nothing."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import acx4sim
from acx4files import flight
from acx4files.stages.diagnosed import of_validations
from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation
from acx4lib.bundle.gross_errors import adjust_rejecting, expected_failures
from acx4lib.bundle.rejections import Rejection, without
from acx4lib.calibration import heads, mounting
from acx4lib.calibration.estimates import from_bundle, given
from acx4lib.design import ground_height
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.georeferencing.validation import validate
from acx4lib.least_squares.statistics import critical_tau
from acx4lib.model import Model
from support import blocks
from support.flights.simulated import HEADS, fly, named, of_calibration
from support.helpers import repeats

FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def mounted_network(block):
    return mounted_orientation(block, Model(free=FREE))


def free_network(block):
    return free_orientation(block, Model(free=FREE))


def rejections(block, set_up=mounted_network, **options):
    fit = adjust_rejecting(blocks.approximate(block), set_up, **options)
    return [(r.kind, r.row, r.component) for r in fit.rejected], fit


def test_clean_data_lose_nothing(noisy_block):
    assert rejections(noisy_block)[0] == []
    assert rejections(noisy_block, free_network)[0] == []


@pytest.mark.parametrize("set_up", [free_network, mounted_network])
def test_a_wrong_image_point_is_found(noisy_block, set_up):
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 8.0  # px, 16 sigma
    spoilt = blocks.changed(noisy_block, "image_point", by)
    found, fit = rejections(spoilt, set_up)
    assert found == [("image_point", 100, -1)]
    assert 100 not in fit.network.rows
    assert fit.solution.sigma0_sq == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("component", [0, 2])
def test_a_wrong_control_coordinate_is_found_and_the_others_stay(noisy_block, component):
    by = np.zeros((9, 3))
    by[5, component] = 1.5  # m
    found, fit = rejections(blocks.changed(noisy_block, "control_point", by))
    assert found == [("control_point", 5, component)]
    used = fit.solution.group("control_point").used
    assert used.sum() == 26
    assert not used[5, component]


@pytest.mark.parametrize(
    ("kind", "component", "size"),
    [
        ("gnss", 2, 1.5),
        ("gnss", 0, 2.0),  # a shift along the flight looks much like a pitch: it takes 100 sigma
        ("attitude", 2, np.radians(0.1)),
        ("attitude", 1, np.radians(0.2)),
    ],
)
def test_a_wrong_trajectory_row_is_found(noisy_block, kind, component, size):
    by = np.zeros((len(noisy_block.trajectory), 3))
    by[7, component] = size
    found, fit = rejections(blocks.changed(noisy_block, kind, by))
    assert found == [(kind, 7, -1)]
    assert not fit.solution.group(kind).used[7].any()
    # the other half of the row stays an observation
    other = {"gnss": "attitude", "attitude": "gnss"}[kind]
    assert fit.solution.group(other).used[7].all()


def test_one_error_of_each_kind_is_found_at_once(noisy_block):
    block = noisy_block
    for kind, row, component, size in (
        ("image_point", 30, 0, 12.0),
        ("control_point", 2, 1, 2.0),
        ("gnss", 10, 2, 1.5),
        ("attitude", 4, 2, np.radians(0.3)),
    ):
        by = np.zeros_like(blocks.observed_sigmas(block)[kind])
        by[row, component] = size
        block = blocks.changed(block, kind, by)
    found, _ = rejections(block)
    assert sorted(found) == [
        ("attitude", 4, -1),
        ("control_point", 2, 1),
        ("gnss", 10, -1),
        ("image_point", 30, -1),
    ]


@pytest.mark.parametrize("sigmas", [100, 400])
def test_a_control_point_that_is_far_off_does_not_take_its_image_points_along(noisy_block, sigmas):
    """Its error widens the spread of all control residuals, and must still be the first to go."""
    by = np.zeros((9, 3))
    by[5, 0] = 0.01 * sigmas
    found, _ = rejections(blocks.changed(noisy_block, "control_point", by))
    assert found == [("control_point", 5, 0)]


def test_the_statistic_of_a_rejection_is_about_its_error_over_its_sigma(noisy_block):
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 50.0  # px; of 0.5 px
    _, fit = rejections(blocks.changed(noisy_block, "image_point", by))
    redundancy = adjust(mounted_network(blocks.approximate(noisy_block))).solution
    at = np.flatnonzero(mounted_network(blocks.approximate(noisy_block)).rows == 100)[0]
    share = redundancy.group("image_point").redundancy[at, 1]
    # w = r (e / sigma) / sqrt(r), give or take its own noise of one
    assert fit.rejected[0].statistic == pytest.approx(100 * np.sqrt(share), abs=4)


def test_the_iterations_are_those_of_all_adjustments(noisy_block):
    """The last one begins at the minimum, and has none of its own."""
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 50.0  # px; of 0.5 px
    spoilt = blocks.changed(noisy_block, "image_point", by)
    _, fit = rejections(spoilt)
    last = adjust(fit.network.beginning_at(fit.state))
    assert last.solution.iterations == 0
    assert fit.solution.iterations > 1


def test_a_wrong_weight_is_no_gross_error(noisy_block):
    """Sigmas five times too small make all w five times too large, and reject nothing."""
    points = noisy_block.image_points
    eager = replace(noisy_block, image_points=replace(points, sigma_px=points.sigma_px / 5))
    found, fit = rejections(eager, free_network)
    assert [row for row in found if row[0] == "image_point"] == []
    assert fit.solution.sigma0_sq > 10


# --- many at once ----------------------------------------------------------------------------


def spoilt_in_many_places(block, rng, *, share=0.03):
    """Return the block with gross errors of every kind, and what they are."""
    n = len(block.image_points)
    rows = np.sort(rng.choice(n, int(share * n), replace=False))
    size = np.exp(rng.uniform(np.log(8.0), np.log(200.0), len(rows)))
    angle = rng.uniform(0, 2 * np.pi, len(rows))
    by = {kind: np.zeros_like(sigma) for kind, sigma in blocks.observed_sigmas(block).items()}
    by["image_point"][rows] = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    by["control_point"][2, 1] = 1.5
    by["gnss"][10] = [1.0, -2.0, 2.0]
    by["attitude"][4, 2] = np.radians(0.3)
    for kind, change in by.items():
        block = blocks.changed(block, kind, change)
    others = {("control_point", 2, 1), ("gnss", 10, -1), ("attitude", 4, -1)}
    return block, {("image_point", int(row), -1) for row in rows} | others


@pytest.mark.parametrize("seed", range(6))
def test_all_of_many_gross_errors_are_found_and_hardly_anything_else(noisy_block, mounted, seed):
    spoilt, wrong = spoilt_in_many_places(noisy_block, np.random.default_rng(seed))
    found, fit = rejections(spoilt)
    few_rays = noisy_block.rays[noisy_block.image_points.point_idx] < 4
    certain = {w for w in wrong if w[0] != "image_point" or not few_rays[w[1]]}
    assert certain <= set(found)
    # a test of 0.01 % per component takes out 0.1 of these 450 points on average
    assert len(set(found) - wrong) <= 1
    ours, clean = fit.state.interiors[0].to_array(), mounted.state.interiors[0].to_array()
    columns = fit.network.layout.interior[0]
    sigma = np.sqrt(np.diag(fit.solution.cov))[columns[columns >= 0]]
    # both have the good observations in common, so they differ by less than a sigma
    assert np.all(np.abs(ours - clean)[columns >= 0] < sigma)


def test_a_statistic_is_the_w_of_the_observation_put_back(noisy_block):
    spoilt, _ = spoilt_in_many_places(noisy_block, np.random.default_rng(3))
    start = blocks.approximate(spoilt)
    fit = adjust_rejecting(start, mounted_network)
    for kind in ("image_point", "control_point", "gnss", "attitude"):
        one = next(r for r in fit.rejected if r.kind == kind)
        network = mounted_network(without(start, [r for r in fit.rejected if r is not one]))
        back = adjust(replace(network, start=fit.state)).solution.group(kind).w
        at = np.flatnonzero(network.rows == one.row)[0] if kind == "image_point" else one.row
        w = back[at, one.component] if one.component >= 0 else np.abs(back[at]).max()
        # predicted at the solution without it; put back, it bends the others a little
        assert abs(w) == pytest.approx(one.statistic, rel=0.02)


def test_rejections_come_with_the_largest_first_and_exceed_their_limit(noisy_block):
    spoilt, _ = spoilt_in_many_places(noisy_block, np.random.default_rng(0))
    rejected = rejections(spoilt)[1].rejected
    statistics = [r.statistic for r in rejected]
    assert statistics == sorted(statistics, reverse=True)
    assert all(r.statistic > r.limit >= 3.9 for r in rejected)


def test_nothing_that_is_left_fails_its_test(noisy_block):
    spoilt, _ = spoilt_in_many_places(noisy_block, np.random.default_rng(1))
    _, fit = rejections(spoilt)
    assert all(np.nanmax(np.abs(group.w), initial=0.0) < 3.9 for group in fit.solution.groups)


def test_of_two_rays_that_do_not_meet_one_is_rejected_and_the_point_left_out(noisy_block):
    """Which of them is wrong cannot be known; the other controls nothing any more."""
    points = noisy_block.image_points
    last = points.point_idx == points.point_idx.max()
    first, second = np.flatnonzero(last)[[0, -1]]
    sigma_px = np.where(last, np.inf, points.sigma_px)
    sigma_px[[first, second]] = points.sigma_px[[first, second]]
    by = np.zeros((len(points), 2))
    by[first] = [40.0, 40.0]
    spoilt = blocks.changed(
        replace(noisy_block, image_points=replace(points, sigma_px=sigma_px)), "image_point", by
    )
    found, fit = rejections(spoilt)
    assert found in ([("image_point", first, -1)], [("image_point", second, -1)])
    assert fit.network.left_out == {"measured once": 1}


# --- where sigma0 is estimated ---------------------------------------------------------------


def test_tau_needs_ratios_of_sigmas_only(noisy_block):
    """With all sigmas four times too small, the one error is found and nothing else."""
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 8.0
    block = blocks.changed(noisy_block, "image_point", by)
    points, control, trajectory = block.image_points, block.control, block.trajectory
    eager = replace(
        block,
        image_points=replace(points, sigma_px=points.sigma_px / 4),
        control=replace(control, sigma_m=control.sigma_m / 4),
        trajectory=replace(
            trajectory,
            sigma_position=trajectory.sigma_position / 4,
            sigma_attitude=trajectory.sigma_attitude / 4,
        ),
    )
    found, fit = rejections(eager, sigma0="estimated")
    assert found == [("image_point", 100, -1)]
    sigma0 = np.sqrt(fit.solution.sigma0_sq)
    assert sigma0 == pytest.approx(4.0, rel=0.1)
    limit = sigma0 * critical_tau(3.9, fit.solution.redundancy)
    assert fit.rejected[0].limit == pytest.approx(limit, rel=1e-4)
    assert rejections(block, sigma0="estimated")[0] == found


def test_another_word_for_sigma0_is_refused(noisy_block):
    with pytest.raises(ValueError, match="one of known, estimated, got 'guessed'"):
        rejections(noisy_block, sigma0="guessed")


# --- As many tests fail by chance as they should


def test_one_in_ten_thousand_components_fails(mounted):
    groups = mounted.solution.groups
    n = sum(int(group.used.sum()) for group in groups)
    assert expected_failures(mounted) == pytest.approx(n * 9.6e-5, rel=0.01)  # of a normal variable


def test_at_a_low_limit_that_many_fail(exact_block):
    """At a critical value of 2, 4.55 % of all w exceed it; tests of one flight are correlated."""
    found, predicted = 0, 0.0
    for seed in range(12):
        start = blocks.approximate(blocks.noisy(exact_block, np.random.default_rng(seed)))
        fit = adjust(mounted_orientation(start, Model(free=("f", "xp", "yp", "k1", "p1", "p2"))))
        found += sum(int(np.sum(np.abs(g.w[g.used]) > 2)) for g in fit.solution.groups)
        predicted += expected_failures(fit, critical=2.0)
    assert predicted > 500
    low, high = stats.poisson.interval(0.999, predicted)
    assert low < found < high


# --- Single rows of control points that are absurd: named and rejected, and nothing else changes


def by(metres):
    """Return what moves a coordinate."""
    return lambda cell: repr(float(cell) + metres)


ABSURD = {
    "east 90": {"east_m": "90"},
    "0, 0": {"east_m": "0", "north_m": "0"},
    "100 km": {"north_m": by(1e5)},
    "1e8": {"east_m": "1e8"},
    "1 km": {"east_m": by(1e3)},
    "160 m": {"east_m": by(160.0)},
    "height 0": {"height_m": "0"},
    "too high": {"height_m": "1e5"},
    "degrees": {"east_m": "-49.3", "north_m": "-25.4"},
}


def spoil(folder, design, values, rows, *, table="control_points.csv", options=None):
    """Write a simulated flight and change rows of control; return the folder and their names."""
    acx4sim.write(acx4sim.DESIGNS[design](seed=1, options=options or acx4sim.Options()), folder)
    with (folder / table).open(newline="") as file:
        lines = list(csv.reader(file))
    for row in rows:
        for name, value in values.items():
            at = lines[0].index(name)
            lines[row][at] = value(lines[row][at]) if callable(value) else value
    with (folder / table).open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)
    return folder, [lines[row][0] for row in rows]


def lacking(block, names):
    """Return a block whose control does not have some points."""
    rows = [k for k, i in enumerate(block.control.point_idx) if block.points[i] in names]
    return without(
        block, [Rejection(kind="control_point", row=k, component=-1, statistic=0.0) for k in rows]
    )


def assert_as_without(found, clean, names, block):
    """Assert that a bundle is what it is without these points, and that they are named.

    Of a point with three rays these may go as well; that moves a head by 0.03 sigma.
    """
    a, b = of_calibration(from_bundle(found)), of_calibration(from_bundle(clean))
    known = a.sigma > 0
    np.testing.assert_allclose((a.values - b.values)[known] / a.sigma[known], 0, atol=0.05)
    said = {point for kind, _, point in named(block, found.rejected) if kind == "control_point"}
    assert set(names) <= said
    more = named(block, found.rejected) - named(block, clean.rejected)
    assert {point for _, _, point in more} <= set(names)


@pytest.mark.parametrize("rows", [repeats([3]), [3, 12]], ids=["one", "two"])
@pytest.mark.parametrize("kind", ABSURD)
def test_absurd_control_is_rejected_in_a_single_step(tmp_path, kind, rows):
    options = acx4sim.Options(blocks=("calibration",))
    path, names = spoil(tmp_path / "f", "single-head", ABSURD[kind], rows, options=options)
    spoilt, clean = flight.read(path), fly("single-head", seed=1).flight
    free = clean.estimate_mounting
    found = mounting.calibrate(spoilt.calibration, Model(free=free))
    assert not found.failures
    reference = mounting.single_step(lacking(clean.calibration, names), Model(free=free))
    bundle = found["single_step"].bundle
    assert_as_without(bundle, reference.bundle, names, spoilt.calibration)
    chance = named(clean.calibration, reference.bundle.rejected)
    absurd = {("control_point", "", name) for name in names}
    assert named(spoilt.calibration, bundle.rejected) == chance | absurd
    for method in ("two_step", "two_step_gnss"):
        assert found[method].bundle.rejected == bundle.rejected


@pytest.mark.parametrize(
    "kind", ["160 m", *map(repeats, ("too high", "east 90", "1e8", "height 0", "degrees"))]
)
def test_absurd_control_is_rejected_in_every_head_that_sees_it(tmp_path, kind):
    options = acx4sim.Options(blocks=("heads",))
    path, names = spoil(tmp_path / "f", "acx4", ABSURD[kind], [3, 12], options=options)
    spoilt, clean = flight.read(path), fly("acx4", seed=1, blocks=("heads",)).flight
    free = clean.estimate_heads
    found = heads.calibrate_heads(spoilt.heads, HEADS, Model(free=free))
    assert not found.failures
    reference = heads.calibrate_heads(lacking(clean.heads, names), HEADS, Model(free=free))
    for head, bundle in found.bundles.items():
        own = bundle.network.block
        seen = [own.points[i] for i in np.flatnonzero(own.rays) if own.points[i] in names]
        assert_as_without(bundle, reference.bundles[head], seen, own)


@pytest.mark.parametrize("kind", ["east 90", "1e8", "height 0", "too high"])
def test_an_absurd_check_point_is_rejected_and_the_others_stay(tmp_path, kind):
    options = acx4sim.Options(blocks=("validation",))
    table = "validation/control_points.csv"
    path, names = spoil(
        tmp_path / "f", "single-head", ABSURD[kind], [3, 5], table=table, options=options
    )
    spoilt = flight.read(path).validation
    clean = fly("single-head", seed=1, blocks=("validation",)).flight.validation
    found, reference = (validate(b, given(b.cameras), method="given") for b in (spoilt, clean))
    record = of_validations([found])[0].tables
    rejected = record["rejected"]
    rejected = rejected[rejected["kind"] == "control_point"]
    assert list(rejected["point"]) == names
    assert rejected["reason"].str.fullmatch(r"position: w = \d+\.\d exceeds 3.9").all()
    other = of_validations([reference])[0].tables["check_points"]
    other = other[~other["point"].isin(names)]
    np.testing.assert_array_equal(record["check_points"]["d_east_m"], other["d_east_m"])
    assert found.n_left_out == reference.n_left_out


def test_a_check_point_that_is_off_by_metres_stays_for_all_to_see(tmp_path):
    options = acx4sim.Options(blocks=("validation",))
    table, moved = "validation/control_points.csv", {"east_m": by(10.0)}
    path, _ = spoil(tmp_path / "f", "single-head", moved, [3], table=table, options=options)
    block = flight.read(path).validation
    found = validate(block, given(block.cameras), method="given")
    assert not [r for r in found.rejected if r.kind == "control_point"]
    assert np.abs(found.points.d[:, 0]).max() > 9


@pytest.mark.parametrize("kind", ["east 90", "1e8", "too high"])
def test_a_single_absurd_row_is_a_note_and_named(tmp_path, kind):
    path, (first, second) = spoil(tmp_path / "f", "single-head", ABSURD[kind], [3, 12])
    (note,) = [n for n in flight.read(path).notes if "nowhere near" in n]
    assert note.startswith(f"calibration: 2 of 20 surveyed points of {path / 'control_points.csv'}")
    assert f"{first!r} (line 4)" in note
    assert f"{second!r} (line 13)" in note


@pytest.mark.parametrize(("kind", "said"), [("1e8", "is nowhere"), ("too high", "is below")])
def test_more_than_single_absurd_rows_are_refused_as_ever(tmp_path, kind, said):
    path, _ = spoil(tmp_path / "f", "single-head", ABSURD[kind], [3, 6, 12])
    with pytest.raises(FlightError, match=said):
        flight.read(path)


def test_an_absurd_height_is_no_part_of_the_ground(tmp_path):
    path, _ = spoil(tmp_path / "f", "single-head", ABSURD["too high"], [3])
    spoilt, clean = flight.read(path), fly("single-head", seed=1).flight
    for name, block in spoilt.blocks.items():
        # the mean of the surveyed points is that of one point fewer
        assert ground_height(block) == pytest.approx(ground_height(clean.blocks[name]), abs=2.0)


def test_a_bad_start_casts_no_doubt_on_single_points(exact_block):
    """The mounting 12 degrees off, which every point shows alike: none is taken out."""
    turn = rotation_from_opk(np.radians([12.0, 0.0, 0.0]))
    turned = [replace(c, T_b_c=replace(c.T_b_c, R=c.T_b_c.R @ turn)) for c in exact_block.cameras]
    found = mounting.single_step(
        replace(exact_block, cameras=tuple(turned)), Model(free=("xp", "yp"))
    )
    assert found.bundle.rejected == ()
