"""Measurements of the heads in the synthetic image, against a camera that saw the same points."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib.block import ImagePoints, Images, select_cameras
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import METHODS, parameters, reported_covariance, to_reported
from acx4lib.calibration.heads import calibrate_heads, relative_orientation, varied
from acx4lib.calibration.mounting import single_step
from acx4lib.geometry.camera import inside, xy_from_colrow
from acx4lib.least_squares.covariance import half
from acx4lib.model import Model
from acx4lib.synthetic_image.frame import head_from_synthetic
from acx4lib.synthetic_image.rendering import render, render_plan
from acx4lib.synthetic_image.transferred_points import (
    parameter_covariance,
    synthetic_block,
    transfer,
    with_heads,
)
from support.flights import in_heads
from support.flights.simulated import HEADS, read_back
from support.pictures import taken

K = 8


@pytest.fixture(scope="module")
def measured():
    """Return exact measurements of heads that look from one place."""
    return select_cameras(in_heads.one_centre(), HEADS)


@pytest.fixture(scope="module")
def seen():
    """Return what the simulator's ideal camera saw of the same points."""
    return select_cameras(in_heads.one_centre(), ["SYN"])


@pytest.fixture(scope="module")
def transferred(measured, seen):
    return transfer(measured, in_heads.true_orientation(), seen.cameras[0])


def test_transferred_points_are_where_an_ideal_camera_sees_them(measured, seen, transferred):
    points = seen.image_points
    where = {
        (int(seen.images.exposure_idx[i]), int(j)): colrow
        for i, j, colrow in zip(points.image_idx, points.point_idx, points.colrow, strict=True)
    }
    keys = zip(transferred.exposure_idx.tolist(), transferred.point_idx.tolist(), strict=True)
    both = [(i, where[key]) for i, key in enumerate(keys) if key in where]
    assert len(both) > 0.8 * len(points)
    rows, colrow = zip(*both, strict=True)
    # measurements are rounded to a millionth of a pixel
    assert_allclose(transferred.colrow[list(rows)], np.array(colrow), atol=3e-6)
    assert transferred.n_left_out > 0  # the heads see more than the frame
    assert inside(seen.cameras[0], transferred.colrow).all()


def test_a_single_step_on_transferred_points_finds_the_ideal_camera(measured, seen, transferred):
    block = synthetic_block(measured, transferred, seen.cameras[0])
    free = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")
    found = single_step(block, Model(free=free)).calibration
    true = in_heads.one_centre_plan().cameras["SYN"]
    (camera,) = found.cameras
    assert_allclose(camera.interior.f, true.f_mm, atol=2e-6)
    assert_allclose([camera.interior.xp, camera.interior.yp], 0.0, atol=2e-6)
    corner = np.array([[0.0, 0.0]])
    away = camera.interior.k1 * np.sum(xy_from_colrow(camera, corner) ** 2) ** 1.5
    assert abs(away) < 1e-5  # mm
    assert_allclose(camera.T_b_c.r, true.lever_m, atol=1e-4)
    assert_allclose(camera.T_b_c.opk, 0.0, atol=1e-8)
    assert found.sigma0_sq < 1e-8


def test_sigma_is_the_scatter_of_a_measurement_after_the_map(measured, seen):
    rng = np.random.default_rng(3)
    rows = rng.choice(len(measured.image_points), 4)
    n = 4000
    points = measured.image_points[np.repeat(rows, n)]
    noisy = replace(
        points,
        point_idx=np.arange(4 * n),
        colrow=points.colrow + points.sigma_px[:, None] * rng.standard_normal((4 * n, 2)),
    )
    block = replace(
        measured,
        points=tuple(map(str, range(4 * n))),
        image_points=noisy,
        control=measured.control[:0],
        check=measured.check[:0],
    )
    frame = replace(seen.cameras[0], width_px=20_000, height_px=20_000)
    found = transfer(block, in_heads.true_orientation(), frame)
    order = np.argsort(found.point_idx)
    colrow = found.colrow[order].reshape(4, n, 2)
    sigma = found.sigma_px[order].reshape(4, n, 2)
    # a standard deviation of 4000 is known to 1.1 %
    assert_allclose(colrow.std(axis=1), sigma.mean(axis=1), rtol=0.045)
    assert np.ptp(sigma / points.sigma_px[0]) > 0.05  # a tilted head stretches


