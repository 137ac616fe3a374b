"""What was rejected is taken out of a block, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.block import NO_POINTS
from acx4lib.bundle.adjust import mounted_orientation
from acx4lib.bundle.gross_errors import adjust_rejecting
from acx4lib.bundle.rejections import (
    OF_CAMERA,
    OF_IMAGE,
    ROWS,
    Rejection,
    noncentrality,
    sentence,
    too_many,
    within_limits,
    without,
)
from acx4lib.errors import AdjustmentError
from acx4lib.model import Model
from support import blocks


def test_rejected_observations_are_taken_out_of_the_block(exact_block):
    rejected = [
        Rejection(kind="image_point", row=3, component=-1, statistic=9.0),
        Rejection(kind="control_point", row=2, component=1, statistic=9.0),
        Rejection(kind="gnss", row=4, component=-1, statistic=9.0),
        Rejection(kind="attitude", row=5, component=-1, statistic=9.0),
    ]
    cleaned = without(exact_block, rejected)
    for kind, sigma in blocks.observed_sigmas(cleaned).items():
        row = {"image_point": 3, "control_point": 2, "gnss": 4, "attitude": 5}[kind]
        out = np.isinf(sigma)
        assert np.flatnonzero(out.any(axis=1)).tolist() == [row]
        assert out[row].sum() == {"image_point": 2, "control_point": 1}.get(kind, 3)
        assert np.isfinite(blocks.observed_sigmas(exact_block)[kind]).all()  # unharmed


def test_a_control_point_without_a_component_goes_as_a_whole(exact_block):
    whole = Rejection(kind="control_point", row=2, component=-1, statistic=9.0)
    out = np.isinf(without(exact_block, [whole]).control.sigma_m)
    assert np.flatnonzero(out.any(axis=1)).tolist() == [2]
    assert out[2].all()


def test_delta_0_of_text_books():
    assert noncentrality(critical=3.29, power=0.8) == pytest.approx(4.13, abs=0.005)  # Baarda
    assert noncentrality() == pytest.approx(3.9 + 0.8416, abs=1e-4)


# --- Single errors are rejected; a part of a group that is too large is named and stays


FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def adjusted(block):
    start = blocks.approximate(block)
    return adjust_rejecting(start, lambda b: mounted_orientation(b, Model(free=FREE)))


def with_errors(block, kind, rows, component, size):
    by = np.zeros_like(blocks.observed_sigmas(block)[kind])
    by[rows, component] = size
    return blocks.changed(block, kind, by)


def test_a_block_in_which_no_point_has_two_rays_is_its_trajectory(exact_block):
    points = exact_block.image_points
    _, first = np.unique(points.point_idx, return_index=True)
    block = replace(exact_block, image_points=points[first], control=NO_POINTS, check=NO_POINTS)
    fit = adjust_rejecting(
        block, lambda b: mounted_orientation(b, Model(fix=("lever_arm", "boresight")))
    )
    assert (fit.solution.redundancy, fit.rejected) == (0, ())


@pytest.mark.parametrize(
    ("limit", "n_rejected", "n", "stops"),
    [
        (ROWS, 0, 0, False),
        (ROWS, 2, 4, False),
        (ROWS, 3, 30, False),
        (ROWS, 3, 29, True),
        (ROWS, 5, 40, True),
        (OF_IMAGE, 9, 12, False),
        (OF_IMAGE, 10, 30, False),
        (OF_IMAGE, 10, 29, True),
        (OF_CAMERA, 9, 20, False),
        (OF_CAMERA, 100, 500, False),
        (OF_CAMERA, 101, 500, True),
    ],
)
def test_a_tenth_of_rows_a_third_of_an_image_a_fifth_of_a_camera_stop(limit, n_rejected, n, stops):
    assert too_many(n_rejected, n, limit) is stops


@pytest.mark.parametrize(("component", "name"), [(0, "roll"), (1, "pitch"), (2, "heading")])
def test_wrong_attitudes_stay_and_are_named_by_their_component(noisy_block, component, name):
    """As with a wrong sign: every row is off, each by another amount."""
    n = len(noisy_block.trajectory)
    size = np.radians(np.random.default_rng(5).uniform(-3, 3, n))
    fit = adjusted(with_errors(noisy_block, "attitude", np.arange(n), component, size))
    (stopped,) = fit.stopped
    assert stopped.kind == "attitude"
    assert stopped.components == (name,)
    assert stopped.group == f"attitudes ({name})"
    assert stopped.n == n
    assert stopped.n_rejected >= n - 3  # a few errors are small, by chance
    assert [r for r in fit.rejected if r.kind == "attitude"] == []
    assert fit.solution.group("attitude").used.all()
    assert fit.solution.sigma0_sq > 100
    assert f"of {n} attitudes ({name}): a systematic error or a wrong sigma" in sentence(
        fit.stopped
    )


def test_two_wrong_attitudes_of_twelve_are_single_errors(noisy_block):
    spoilt = with_errors(noisy_block, "attitude", [3, 8], 2, np.radians([0.5, -0.4]))
    fit = adjusted(spoilt)
    assert fit.stopped == ()
    assert sorted((r.kind, r.row, r.largest) for r in fit.rejected) == [
        ("attitude", 3, 2),
        ("attitude", 8, 2),
    ]


def test_attitudes_are_counted_by_component(noisy_block):
    """Two wrong rolls and two wrong headings are four rows of twelve, but no component's three."""
    rows = [Rejection(kind="attitude", row=i, component=-1, statistic=9.0) for i in range(4)]
    block, none = noisy_block, np.zeros(0, dtype=np.intp)
    apart = [replace(r, largest=2 * (r.row % 2)) for r in rows]
    assert within_limits(block, none, apart) == (tuple(apart), ())
    kept, (stopped,) = within_limits(block, none, [replace(r, largest=1) for r in rows])
    assert kept == ()
    assert (stopped.n_rejected, stopped.n, stopped.components) == (4, 12, ("pitch",))


