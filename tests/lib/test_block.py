"""Plain data: selecting, counting, and covariances along the right axes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4files import flight
from acx4lib import block
from acx4lib.block import select_images, synthetic_images
from acx4lib.calibration.mounting import single_step
from acx4lib.design import forward_overlaps, ground_sample_m
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.model import Model
from support import blocks
from support.flights import in_heads, written

SECOND = replace(
    blocks.CAMERA,
    name="SIDE",
    T_b_c=Pose(R=rotation_from_opk(np.radians([18.0, 0.0, 90.0])), r=np.array([0.1, 0.3, 0.0])),
)


@pytest.fixture(scope="module")
def rig():
    return blocks.standard(cameras=(blocks.CAMERA, SECOND))


def described(block):
    """Every measurement as camera, exposure, point and pixels, in a fixed order."""
    points, images = block.image_points, block.images
    return sorted(
        (
            block.cameras[images.camera_idx[i]].name,
            block.trajectory.exposures[images.exposure_idx[i]],
            block.points[p],
            *colrow,
        )
        for i, p, colrow in zip(points.image_idx, points.point_idx, points.colrow, strict=True)
    )


def test_the_part_of_one_camera_holds_its_measurements_and_no_others(rig):
    part = block.select_cameras(rig, ["SIDE"])
    assert [camera.name for camera in part.cameras] == ["SIDE"]
    assert described(part) == [row for row in described(rig) if row[0] == "SIDE"]
    assert all(name.endswith("SIDE") for name in part.images.names)
    assert part.points == rig.points
    assert len(part.trajectory) == len(rig.trajectory)


def test_the_part_of_some_images_holds_their_measurements_and_no_others(rig):
    keep = rig.images.exposure_idx % 3 == 1
    part = block.select_images(rig, keep)
    exposures = {rig.trajectory.exposures[e] for e in range(1, len(rig.trajectory), 3)}
    assert described(part) == [row for row in described(rig) if row[1] in exposures]


def test_a_camera_that_is_not_there_is_named(rig):
    with pytest.raises(ValueError, match="no camera 'TAIL', only CAM, SIDE"):
        block.select_cameras(rig, ["TAIL"])


def test_a_selection_keeps_rows_together(rig):
    keep = np.array([5, 2])
    points, control = rig.image_points[keep], rig.control[keep]
    assert points.point_idx.tolist() == rig.image_points.point_idx[keep].tolist()
    assert points.image_idx.tolist() == rig.image_points.image_idx[keep].tolist()
    assert_allclose(points.colrow, rig.image_points.colrow[keep], atol=0)
    assert len(points) == len(control) == 2
    assert_allclose(control.x_m, rig.control.x_m[[5, 2]], atol=0)
    assert_allclose(control.R_g_m, rig.control.R_g_m[[5, 2]], atol=0)


def test_rays_are_counted_per_point(rig):
    assert rig.rays.sum() == len(rig.image_points)
    assert rig.rays[7] == sum(row[2] == rig.points[7] for row in described(rig))


def test_every_image_hangs_on_its_exposures_pose(rig):
    exposure = rig.images.exposure_idx
    assert_allclose(rig.T_m_b_images.r, rig.trajectory.T_m_b.r[exposure], atol=0)


def test_the_trajectorys_covariance_is_that_of_its_sigmas_along_their_axes(rig):
    sigma = np.tile([0.02, 0.05, 0.11], (len(rig.trajectory), 1))
    R = rotation_from_opk(np.array([0.0, 0.0, 0.5]))
    trajectory = replace(rig.trajectory, sigma_position=sigma, R_g_m=np.tile(R, (len(sigma), 1, 1)))
    cov = trajectory.cov[0]
    for axis, expected in zip(R, sigma[0], strict=True):  # rows of R: grid axes in m
        assert np.sqrt(axis @ cov[:3, :3] @ axis) == pytest.approx(expected)
    assert_allclose(np.diag(cov)[3:], np.radians([0.005, 0.005, 0.008]) ** 2)
    assert_allclose(cov[:3, 3:], 0.0, atol=0)


def test_what_is_not_known_of_a_trajectory_has_no_covariance(rig):
    sigma = rig.trajectory.sigma_position.copy()
    sigma[1] = np.inf
    cov = replace(rig.trajectory, sigma_position=sigma).cov
    assert_allclose(cov[1, :3, :3], 0.0, atol=0)
    assert np.all(np.diagonal(cov[1])[3:] > 0)
    assert np.all(np.diagonal(cov[0]) > 0)


# --- What a flight that is measured in heads says of its synthetic images before they are made


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return flight.read(in_heads.write(tmp_path_factory.mktemp("in_heads")))


def test_a_block_in_heads_is_flown_as_one_of_synthetic_images(read, tmp_path):
    plain = flight.read(written.write_flight(tmp_path, blocks=("heads", "calibration"))).calibration
    mounted = read.mounted("calibration")
    assert mounted.images.names == mounted.trajectory.exposures == plain.trajectory.exposures
    assert mounted.images.strips == plain.images.strips
    assert_allclose(ground_sample_m(mounted), ground_sample_m(plain), rtol=1e-12)
    assert_allclose(forward_overlaps(mounted)[1], forward_overlaps(plain)[1], atol=1e-12)
    assert len(mounted.image_points) == 0
    assert mounted.points == read.calibration.points


def test_a_block_that_is_not_carried_is_what_was_measured(read):
    assert read.mounted("heads") is read.heads
    plain = replace(read, synthetic=replace(read.synthetic, measured_in="synthetic"))
    assert plain.mounted("calibration") is plain.calibration


def test_exposures_without_any_image_make_none(read):
    block = read.calibration
    without = select_images(block, block.images.exposure_idx != 2)
    made = synthetic_images(without, read.synthetic_camera)
    assert len(made.images) == len(block.trajectory) - 1
    assert 2 not in made.images.exposure_idx
    assert_array_equal(made.trajectory.T_m_b.r, block.trajectory.T_m_b.r)


def test_the_summary_shows_both_the_heads_and_the_synthetic_images(read):
    lines = [line.split() for line in flight.summary(read).splitlines()]
    assert lines.count(["transferred", "to", "6", "images", "of", "CAM"]) == 2
    assert sum(line[:2] == ["GSD", "CAM"] for line in lines) == 2
    assert sum(line[:2] == ["GSD", "LEFT"] for line in lines) == 3
    assert np.isfinite(read.mounted("validation").T_m_b_images.r).all()


# --- what a caller gets wrong is told by the name of the argument ----------------------------

BLOCK = blocks.standard()
POINTS, TRAJECTORY = BLOCK.image_points, BLOCK.trajectory
INFINITE = replace(BLOCK.control, x_m=np.full_like(BLOCK.control.x_m, np.inf))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: replace(POINTS, sigma_px=-POINTS.sigma_px), "sigma_px: expected positive numbers"),
        (lambda: replace(POINTS, colrow=POINTS.colrow.T), r"colrow: expected shape \(\d+, 2\)"),
        (
            lambda: single_step(replace(BLOCK, control=INFINITE), Model(free=("f",))),
            "control.x_m: expected finite numbers",
        ),
        (lambda: replace(TRAJECTORY, time_s=np.arange(11.0)), r"time_s: expected shape \(12,\)"),
        (
            lambda: replace(BLOCK, image_points=replace(POINTS, image_idx=POINTS.image_idx + 1)),
            "image_points.image_idx: expected whole numbers from 0 to 11, got 12 in row",
        ),
        (lambda: replace(blocks.CAMERA, pixel_mm=6.0), r"got 6.0, .* \(micrometres\?\)"),
        (lambda: rotation_from_opk(np.zeros((4, 2))), r"opk: expected shape \(\.\.\., 3\), got"),
    ],
)
def test_a_wrong_argument_is_told_with_what_was_expected(call, says):
    with pytest.raises(ValueError, match=says):
        call()