# --- which head ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def everything(measured):
    """Return pixels of a small synthetic image, and a block of all heads that see them."""
    orientation, synthetic = taken.heads(K), taken.synthetic(K)
    rng = np.random.default_rng(1)
    size = [synthetic.width_px, synthetic.height_px]
    pixels = np.column_stack([rng.integers(0, n, 3000) for n in size])
    xy = xy_from_colrow(synthetic, pixels.astype(float))
    head, point, colrow = [], [], []
    for k, camera in enumerate(orientation.heads):
        at = head_from_synthetic(orientation, k, xy)
        own = np.flatnonzero(inside(camera, at))
        head.append(np.full(len(own), k))
        point.append(own)
        colrow.append(at[own])
    return pixels, replace(
        measured,
        cameras=orientation.heads,
        images=Images(
            names=HEADS,
            camera_idx=np.arange(4),
            exposure_idx=np.zeros(4, dtype=np.intp),
            strips=("",) * 4,
        ),
        points=tuple(map(str, range(len(pixels)))),
        image_points=ImagePoints(
            image_idx=np.concatenate(head),
            point_idx=np.concatenate(point),
            colrow=np.concatenate(colrow),
            sigma_px=np.full(sum(map(len, head)), 0.5),
        ),
        control=measured.control[:0],
        check=measured.check[:0],
    )


def test_the_head_is_the_one_that_is_rendered_there(everything):
    pixels, block = everything
    orientation, synthetic = taken.heads(K), taken.synthetic(K)
    numbers = [
        np.full((head.height_px, head.width_px, 1), 1 + k, np.uint8)
        for k, head in enumerate(orientation.heads)
    ]
    image = render(render_plan(orientation, synthetic, feather_px=0.0), numbers)[..., 0]
    found = transfer(block, orientation, synthetic)
    assert len(found) == len(pixels)
    assert_allclose(found.colrow, pixels[found.point_idx], atol=1e-8)
    there = image[pixels[found.point_idx, 1], pixels[found.point_idx, 0]]
    assert len(set(there)) == 4
    assert_array_equal(found.camera_idx, there.astype(int) - 1)


def test_a_point_that_this_head_did_not_measure_comes_from_the_next(everything):
    _, block = everything
    orientation, synthetic = taken.heads(K), taken.synthetic(K)
    found = transfer(block, orientation, synthetic)
    first = block.image_points.image_idx != 0  # images are the heads
    less = transfer(replace(block, image_points=block.image_points[first]), orientation, synthetic)
    assert 0 not in less.camera_idx
    seen_by_others = np.isin(found.point_idx, less.point_idx)
    assert np.any(found.camera_idx[seen_by_others] == 0)
    kept = found.camera_idx != 0
    where = {int(p): int(c) for p, c in zip(less.point_idx, less.camera_idx, strict=True)}
    assert all(
        where[int(p)] == c
        for p, c in zip(found.point_idx[kept], found.camera_idx[kept], strict=True)
    )


# --- the synthetic images --------------------------------------------------------------------


def test_synthetic_images_bear_the_names_of_their_exposures_in_the_order_of_the_table(
    measured, seen
):
    images = measured.images
    order = np.arange(len(images))[::-1]
    back = np.argsort(order)
    shuffled = replace(
        measured,
        images=Images(
            names=tuple(images.names[i] for i in order),
            camera_idx=images.camera_idx[order],
            exposure_idx=images.exposure_idx[order],
            strips=tuple(images.strips[i] for i in order),
        ),
        image_points=replace(
            measured.image_points, image_idx=back[measured.image_points.image_idx]
        ),
    )
    orientation, synthetic = in_heads.true_orientation(), seen.cameras[0]
    block = synthetic_block(shuffled, transfer(shuffled, orientation, synthetic), synthetic)
    exposures = [measured.trajectory.exposures[i] for i in images.exposure_idx[order]]
    assert block.images.names == tuple(dict.fromkeys(exposures))
    named = dict(zip(seen.images.names, seen.images.strips, strict=True))
    assert block.images.strips == tuple(named[f"{name}_SYN"] for name in block.images.names)
    assert np.all(np.diff(block.image_points.image_idx) >= 0)


def test_an_exposure_without_any_measurement_is_an_image(measured, seen):
    points = measured.image_points
    bare = measured.images.exposure_idx[points.image_idx] != 2
    few = replace(measured, image_points=points[bare])
    orientation, synthetic = in_heads.true_orientation(), seen.cameras[0]
    found = transfer(few, orientation, synthetic)
    assert 2 not in found.exposure_idx
    block = synthetic_block(few, found, synthetic)
    assert len(block.images) == len(measured.trajectory)


def test_a_camera_that_is_no_head_is_refused(seen):
    with pytest.raises(ValueError, match=r"names of CAM1, .*, got .SYN"):
        transfer(seen, in_heads.true_orientation(), seen.cameras[0])


# --- Errors of the heads in the calibrated synthetic camera, against cameras calibrated anew


FREE = ("f", "xp", "yp", "k1", "k2", "p1", "p2")
SIZES = np.concatenate(
    [
        np.tile([2e-4, 2e-4, 2e-4, 3e-6, 3e-6, 3e-6], 4),  # mm and radians
        np.tile([2e-4, 2e-4, 2e-4, 1e-9, 0.0, 0.0, 1e-9, 1e-9, 0.0, 0.0], 4),
    ]
)
"""Errors of heads that move points by some hundredths of a pixel; zero is held."""


@pytest.fixture(scope="module")
def head_errors_measured():
    return select_cameras(in_heads.one_centre(), HEADS)


