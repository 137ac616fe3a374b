"""Measurements and the parts of blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib.bundle import rejections
from acx4lib.calibration import mounting
from acx4lib.flight import block
from acx4lib.geometry import camera
from acx4lib.geometry.frames import Pose
from acx4lib.georeferencing import direct
from acx4lib.tie_points import refinement
from acx4lib.tie_points import ties as tie_points
from support.pictures import printed_camera
from support.wrong_calls.material import (
    BLOCK,
    CAMERA,
    CONTROL,
    FREE,
    IMAGES,
    POINTS,
    POSES,
    RIG,
    TRAJECTORY,
    Wrong,
    georeferenced,
    spoilt,
    ties,
)


def image_points(**wrong):
    return lambda: replace(POINTS, **wrong)


def with_points(**wrong):
    return lambda: replace(BLOCK, image_points=replace(POINTS, **wrong))


def images(**wrong):
    return lambda: replace(BLOCK, images=replace(IMAGES, **wrong))


def control(**wrong):
    return lambda: replace(BLOCK, control=replace(CONTROL, **wrong))


def trajectory(**wrong):
    return lambda: replace(BLOCK, trajectory=replace(TRAJECTORY, **wrong))


def adjusting(make):
    return lambda: mounting.single_step(make(), free=FREE)


def rays(**wrong):
    right = {
        "image_idx": np.array([0, 1, 2, 3]),
        "group": np.array([0, 0, 1, 1]),
        "colrow": np.zeros((4, 2)),
        "sigma_px": np.ones(4),
    }
    return direct.Rays(**{**right, **wrong})


def measured() -> list[Wrong]:
    n, m = len(IMAGES), len(BLOCK.points)
    return [
        Wrong(
            image_points(sigma_px=0.5),
            rf"sigma_px: expected an array of shape \({len(POINTS)},\), got 0.5",
        ),
        Wrong(
            image_points(sigma_px=np.array([0.5])),
            rf"sigma_px: expected shape \({len(POINTS)},\), got \(1,\)",
        ),
        Wrong(
            image_points(sigma_px=spoilt(POINTS.sigma_px, 0.0)),
            "sigma_px: expected positive numbers, got 0.0 in row 3",
        ),
        Wrong(
            image_points(sigma_px=-POINTS.sigma_px),
            "sigma_px: expected positive numbers, got -0.5 in row 0",
        ),
        Wrong(
            image_points(sigma_px=spoilt(POINTS.sigma_px, np.nan)),
            "sigma_px: expected positive numbers, got nan in row 3",
        ),
        Wrong(image_points(sigma_px=np.ones((len(POINTS), 2))), r"sigma_px: expected shape"),
        Wrong(
            image_points(colrow=spoilt(POINTS.colrow, np.nan)),
            "colrow: expected finite numbers, got nan in row 3",
        ),
        Wrong(
            image_points(colrow=spoilt(POINTS.colrow, np.inf)),
            "colrow: expected finite numbers, got inf in row 3",
        ),
        Wrong(
            image_points(colrow=POINTS.colrow.T),
            r"colrow: expected shape \(\d+, 2\), got \(2, \d+\)",
        ),
        Wrong(
            image_points(colrow=np.zeros((len(POINTS), 3))),
            r"colrow: expected shape \(\d+, 2\), got \(\d+, 3\)",
        ),
        Wrong(
            image_points(colrow=POINTS.colrow.tolist()),
            r"colrow: expected an array of shape \(\d+, 2\), got a list",
        ),
        Wrong(
            image_points(colrow=POINTS.colrow.astype(str)),
            "colrow: expected numbers, got an array of <U",
        ),
        Wrong(
            image_points(image_idx=POINTS.image_idx.astype(float)),
            "image_idx: expected whole numbers, got an array of float64",
        ),
        Wrong(
            image_points(point_idx=POINTS.point_idx > 3),
            "point_idx: expected whole numbers, got an array of bool",
        ),
        Wrong(
            image_points(point_idx=np.array(BLOCK.points)[POINTS.point_idx]),
            "point_idx: expected whole numbers, got an array of <U",
        ),
        Wrong(image_points(image_idx=POINTS.image_idx[:-1]), "point_idx: expected shape"),
        Wrong(
            with_points(image_idx=POINTS.image_idx + 1),
            rf"image_points.image_idx: expected whole numbers from 0 to {n - 1}, got {n} in row",
        ),
        Wrong(
            with_points(point_idx=POINTS.point_idx + 1),
            rf"image_points.point_idx: expected whole numbers from 0 to {m - 1}, got {m} in row",
        ),
        Wrong(
            with_points(point_idx=spoilt(POINTS.point_idx, -1)),
            "image_points.point_idx: expected whole numbers from 0 to .*, got -1 in row 3",
        ),
        Wrong(
            adjusting(control(x_m=spoilt(CONTROL.x_m, np.nan))),
            "control.x_m: expected finite numbers, got nan in row 3",
        ),
        Wrong(control(x_m=CONTROL.x_m.T), r"x_m: expected shape \(9, 3\), got \(3, 9\)"),
        Wrong(control(sigma_m=0.01), r"sigma_m: expected an array of shape \(9, 3\), got 0.01"),
        Wrong(control(sigma_m=np.full(9, 0.01)), r"sigma_m: expected shape \(9, 3\), got \(9,\)"),
        Wrong(
            control(sigma_m=-CONTROL.sigma_m),
            "sigma_m: expected zero or positive numbers, got -0.01 in row 0",
        ),
        Wrong(
            control(point_idx=CONTROL.point_idx + m),
            "control.point_idx: expected whole numbers from 0 to",
        ),
        Wrong(
            control(point_idx=spoilt(CONTROL.point_idx, 2)),
            "control.point_idx: expected different points, got 2 twice",
        ),
        Wrong(
            lambda: replace(BLOCK, check=BLOCK.control),
            "control and check: expected different points, got point 'P0' in both",
        ),
        Wrong(control(R_g_m=np.eye(3)), r"R_g_m: expected shape \(9, 3, 3\), got \(3, 3\)"),
        Wrong(lambda: rays(group=np.array([0, 1, 0, 1])), "group: expected ascending numbers"),
        Wrong(
            lambda: rays(sigma_px=np.zeros(4)),
            "sigma_px: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            lambda: direct.intersect_rays(
                BLOCK, georeferenced(), rays(image_idx=np.array([0, 1, 2, 99]))
            ),
            r"selected.image_idx: expected whole numbers from 0 to 11, got 99 in row 3",
        ),
        Wrong(
            lambda: direct.intersect_rays(BLOCK, georeferenced(), rays(), weights=np.ones(4)),
            r"weights: expected shape \(4, 2, 2\), got \(4,\)",
        ),
        Wrong(
            lambda: direct.intersect_rays(BLOCK, georeferenced(), rays(), refraction="air"),
            "refraction",
        ),
        Wrong(lambda: replace(ties(), head_b=ties().head_a), "head_b"),
        Wrong(
            lambda: replace(ties(), sigma_px=np.zeros(len(ties()))),
            "sigma_px: expected positive numbers",
        ),
        Wrong(lambda: replace(ties(), colrow_a=ties().colrow_a.T), "colrow_a: expected shape"),
        Wrong(
            lambda: tie_points.overlaps(ties(), printed_camera.heads(("CAM1", "CAM2"))),
            "ties.head_a: expected whole numbers from 0 to 1, got 2 in row 63",
        ),
        Wrong(
            lambda: refinement.refine_by_rotations(printed_camera.heads(("CAM1", "CAM2")), ties()),
            "ties.head_a: expected whole numbers from 0 to 1, got 2 in row 63",
        ),
        Wrong(
            lambda: rejections.without(
                BLOCK,
                [rejections.Rejection(kind="image_point", row=10**6, component=-1, statistic=9.0)],
            ),
            r"rejected: image_point rows: expected whole numbers from 0 to \d+, got 1000000",
        ),
        Wrong(
            lambda: rejections.Rejection(kind="image", row=0, component=-1, statistic=9.0),
            "kind: expected one of image_point, control_point, gnss, attitude, distance, "
            "got 'image'",
        ),
    ]


def blocks_and_parts() -> list[Wrong]:
    n = len(IMAGES)
    return [
        Wrong(images(names=IMAGES.names[1:]), "strips: expected 11 names, got 12"),
        Wrong(images(names="I" * n), "names: expected a sequence of names, got the text 'IIII"),
        Wrong(images(strips=IMAGES.strips[1:]), "strips: expected 12 names, got 11"),
        Wrong(images(strips="A"), "strips: expected a sequence of names, got the text 'A'"),
        Wrong(
            images(camera_idx=IMAGES.camera_idx + 1),
            "images.camera_idx: expected whole numbers from 0 to 0, got 1 in row 0",
        ),
        Wrong(
            images(exposure_idx=IMAGES.exposure_idx + 1),
            "images.exposure_idx: expected whole numbers from 0 to 11, got 12 in row 11",
        ),
        Wrong(
            images(exposure_idx=IMAGES.exposure_idx / 2),
            "exposure_idx: expected whole numbers, got an array of float64",
        ),
        Wrong(
            trajectory(exposures=TRAJECTORY.exposures[1:]),
            r"T_m_b.R: expected shape \(11, 3, 3\), got \(12, 3, 3\)",
        ),
        Wrong(
            trajectory(exposures="012345678901"),
            "exposures: expected a sequence of names, got the text",
        ),
        Wrong(
            trajectory(sigma_position=np.full(12, 0.02)),
            r"sigma_position: expected shape \(12, 3\), got \(12,\)",
        ),
        Wrong(
            trajectory(sigma_position=np.full((12, 3), -0.02)),
            "sigma_position: expected zero or positive numbers, got -0.02 in row 0",
        ),
        Wrong(
            lambda: mounting.single_step(trajectory(sigma_position=np.zeros((12, 3)))(), free=FREE),
            "sigma_position: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            trajectory(sigma_attitude=np.full((12, 3), np.nan)),
            "sigma_attitude: expected zero or positive numbers, got nan in row 0",
        ),
        Wrong(trajectory(time_s=np.arange(11.0)), r"time_s: expected shape \(12,\), got \(11,\)"),
        Wrong(
            adjusting(trajectory(T_m_b=Pose(R=POSES.R, r=spoilt(POSES.r, np.nan)))),
            "T_m_b.r: expected finite numbers, got nan in row 3",
        ),
        Wrong(
            trajectory(T_m_b=Pose(R=2 * POSES.R, r=POSES.r)),
            "T_m_b.R: expected rotation matrices, got one that does not turn, or mirrors, in row 0",
        ),
        Wrong(
            trajectory(R_g_m=-TRAJECTORY.R_g_m),
            "R_g_m: expected rotation matrices, got one that does not turn, or mirrors, in row 0",
        ),
        Wrong(
            lambda: replace(BLOCK, trajectory=POSES),
            "trajectory: expected a Trajectory, got a Pose",
        ),
        Wrong(
            lambda: replace(BLOCK, cameras=()), "cameras: expected one Camera at least, got none"
        ),
        Wrong(
            lambda: replace(BLOCK, cameras=CAMERA),
            "cameras: expected a sequence of Camera, got a Camera",
        ),
        Wrong(
            lambda: replace(BLOCK, cameras=("CAM",)),
            "cameras: expected a sequence of Camera, got one with 'CAM'",
        ),
        Wrong(
            lambda: replace(RIG, cameras=(CAMERA, CAMERA)),
            "cameras: expected different names, got 'CAM' twice",
        ),
        Wrong(
            lambda: replace(BLOCK, points="P0"),
            "points: expected a sequence of names, got the text 'P0'",
        ),
        Wrong(
            lambda: replace(BLOCK, points=("P0", *BLOCK.points[:-1])),
            "points: expected different names, got 'P0' twice",
        ),
        Wrong(
            images(names=(IMAGES.names[1], *IMAGES.names[1:])),
            "images.names: expected different names, got '1_CAM' twice",
        ),
        Wrong(
            lambda: block.select_cameras(BLOCK, ["TAIL"]),
            "block 'calibration' has no camera 'TAIL', only CAM",
        ),
        Wrong(
            lambda: block.select_cameras(BLOCK, "CAM"),
            "names: expected a sequence of names, got the text 'CAM'",
        ),
        Wrong(
            lambda: block.select_cameras(RIG, ["CAM", "CAM"]),
            "names: expected different names, got 'CAM' twice",
        ),
        Wrong(lambda: block.select_cameras(BLOCK, [0]), "has no camera 0, only CAM"),
        Wrong(
            lambda: block.select_images(BLOCK, np.array([0, 5])),
            "keep: expected a mask of 12 True or False, got an array of int64",
        ),
        Wrong(
            lambda: block.select_images(BLOCK, [0, 5]),
            "keep: expected a mask of 12 True or False, got a list",
        ),
        Wrong(
            lambda: block.select_images(BLOCK, np.ones(5, bool)),
            r"keep: expected a mask of 12 True or False, got 5",
        ),
        Wrong(
            lambda: block.select_images(BLOCK, np.ones(50, bool)),
            r"keep: expected a mask of 12 True or False, got 50",
        ),
        Wrong(
            lambda: block.select_images(None, np.ones(5, bool)), "block: expected a Block, got None"
        ),
        Wrong(
            lambda: camera.mountings(CAMERA), "cameras: expected a sequence of Camera, got a Camera"
        ),
        Wrong(lambda: camera.mountings([]), "cameras: expected one Camera at least, got none"),
    ]
