"""What an adjustment determines least is found and called by the names of results."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from acx4lib.bundle.adjust import adjust
from acx4lib.bundle.rejections import noncentrality
from acx4lib.bundle.uses import free_orientation, mounted_orientation
from acx4lib.calibration import determination
from acx4lib.calibration.determination import (
    SHARE,
    STRONG,
    as_json,
    beyond_precision,
    detectable,
    strong_correlations,
    weakest_combination,
)
from acx4lib.calibration.estimates import from_bundle, given, parameters, reported_covariance
from support import blocks


@pytest.fixture(scope="module")
def on_control():
    """A bundle over nearly flat ground, on control points alone, that estimates f."""
    flat = blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M]
    block = blocks.simulate(
        blocks.fly(), ties=blocks.terrain(40, relief_m=5.0), control=flat, cameras=(blocks.CAMERA,)
    )
    return adjust(free_orientation(block, free=("f", "xp", "yp")))


def test_f_goes_with_the_height_of_all_positions(on_control):
    """Over flat ground only the ratio of the two is known: half of the combination is each."""
    parts = weakest_combination(on_control)
    assert {part.unknown for part in parts[:2]} == {"CAM/f_mm", "height of all positions"}
    assert [part.share for part in parts[:2]] == pytest.approx([0.5, 0.5], abs=0.05)


def test_images_with_one_point_are_named_where_double_precision_ends(exact_block):
    points = exact_block.image_points
    rest = np.setdiff1d(np.arange(len(points)), np.flatnonzero(points.image_idx == 3)[1:])
    block = replace(exact_block, image_points=points[rest])
    fit = adjust(free_orientation(block, free=("xp", "yp")))
    name = block.images.names[3]
    assert beyond_precision(fit).endswith(
        "is more than double precision can carry: the observations do not determine the position "
        f"and attitude of {name} (measured points: 1)"
    )


def test_a_weak_block_is_not_beyond_precision(on_control):
    assert beyond_precision(on_control) == ""


def test_shares_are_of_the_eigenvector_of_the_smallest_eigenvalue(mounted):
    """The inverse of the covariance is the normal matrix that was reduced by the points."""
    N = np.linalg.inv(mounted.solution.cov)
    scale = 1 / np.sqrt(np.diag(N))
    _, vectors = linalg.eigh(N * scale[:, None] * scale)
    squares = vectors[:, 0] ** 2
    pose = mounted.network.layout.pose
    names = mounted.network.column_names()
    own = {n: squares[i] for i, n in enumerate(names) if i < pose.min()}
    parts = {part.unknown: part.share for part in weakest_combination(mounted)}
    for name in ("CAM/f", "CAM/lever_z", "CAM/yp", "CAM/lever_y"):
        reported = name + ("_m" if "lever" in name else "_mm")
        assert parts.get(reported, 0.0) == pytest.approx(
            own[name] if own[name] >= SHARE else 0.0, abs=1e-3
        )
    positions = sum(parts.get(f"height of {which}positions", 0.0) for which in ("", "all "))
    of_heights = np.sum(squares[pose[:, 2]])
    assert positions == pytest.approx(of_heights if of_heights >= SHARE else 0.0, abs=1e-3)


def test_the_largest_part_comes_first_and_small_ones_are_left_out(on_control):
    found = [part.share for part in weakest_combination(on_control)]
    assert found == sorted(found, reverse=True)
    assert min(found) >= SHARE
    assert sum(found) <= 1 + 1e-12


def test_among_several_open_directions_none_is_the_weakest():
    """Without control a self-calibration floats in seven directions."""
    fit = adjust(free_orientation(blocks.standard(control=None), free=("xp", "yp")))
    assert fit.solution.defect == 7
    assert weakest_combination(fit) == ()


def test_strong_correlations_are_those_of_the_reported_covariance():
    """One flying height: f and the lever arm's z are one."""
    strips = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 180.0))
    block = blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M],
    )
    found = from_bundle(adjust(mounted_orientation(block, free=("f", "xp", "yp"))))
    pairs = strong_correlations(found)
    assert (pairs[0].row, pairs[0].column) == ("CAM/f_mm", "CAM/lever_z_m")
    cov = reported_covariance(found)
    related = cov / np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    names = [f"CAM/{p.name}" for p in parameters(found)]
    strong = np.argwhere(np.triu(np.abs(related) > STRONG, 1))
    assert {(names[i], names[j]) for i, j in strong} == {(p.row, p.column) for p in pairs}
    for pair in pairs:
        i, j = names.index(pair.row), names.index(pair.column)
        assert pair.correlation == pytest.approx(related[i, j])
    sizes = [abs(pair.correlation) for pair in pairs]
    assert sizes == sorted(sizes, reverse=True)