def test_gnss_heights_of_every_other_exposure_stay(noisy_block):
    rows = np.arange(0, 12, 3)
    fit = adjusted(with_errors(noisy_block, "gnss", rows, 2, 3.0))
    assert [s.group for s in fit.stopped] == ["GNSS positions (height)"]
    assert {r.kind for r in fit.rejected} <= {"image_point"}


def test_control_points_of_which_a_third_is_off_stay(noisy_block):
    fit = adjusted(with_errors(noisy_block, "control_point", [0, 4, 7], 2, [3.0, -2.0, 2.5]))
    (stopped,) = fit.stopped
    assert (stopped.kind, stopped.n_rejected, stopped.n) == ("control_point", 3, 9)
    assert fit.solution.group("control_point").used.all()


def test_half_of_the_rays_of_an_image_stay_and_it_is_named(noisy_block):
    points = noisy_block.image_points
    of_image = np.flatnonzero(points.image_idx == 4)
    rng = np.random.default_rng(3)
    half = rng.choice(of_image, len(of_image) // 2, replace=False)
    size = rng.uniform(30, 60, (len(half), 2)) * rng.choice([-1, 1], (len(half), 2))
    by = np.zeros((len(points), 2))
    by[half] = size
    fit = adjusted(blocks.changed(noisy_block, "image_point", by))
    (stopped,) = fit.stopped
    assert stopped.names == (f"image {noisy_block.images.names[4]}",)
    assert stopped.n == len(of_image)
    assert len(half) - 2 <= stopped.n_rejected <= len(half) + 1
    assert not set(of_image) & {r.row for r in fit.rejected}
    assert f"of {len(of_image)} rays of image" in sentence(fit.stopped)


def test_a_quarter_of_a_cameras_rays_stop_and_no_image_is_named_beside_it(noisy_block):
    """What is counted does not depend on how the rays were found."""
    block = noisy_block
    rows = np.arange(len(block.image_points))
    every_fourth = [
        Rejection(kind="image_point", row=int(row), component=-1, statistic=9.0)
        for row in rows[::4]
    ]
    kept, (stopped,) = within_limits(block, rows, every_fourth)
    assert kept == ()
    assert stopped.group == "rays of camera CAM"
    assert (stopped.n_rejected, stopped.n) == (len(every_fourth), len(rows))
    every_sixth = every_fourth[: len(rows) // 6]
    assert within_limits(block, rows, every_sixth[: len(rows) // 30])[1] == ()


def test_many_images_make_one_short_sentence(noisy_block):
    """Of 12 images, 5 lose two rays of five: 17 % of the camera's."""
    image = noisy_block.image_points.image_idx
    rows = [r for i in range(5) for r in np.flatnonzero(image == i)[::5]]
    rows += [r for i in range(5) for r in np.flatnonzero(image == i)[1::5]]
    lost = [Rejection(kind="image_point", row=int(r), component=-1, statistic=9.0) for r in rows]
    kept, (stopped,) = within_limits(noisy_block, np.arange(len(image)), lost)
    assert kept == ()
    assert len(stopped.names) == 5
    assert stopped.group == f"rays of {stopped.names[0]}, and too many of 4 other images"
    assert 5 * stopped.n_rejected // stopped.n == 2


def test_control_points_do_not_go_by_way_of_their_rays(noisy_block):
    """Points 300 m off are no longer seen where they should be: every ray of them would go."""
    wrong = [0, 4, 7]
    spoilt = with_errors(noisy_block, "control_point", wrong, 0, 300.0)
    fit = adjusted(spoilt)
    assert [(s.kind, s.n_rejected, s.n) for s in fit.stopped] == [("control_point", 3, 9)]
    points = fit.network.image_points
    assert set(wrong) <= set(points.point_idx.tolist())


def test_where_nothing_converges_with_the_group_the_group_is_still_named(noisy_block):
    """Three of nine control points lie kilometres off: no single error any more."""
    spoilt = with_errors(noisy_block, "control_point", [0, 4, 7], 0, [3e5, -4e5, 2e5])
    with pytest.raises(AdjustmentError):
        adjusted(spoilt)


@pytest.mark.parametrize("seed", range(30))
def test_clean_flights_stop_nowhere(exact_block, seed):
    fit = adjusted(blocks.noisy(exact_block, np.random.default_rng(seed)))
    assert fit.stopped == ()
    assert len(fit.rejected) <= 1  # 0.1 of some thousand components by chance


@pytest.mark.parametrize("seed", range(3))
def test_five_percent_of_wrong_image_points_are_rejected_and_stop_nothing(noisy_block, seed):
    rng, n = np.random.default_rng(seed), len(noisy_block.image_points)
    rows = rng.choice(n, n // 20, replace=False)
    by = np.zeros((n, 2))
    size, along = rng.uniform(20, 200, len(rows)), rng.uniform(0, 2 * np.pi, len(rows))
    by[rows] = (size * np.array([np.cos(along), np.sin(along)])).T
    fit = adjusted(blocks.changed(noisy_block, "image_point", by))
    assert fit.stopped == ()
    certain = {int(r) for r in rows if noisy_block.rays[noisy_block.image_points.point_idx[r]] >= 4}
    assert certain <= {r.row for r in fit.rejected}