@pytest.fixture(scope="module")
def synthetic():
    return select_cameras(in_heads.one_centre(), ["SYN"]).cameras[0]


def calibrated(measured, orientation, synthetic, free=FREE):
    """Return the transferred points, and all methods on them without a search for gross errors."""
    transferred = transfer(measured, orientation, synthetic)
    block = synthetic_block(measured, transferred, synthetic)
    single = single_step(block, Model(free=free), snooping=False)
    others = (
        method(block, Model(free=free), after=single)
        for method in (mounting.two_step, mounting.two_step_gnss)
    )
    return transferred, mounting.together([single, *others]).methods


def reported(found):
    return np.array([p.value for p in parameters(found.calibration)])


def due_to_heads(found, measured, transferred, orientation):
    """Return the covariance due to the heads, of the parameters as results report them."""
    J = to_reported(found.calibration)
    return J @ parameter_covariance(found, measured, transferred, orientation) @ J.T


@pytest.mark.parametrize("seed", [1, 2])
def test_heads_that_are_off_move_the_parameters_as_their_covariance_says(
    head_errors_measured, synthetic, seed
):
    """Of one direction in which all heads are off, the covariance is the square of the change."""
    off = SIZES * np.random.default_rng(seed).normal(size=len(SIZES))
    right = replace(in_heads.true_orientation(), cov_joint=np.outer(off, off))
    transferred, methods = calibrated(head_errors_measured, right, synthetic)
    wrong = right
    for i in np.flatnonzero(off):
        wrong = varied(wrong, int(i), float(off[i]))
    _, moved = calibrated(head_errors_measured, wrong, synthetic)
    for name, found in methods.items():
        cov = due_to_heads(found, head_errors_measured, transferred, right)
        J, own = to_reported(found.calibration), found.calibration.cov
        unit = np.sqrt(np.diag(J @ own @ J.T))
        change = (reported(moved[name]) - reported(found)) / unit
        cov = cov / unit / unit[:, None]
        # to 1 %, where it is no more than a thousandth of a standard deviation
        assert_allclose(np.sqrt(np.diag(cov)), np.abs(change), rtol=0.01, atol=1e-3)
        assert_allclose(cov, np.outer(change, change), rtol=0.02, atol=1e-3)


# --- the total of a small flight, whose heads are calibrated from their noisy measurements


@pytest.fixture(scope="module")
def small():
    """Return a flight measured in four heads, its heads, and their calibration."""
    flight = read_back(in_heads.small()).flight
    fits = calibrate_heads(flight.heads, flight.head_names, Model(free=flight.estimate_heads))
    return flight, relative_orientation(fits, flight.synthetic_camera)


@pytest.fixture(scope="module")
def before_and_after(small):
    """Return all methods without and with the heads' part, and a step of the heads along S_h."""
    flight, oriented = small
    draw = np.random.default_rng(3).normal(size=len(oriented.cov_joint))
    step = half(oriented.cov_joint) @ draw
    one = replace(oriented, cov_joint=np.outer(step, step))
    args = (flight.calibration, flight.synthetic_camera, flight.estimate_mounting)
    transferred, methods = calibrated(args[0], one, *args[1:])
    total = {
        name: with_heads(found, flight.calibration, transferred, one)
        for name, found in methods.items()
    }
    moved = []
    for sign in (1, -1):
        off = oriented
        for i in np.flatnonzero(step):
            off = varied(off, int(i), sign * float(step[i]))
        moved.append(calibrated(args[0], off, *args[1:])[1])
    return methods, total, moved


@pytest.mark.parametrize("method", METHODS)
def test_the_total_is_the_methods_own_part_and_what_other_heads_do(before_and_after, method):
    methods, total, (ahead, behind) = before_and_after
    change = (reported(ahead[method]) - reported(behind[method])) / 2
    own, both = (reported_covariance(m[method].calibration) for m in (methods, total))
    unit = np.sqrt(np.diag(own))
    expected = own + np.outer(change, change)
    # weights of the transferred points, and of images in the mean, change with the heads, too
    assert_allclose(both / unit / unit[:, None], expected / unit / unit[:, None], atol=0.02)
    assert np.abs(change / unit).max() > 1  # or there would be nothing to see
    for p, part, alone in zip(
        parameters(total[method].calibration),
        change,
        parameters(methods[method].calibration),
        strict=True,
    ):
        assert p.sigma_before == pytest.approx(abs(part), rel=0.05, abs=0.02 * alone.sigma)
        assert p.sigma == pytest.approx(np.hypot(alone.sigma, p.sigma_before), rel=1e-9)
        assert alone.sigma_before == 0


@pytest.mark.parametrize("method", METHODS)
def test_tests_within_the_block_keep_its_own_covariance(before_and_after, method):
    methods, total, _ = before_and_after
    assert_array_equal(total[method].calibration.cov, methods[method].calibration.cov)
    assert total[method].bundle is methods[method].bundle