def test_given_cameras_have_no_correlations(exact_block):
    assert strong_correlations(given(exact_block.cameras)) == ()


def test_a_summary_has_it_as_plain_numbers(on_control):
    entry = json.loads(json.dumps(as_json(on_control, from_bundle(on_control))))
    assert entry["condition"] == on_control.solution.condition
    assert list(entry["weakest"])[:1] == [weakest_combination(on_control)[0].unknown]
    assert all(len(pair) == 3 for pair in entry["correlated"])


# --- Correlations of interior and exterior orientation


def test_correlations_are_those_of_the_covariance(fits):
    """East, north, height turned back to the mapping frame's axes must give the raw ones."""
    fit = fits["CAM2"]
    found = determination.interior_exterior(fit)
    assert found.interior == ("xp_mm", "yp_mm", "k1", "p1", "p2")
    assert found.values.shape == (31, 5, 6)
    assert np.abs(found.values).max() <= 1.0
    network = fit.network
    pose, interior = network.layout.pose[4], network.layout.interior[0]
    cov = fit.solution.cov
    # the share of an interior parameter's variance that the pose explains has no axes
    for j, column in enumerate(interior[interior >= 0]):
        raw = cov[column, pose] @ np.linalg.solve(cov[np.ix_(pose, pose)], cov[pose, column])
        assert np.all(found.values[4, j] ** 2 <= raw / cov[column, column] + 1e-12)
    sigma_z = np.sqrt(cov[pose[2], pose[2]] * cov[interior[1], interior[1]])
    # 2 km from its origin the mapping frame's z is the grid's height up to 0.02 degrees
    assert found.values[4, 0, 2] == pytest.approx(cov[interior[1], pose[2]] / sigma_z, abs=0.01)


def test_the_largest_pairs_are_named_as_results_name_them(fits):
    found = determination.interior_exterior(fits["CAM1"])
    pairs = determination.largest_pairs(found, n=3)
    assert list(pairs.values()) == sorted(pairs.values(), reverse=True)
    assert next(iter(pairs.values())) == np.abs(found.values).max()
    assert all(
        name.split("/")[0] in found.interior and name.split("/")[1] in determination.EXTERIOR
        for name in pairs
    )


# --- Detectable errors by group, and what those that escape do


FREE = ("f", "xp", "yp")


@pytest.fixture(scope="module")
def bundle():
    return adjust(mounted_orientation(blocks.standard(), free=FREE))


def test_every_component_of_every_group_is_there(bundle):
    found = [(one.kind, one.component) for one in detectable(bundle)]
    sizes = {"image_point": 2, "control_point": 3, "gnss": 3, "attitude": 3}
    assert found == [(kind, d) for kind, n in sizes.items() for d in range(n)]


def test_the_redundancy_numbers_add_up_and_the_errors_follow_from_them(bundle):
    found = detectable(bundle)
    total = sum(one.redundancy.sum() for one in found)
    assert total == pytest.approx(bundle.solution.redundancy)
    gnss = bundle.network.observed.sigma_position
    for one in (one for one in found if one.kind == "gnss"):
        expected = noncentrality() * gnss[:, one.component] / np.sqrt(one.redundancy)
        np.testing.assert_allclose(one.bias, expected)


def test_an_error_that_just_escapes_moves_the_parameter_by_what_is_said(bundle):
    one = next(one for one in detectable(bundle) if (one.kind, one.component) == ("gnss", 2))
    assert one.on.split("/")[1] in (*FREE, "lever_x", "lever_y", "lever_z", *BORESIGHT)
    # no effect on a parameter is above delta_0 sqrt((1 - r) / r), that on the worst function
    r = one.redundancy.min()
    assert 0 < one.effect <= noncentrality() * np.sqrt((1 - r) / r)


BORESIGHT = ("boresight_x", "boresight_y", "boresight_z")


def test_without_parameters_nothing_is_moved():
    held = adjust(mounted_orientation(blocks.standard(), free=(), free_mount=()))
    assert all(np.isnan(one.effect) and one.on == "" for one in detectable(held))
