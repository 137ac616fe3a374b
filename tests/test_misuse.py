"""Wrong calls that a stranger makes: each is answered at the door, with what was expected.

The rules: a programmer's misuse is a `ValueError` that names the argument, what was expected and
what was given; a folder that is not there is a `FlightError`, as a user's files are; a block that
determines too little is an `AdjustmentError`. What meets nothing is NaN, and no error.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import blocks
import printed_camera
from acx4lib import (
    accuracy,
    adjustment,
    block,
    bundle,
    calibration,
    camera,
    collinearity,
    covariance,
    coverage,
    data_snooping,
    flight,
    frames,
    geodesy,
    georeferencing,
    gross_errors,
    harris,
    head_differences,
    head_response,
    head_samples,
    image_map,
    image_ties,
    intersection,
    least_squares_matching,
    mounting,
    observations,
    paper,
    parallax,
    refinement,
    relative_orientation,
    reliability,
    render_exposure,
    rendering,
    results,
    rig,
    simulate,
    standards,
    synthetic_image,
    synthetic_quality,
    synthetic_tiff,
    tie_matching,
    tie_points,
    unknowns,
    validation,
    variance_components,
    w_test,
    weights,
)
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.experiments import mounting as mounting_experiments
from acx4lib.experiments import synthetic as synthetic_experiments
from acx4lib.frames import Pose, rotation_from_opk

FREE = ("f", "xp", "yp", "k1")
BLOCK = blocks.standard()
RIG = blocks.standard(cameras=(blocks.CAMERA, replace(blocks.CAMERA, name="SIDE")))
CAMERA, FRAME = blocks.CAMERA, blocks.FRAME
POINTS, IMAGES, CONTROL, TRAJECTORY = (
    BLOCK.image_points,
    BLOCK.images,
    BLOCK.control,
    BLOCK.trajectory,
)
HEADS, SYNTHETIC = printed_camera.heads(), printed_camera.synthetic()
POSES = TRAJECTORY.T_m_b
PICTURE = np.zeros((60, 80, 3), np.uint8)
GREY = np.zeros((60, 80), np.float32)
FOUND = accuracy.from_differences(np.random.default_rng(1).normal(size=(30, 3)))
NOWHERE = "/nowhere/at/all"


@cache
def calibrated() -> mounting.Mountings:
    return mounting.calibrate(BLOCK, free=FREE)


def fit() -> bundle.Bundle:
    return calibrated()["single_step"].bundle


def said() -> calibration.Calibration:
    return calibrated()["single_step"].calibration


@cache
def georeferenced() -> georeferencing.Georeferenced:
    return georeferencing.georeference(BLOCK, said())


@cache
def ties() -> tie_points.TiePoints:
    rng = np.random.default_rng(1)
    return synthetic_experiments.simulated_ties(HEADS, SYNTHETIC, rng=rng, per_overlap=20)


@cache
def flown() -> simulate.SimulatedFlight:
    return simulate.single_head(options=simulate.Options(tie_points={"calibration": 10}))


@cache
def no_results() -> results.Results:
    with tempfile.TemporaryDirectory() as folder:
        return results.read(folder)


def spoilt(values: np.ndarray, value: float, row: int = 3) -> np.ndarray:
    """Return values with one of them replaced."""
    out = values.astype(np.result_type(values, value)).copy()
    out[row] = value
    return out


@dataclass(frozen=True)
class Wrong:
    """A wrong call and the answer to it."""

    call: Callable[[], object]
    says: str
    error: type[Exception] = ValueError


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


def rays(**wrong):
    right = {
        "image_idx": np.array([0, 1, 2, 3]),
        "group": np.array([0, 0, 1, 1]),
        "colrow": np.zeros((4, 2)),
        "sigma_px": np.ones(4),
    }
    return georeferencing.Rays(**{**right, **wrong})


def head(**wrong):
    right = {
        "name": "CAM",
        "width_px": 4000,
        "height_px": 3000,
        "pixel_mm": 0.006,
        "interior": camera.Interior(f=50.0),
    }
    return lambda: camera.Camera(**{**right, **wrong})


def one_of_each_kind() -> list[Wrong]:
    return [
        *measured(),
        *blocks_and_parts(),
        *cameras_and_poses(),
        *adjusted(),
        *ground(),
        *statistics(),
        *pixels(),
        *files(),
        *invented(),
    ]


# --- observations ----------------------------------------------------------------------------


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
            control(x_m=spoilt(CONTROL.x_m, np.nan)),
            "x_m: expected finite numbers, got nan in row 3",
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
            "control.point_idx: expected every point once, got point 'P2' twice",
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
            lambda: georeferencing.intersect_rays(
                BLOCK, georeferenced(), rays(image_idx=np.array([0, 1, 2, 99]))
            ),
            r"selected.image_idx: expected whole numbers from 0 to 11, got 99 in row 3",
        ),
        Wrong(
            lambda: georeferencing.intersect_rays(
                BLOCK, georeferenced(), rays(), weights=np.ones(4)
            ),
            r"weights: expected shape \(4, 2, 2\), got \(4,\)",
        ),
        Wrong(
            lambda: georeferencing.intersect_rays(BLOCK, georeferenced(), rays(), refraction="air"),
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
            lambda: gross_errors.without(
                BLOCK,
                [
                    gross_errors.Rejection(
                        kind="image_point", row=10**6, component=-1, statistic=9.0
                    )
                ],
            ),
            r"rejected: image_point rows: expected whole numbers from 0 to \d+, got 1000000",
        ),
        Wrong(
            lambda: gross_errors.Rejection(kind="image", row=0, component=-1, statistic=9.0),
            "kind: expected one of image_point, control_point, gnss, attitude, got 'image'",
        ),
    ]


# --- blocks ----------------------------------------------------------------------------------


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
            trajectory(T_m_b=Pose(R=POSES.R, r=spoilt(POSES.r, np.nan))),
            "T_m_b.r: expected finite numbers, got nan in row 3",
        ),
        Wrong(
            trajectory(T_m_b=Pose(R=2 * POSES.R, r=POSES.r)),
            "T_m_b.R: expected rotation matrices, got one that is none in row 0",
        ),
        Wrong(
            trajectory(R_g_m=-TRAJECTORY.R_g_m),
            "R_g_m: expected rotation matrices, got one that is none in row 0",
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
            lambda: block.select_camera(BLOCK, "TAIL"),
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
            lambda: block.mountings(CAMERA), "cameras: expected a sequence of Camera, got a Camera"
        ),
        Wrong(lambda: block.mountings([]), "cameras: expected one Camera at least, got none"),
    ]


# --- cameras, poses, rotations ---------------------------------------------------------------


def cameras_and_poses() -> list[Wrong]:
    mirror = np.diag([1.0, 1.0, -1.0])
    colrow = np.zeros((5, 2))
    five = Pose(R=np.tile(np.eye(3), (5, 1, 1)), r=np.zeros((5, 3)))
    return [
        Wrong(lambda: camera.Interior(f=0.0), "focal length must be positive, got f=0.0 mm"),
        Wrong(lambda: camera.Interior(f=np.inf), "f: expected a finite number, got inf"),
        Wrong(lambda: camera.Interior(f="50"), "f: expected a finite number, got '50'"),
        Wrong(lambda: camera.Interior(f=50.0, k1=np.nan), "k1: expected a finite number, got nan"),
        Wrong(
            lambda: camera.Interior.from_array(np.ones(5)),
            r"values: expected shape \(9,\), got \(5,\)",
        ),
        Wrong(head(width_px=0), "width_px: expected a whole number of 1 or more, got 0"),
        Wrong(head(height_px=-3000), "height_px: expected a whole number of 1 or more, got -3000"),
        Wrong(head(width_px=4000.5), "width_px: expected a whole number of 1 or more, got 4000.5"),
        Wrong(head(pixel_mm=0.0), "pixel_mm: expected a positive number, got 0.0"),
        Wrong(
            head(pixel_mm=6.0),
            r"pixel_mm: expected mm, got 6.0, which makes a sensor of 24.0 m \(micrometres\?\)",
        ),
        Wrong(head(interior=50.0), "interior: expected an Interior, got 50.0"),
        Wrong(
            head(T_b_c=Pose(R=np.ones((3, 3)), r=np.zeros(3))),
            "T_b_c.R: expected a rotation matrix",
        ),
        Wrong(head(T_b_c=Pose(R=mirror, r=np.zeros(3))), "T_b_c.R: expected a rotation matrix"),
        Wrong(
            head(T_b_c=Pose(R=np.eye(3), r=np.full(3, np.nan))), "T_b_c.r: expected finite numbers"
        ),
        Wrong(head(T_b_c=five), r"T_b_c.R: expected shape \(3, 3\), got \(5, 3, 3\)"),
        Wrong(head(name=7), "name: expected text, got 7"),
        Wrong(
            lambda: Pose(R=np.zeros(3), r=np.zeros(3)),
            r"R: expected shape \(..., 3, 3\), got \(3,\)",
        ),
        Wrong(
            lambda: Pose(R=np.eye(3), r=np.zeros(2)), r"r: expected shape \(..., 3\), got \(2,\)"
        ),
        Wrong(
            lambda: Pose(R=np.eye(3).tolist(), r=[0, 0, 0]),
            r"R: expected an array of shape \(..., 3, 3\), got a list",
        ),
        Wrong(
            lambda: Pose(R=five.R, r=np.zeros((4, 3))),
            r"R and r: expected as many of either, got \(5,\) and \(4,\)",
        ),
        Wrong(
            lambda: rotation_from_opk(np.array([0.5, -0.8, 90.0])),
            "opk: expected radians, got 90.0",
        ),
        Wrong(
            lambda: frames.rotation_from_rph(np.array([0.5, -0.8, 270.0])),
            "rph: expected radians, got 270.0",
        ),
        Wrong(
            lambda: rotation_from_opk(np.zeros((4, 2))),
            r"opk: expected shape \(..., 3\), got \(4, 2\)",
        ),
        Wrong(
            lambda: frames.opk_jacobian(np.zeros((3, 4))),
            r"opk: expected shape \(..., 3\), got \(3, 4\)",
        ),
        Wrong(lambda: frames.opk_from_rotation(np.ones((3, 3))), "R: expected a rotation matrix"),
        Wrong(
            lambda: frames.opk_from_rotation(np.ones(3)),
            r"R: expected shape \(..., 3, 3\), got \(3,\)",
        ),
        Wrong(lambda: frames.log(np.zeros(3)), r"R: expected shape \(..., 3, 3\), got \(3,\)"),
        Wrong(lambda: frames.mean_rotation(2 * np.eye(3)[None]), "R: expected rotation matrices"),
        Wrong(
            lambda: frames.exp(np.zeros((3, 4))), r"delta: expected shape \(..., 3\), got \(3, 4\)"
        ),
        Wrong(lambda: frames.turn(3, 0.1), "axis: expected one of 0, 1, 2, got 3"),
        Wrong(lambda: frames.turn(-1, 0.1), "axis: expected one of 0, 1, 2, got -1"),
        Wrong(
            lambda: frames.mean_rotation(np.zeros((0, 3, 3))),
            "R: expected one rotation matrix at least, got none",
        ),
        Wrong(
            lambda: frames.mean_rotation(np.eye(3)), r"R: expected shape \(n, 3, 3\), got \(3, 3\)"
        ),
        Wrong(lambda: frames.skew(np.zeros(2)), r"a: expected shape \(..., 3\), got \(2,\)"),
        Wrong(
            lambda: camera.xy_from_colrow(CAMERA, np.zeros((5, 3))),
            r"colrow: expected shape \(..., 2\), got \(5, 3\)",
        ),
        Wrong(lambda: camera.xy_from_colrow("CAM", colrow), "camera: expected a Camera, got 'CAM'"),
        Wrong(
            lambda: camera.colrow_from_xy(CAMERA, np.zeros((5, 3))),
            r"xy: expected shape \(..., 2\), got \(5, 3\)",
        ),
        Wrong(
            lambda: camera.distortion(CAMERA, colrow),
            "interior: expected an Interior, got a Camera",
        ),
        Wrong(
            lambda: camera.distort(CAMERA.interior, np.zeros(2)),
            r"ideal: expected shape \(n, 2\), got \(2,\)",
        ),
        Wrong(
            lambda: camera.distort(CAMERA.interior, colrow, steps=0),
            "steps: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: collinearity.project(CAMERA, five, np.zeros(3)),
            r"x_m: expected shape \(n, 3\), got \(3,\)",
        ),
        Wrong(
            lambda: collinearity.project(CAMERA, five, np.zeros((3, 5))),
            r"x_m: expected shape \(n, 3\), got \(3, 5\)",
        ),
        Wrong(
            lambda: collinearity.project(CAMERA, five, np.zeros((4, 3))),
            "T_m_c: expected 4 poses, got 5",
        ),
        Wrong(
            lambda: collinearity.rays(CAMERA, five, np.zeros((5, 3))),
            r"colrow: expected shape \(n, 2\), got \(5, 3\)",
        ),
        Wrong(
            lambda: collinearity.as_seen(np.zeros((1, 3)), np.zeros((1, 3)), refraction="yes"),
            "refraction: expected one of none, standard, got 'yes'",
        ),
        Wrong(
            lambda: intersection.intersect(
                np.zeros((2, 3)), np.full((2, 3), 2.0), np.zeros(2, int), 1
            ),
            "directions: expected unit vectors, got one of length 3.46 in row 0",
        ),
        Wrong(
            lambda: intersection.intersect(
                np.zeros((2, 3)), np.tile([0.0, 0.0, 1.0], (2, 1)), np.array([0, 7]), 1
            ),
            "point_idx: expected whole numbers from 0 to 0, got 7 in row 1",
        ),
        Wrong(
            lambda: intersection.intersect(
                np.zeros(3), np.tile([0.0, 0.0, 1.0], (2, 1)), np.zeros(2, int), 1
            ),
            r"origins: expected shape \(2, 3\), got \(3,\)",
        ),
        Wrong(
            lambda: intersection.resect(CAMERA, np.zeros((4, 2)), np.zeros((5, 3))),
            r"x_m: expected shape \(4, 3\), got \(5, 3\)",
        ),
        Wrong(
            lambda: intersection.resect(CAMERA, np.full((4, 2), np.nan), np.zeros((4, 3))),
            "colrow: expected finite numbers, got nan in row 0",
        ),
        Wrong(
            lambda: intersection.resect(CAMERA, np.zeros((2, 2)), np.zeros((2, 3))),
            "a resection needs three points or more, got 2",
        ),
    ]


# --- adjustments -----------------------------------------------------------------------------


def adjusted() -> list[Wrong]:
    lonely = replace(BLOCK, image_points=POINTS[:0])
    metres = replace(BLOCK, cameras=(CAMERA.with_interior(camera.Interior(f=0.05)),))
    with_positions = observations.PoseObservations(
        T_m_b=POSES,
        R_g_m=TRAJECTORY.R_g_m,
        sigma_position=TRAJECTORY.sigma_position,
        sigma_attitude=np.full((12, 3), np.inf),
    )
    return [
        Wrong(
            lambda: mounting.calibrate(BLOCK, free="f"),
            "free: expected a sequence of names, got the text 'f'",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=("focal",)),
            "free: expected names of f, xp, yp, k1, k2, k3, p1, p2, b1, got 'focal'",
        ),
        Wrong(lambda: mounting.single_step(BLOCK, free=(CAMERA,)), "free: expected names of f, "),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=None),
            "free: expected a sequence of names, got None",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, fix="lever_arm"),
            "fix: expected a sequence of names, got the text 'lever_arm'",
        ),
        Wrong(
            lambda: mounting.two_step(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.two_step_gnss(BLOCK, free=FREE, fix=["lever"]),
            "fix: expected names of lever_arm, boresight, got 'lever'",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, gnss="shift"),
            "gnss: expected a sequence of names, got the text 'shift'",
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, gnss=["offset"]),
            "gnss: expected names of shift, drift, got 'offset'",
        ),
        Wrong(
            lambda: mounting.single_step(BLOCK, free=FREE, refraction="ICAO"),
            "refraction: expected one of none, standard, got 'ICAO'",
        ),
        Wrong(
            lambda: mounting.calibrate(BLOCK, free=FREE, refraction=True),
            "refraction: expected one of none, standard, got True",
        ),
        Wrong(
            lambda: relative_orientation.calibrate_heads(RIG, ["CAM"], free=FREE, refraction="air"),
            "refraction: expected one of none, standard, got 'air'",
        ),
        Wrong(
            lambda: bundle.mounted_orientation(BLOCK, free=FREE, free_mount=("lever_arm",)),
            "free_mount: expected names of lever_x, .*, got 'lever_arm'",
        ),
        Wrong(lambda: mounting.calibrate(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: mounting.calibrate(flown(), free=FREE),
            "block: expected a Block, got a SimulatedFlight",
        ),
        Wrong(lambda: mounting.two_step(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: bundle.free_orientation(None, free=FREE), "block: expected a Block, got None"
        ),
        Wrong(
            lambda: relative_orientation.calibrate_heads(None, ["CAM"], free=FREE),
            "block: expected a Block, got None",
        ),
        Wrong(lambda: rig.calibrate(None, free=FREE), "block: expected a Block, got None"),
        Wrong(
            lambda: rig.calibrate(RIG, free="f"),
            "free: expected a sequence of names, got the text 'f'",
        ),
        Wrong(
            lambda: rig.relative_orientation(calibrated()["single_step"], "SYN"),
            "synthetic: expected a Camera, got 'SYN'",
        ),
        Wrong(
            lambda: relative_orientation.calibrate_heads(RIG, "CAM", free=FREE),
            "heads: expected a sequence of names, got the text 'CAM'",
        ),
        Wrong(
            lambda: relative_orientation.calibrate_heads(RIG, ["TAIL"], free=FREE),
            "has no camera 'TAIL', only CAM, SIDE",
        ),
        Wrong(
            lambda: relative_orientation.relative_orientation({}, SYNTHETIC),
            "bundles: expected one Bundle at least, got none",
        ),
        Wrong(
            lambda: relative_orientation.relative_orientation([fit()], SYNTHETIC),
            "bundles: expected a mapping of Bundle, got a list",
        ),
        Wrong(
            lambda: relative_orientation.relative_orientation({"CAM": fit()}, "SYN"),
            "synthetic: expected a Camera, got 'SYN'",
        ),
        Wrong(
            lambda: mounting.single_step(metres, free=FREE),
            r"CAM: expected a focal length in mm, got f=0.05 \(metres\?\)",
        ),
        Wrong(
            lambda: bundle.free_orientation(
                block.select_images(BLOCK, IMAGES.exposure_idx < 6),
                free=FREE,
                positions=with_positions,
            ),
            "positions: expected 6 poses, got 12",
        ),
        Wrong(
            lambda: bundle.free_orientation(BLOCK, free=FREE, positions=POSES),
            "positions: expected a PoseObservations, got a Pose",
        ),
        Wrong(
            lambda: replace(with_positions, sigma_position=np.zeros((12, 3))),
            "sigma_position: expected positive numbers, got 0.0 in row 0",
        ),
        Wrong(
            lambda: replace(with_positions, sigma_attitude=np.ones(12)),
            r"sigma_attitude: expected shape \(12, 3\), got \(12,\)",
        ),
        Wrong(
            lambda: mounting.single_step(fit().network, free=FREE),
            "block: expected a Block, got a Network",
        ),
        Wrong(lambda: bundle.adjust(BLOCK), "network: expected a Network, got a Block"),
        Wrong(
            lambda: mounting.single_step(lonely, free=FREE),
            "72 observations cannot determine 82 unknowns",
            AdjustmentError,
        ),
        Wrong(
            lambda: mounting.two_step(block.select_images(BLOCK, np.zeros(12, bool)), free=FREE),
            "block 'calibration' has no images",
            AdjustmentError,
        ),
        Wrong(
            lambda: mounting.single_step(block.select_images(BLOCK, np.zeros(12, bool)), free=FREE),
            "block 'calibration' has no images",
            AdjustmentError,
        ),
        Wrong(
            lambda: data_snooping.adjust_rejecting(
                BLOCK, lambda b: bundle.mounted_orientation(b, free=FREE), critical=-3.9
            ),
            "critical: expected a positive number, got -3.9",
        ),
        Wrong(
            lambda: data_snooping.adjust_rejecting(
                BLOCK, lambda b: bundle.mounted_orientation(b, free=FREE), critical=np.nan
            ),
            "critical: expected a positive number, got nan",
        ),
        Wrong(
            lambda: data_snooping.adjust_rejecting(
                BLOCK, lambda b: bundle.mounted_orientation(b, free=FREE), sigma0="guess"
            ),
            "sigma0: expected one of known, estimated, got 'guess'",
        ),
        Wrong(
            lambda: data_snooping.adjust_rejecting(BLOCK, fit().network),
            "set_up: expected a function of a block, got a Network",
        ),
        Wrong(
            lambda: adjustment.solve(fit().network, fit().state, max_iterations=0),
            "max_iterations: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: adjustment.solve(fit().network, fit().state, tolerance=-1.0),
            "tolerance: expected a positive number, got -1.0",
        ),
        Wrong(
            lambda: fit().solution.group("image_points"),
            "kind: expected one of image_point, control_point, gnss, attitude, got 'image_points'",
        ),
        Wrong(
            lambda: calibrated()["three_step"],
            "method: expected one of two_step, two_step_gnss, single_step, got 'three_step'",
        ),
        Wrong(
            lambda: mounting_experiments.correlations(calibrated(), "twostep"),
            "method: expected one of two_step, two_step_gnss, single_step, got 'twostep'",
        ),
        Wrong(
            lambda: weights.weighted(BLOCK, weights="equal", free=FREE),
            "weights: expected one of given, estimated, got 'equal'",
        ),
        Wrong(
            lambda: weights.weighted(None, weights="given", free=FREE),
            "block: expected a Block, got None",
        ),
        Wrong(
            lambda: weights.scaled(BLOCK, {"image_points": 2.0}),
            "factors: expected names of image points, .*, got 'image_points'",
        ),
        Wrong(
            lambda: weights.scaled(BLOCK, {"GNSS": 0.0}),
            "GNSS: expected a positive number, got 0.0",
        ),
        Wrong(
            lambda: variance_components.components(fit(), applied={"gnss": 2.0}),
            "applied: expected names of image points, .*, got 'gnss'",
        ),
        Wrong(
            lambda: unknowns.layout(-1, 3, free=()),
            "n_cameras: expected a whole number of 0 or more, got -1",
        ),
        Wrong(
            lambda: calibration.given(CAMERA),
            "cameras: expected a sequence of Camera, got a Camera",
        ),
        Wrong(
            lambda: calibration.parameters(calibrated()["single_step"]),
            "calibration: expected a Calibration, got a Mounting",
        ),
        Wrong(
            lambda: replace(said(), cov=np.eye(3)),
            r"cov: expected shape \(\d+, \d+\), got \(3, 3\)",
        ),
        Wrong(
            lambda: replace(said(), cov=np.triu(np.ones_like(said().cov))),
            "cov: expected a symmetric matrix",
        ),
        Wrong(
            lambda: replace(said(), sigma0_sq=-1.0),
            "sigma0_sq: expected zero or a positive number, got -1.0",
        ),
    ]


# --- the ground, validation ------------------------------------------------------------------


def ground() -> list[Wrong]:
    enh = np.array([[670_000.0, 7_188_000.0, 900.0]])
    far = replace(blocks.CAMERA, name="TAIL")
    return [
        Wrong(lambda: geodesy.GridSystem(crs="EPSG:1"), "'EPSG:1' is no CRS"),
        Wrong(lambda: geodesy.GridSystem(crs=31982), "crs: expected text, got 31982"),
        Wrong(
            lambda: geodesy.GridSystem(crs="EPSG:31982", heights="geoid"),
            "heights 'geoid' is neither",
        ),
        Wrong(
            lambda: replace(FRAME, origin=enh[0, :2]),
            "origin: expected longitude and latitude in degrees, got 670000.0, 7188000.0",
        ),
        Wrong(
            lambda: replace(FRAME, origin=np.array([-25.4, -149.3])),
            "origin: expected longitude and latitude in degrees, got -25.4, -149.3",
        ),
        Wrong(
            lambda: replace(FRAME, origin=np.zeros(3)), r"origin: expected shape \(2,\), got \(3,\)"
        ),
        Wrong(lambda: FRAME.from_grid(enh[0]), r"enh: expected shape \(n, 3\), got \(3,\)"),
        Wrong(
            lambda: FRAME.from_grid(np.repeat(enh, 4, axis=0).T),
            r"enh: expected shape \(n, 3\), got \(3, 4\)",
        ),
        Wrong(lambda: FRAME.from_grid(enh[:, :2]), r"enh: expected shape \(n, 3\), got \(1, 2\)"),
        Wrong(lambda: FRAME.to_grid(np.zeros(3)), r"x_m: expected shape \(n, 3\), got \(3,\)"),
        Wrong(lambda: FRAME.grid_axes(np.zeros(3)), r"x_m: expected shape \(n, 3\), got \(3,\)"),
        Wrong(
            lambda: FRAME.pose_from_grid(enh, np.array([[0.5, -0.8, 90.0]])),
            "opk: expected radians, got 90.0 in row 0",
        ),
        Wrong(
            lambda: FRAME.pose_from_grid(np.repeat(enh, 2, axis=0), np.zeros((1, 3))),
            r"opk: expected shape \(2, 3\), got \(1, 3\)",
        ),
        Wrong(
            lambda: FRAME.pose_from_geographic(
                np.array([[-49.3, -25.4, 900.0]]), np.array([[0.0, 0.0, 180.0]])
            ),
            "rph: expected radians, got 180.0 in row 0",
        ),
        Wrong(
            lambda: FRAME.from_geographic(np.array([[-25.4, -149.3, 900.0]])),
            "lonlath: expected latitudes within 90 degrees, got -149.3 in row 0",
        ),
        Wrong(
            lambda: geodesy.mean_origin(FRAME.grid, np.zeros((0, 2))),
            "lonlat: expected one position at least, got none",
        ),
        Wrong(
            lambda: georeferencing.georeference(replace(BLOCK, cameras=(far,)), said()),
            "the calibration has no camera TAIL",
        ),
        Wrong(
            lambda: georeferencing.georeference(BLOCK, calibrated()["single_step"]),
            "calibration: expected a Calibration, got a Mounting",
        ),
        Wrong(
            lambda: georeferencing.georeference(None, said()), "block: expected a Block, got None"
        ),
        Wrong(
            lambda: validation.validate(None, said(), method="single_step"),
            "block: expected a Block, got None",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, calibrated(), method="single_step"),
            "calibration: expected a Calibration, got a Mountings",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, said(), method="mounting/single_step"),
            "method: expected a name without '/', got 'mounting/single_step'",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, said(), method=None),
            "method: expected text, got None",
        ),
        Wrong(
            lambda: validation.validate(BLOCK, said(), method="single_step", refraction="air"),
            "refraction: expected one of none, standard, got 'air'",
        ),
        Wrong(
            lambda: validation.compare(
                BLOCK, np.zeros((2, 3)), np.zeros((2, 3, 3)), np.array([0, 5])
            ),
            "check_idx: expected whole numbers from 0 to 1, got 5 in row 1",
        ),
        Wrong(
            lambda: validation.compare(BLOCK, np.zeros((2, 3)), np.zeros((2, 3)), np.array([0, 1])),
            r"cov: expected shape \(2, 3, 3\), got \(2, 3\)",
        ),
    ]


# --- statistics ------------------------------------------------------------------------------


def statistics() -> list[Wrong]:
    return [
        Wrong(
            lambda: accuracy.from_differences(np.zeros((3, 40))),
            r"differences: expected shape \(n, 3\), got \(3, 40\)",
        ),
        Wrong(
            lambda: accuracy.from_differences(np.full((4, 3), np.nan)),
            "differences: expected finite numbers, got nan in row 0",
        ),
        Wrong(
            lambda: accuracy.from_summary(30, mean=(0.0, 0.0), std=(1, 1, 1), rms=(1, 1, 1)),
            "mean: expected three numbers, got 2",
        ),
        Wrong(
            lambda: accuracy.from_summary(30, mean=0.0, std=(1, 1, 1), rms=(1, 1, 1)),
            "mean: expected three numbers, got 0.0",
        ),
        Wrong(
            lambda: accuracy.from_summary(30, mean=(0, 0, 0), std=(1, 1, 1), rms=(1, -1, 1)),
            "rms: expected zero or positive numbers, got -1",
        ),
        Wrong(
            lambda: accuracy.from_summary(-1, mean=(0, 0, 0), std=(1, 1, 1), rms=(1, 1, 1)),
            "number of check points must not be negative, got n=-1",
        ),
        Wrong(
            lambda: accuracy.mean_test(FOUND, probability=90),
            r"probability: expected a probability between 0 and 1, got 90 \(per cent\?\)",
        ),
        Wrong(
            lambda: accuracy.mean_test(FOUND, probability=1.0),
            "probability: expected a probability between 0 and 1, got 1.0",
        ),
        Wrong(
            lambda: accuracy.mean_test(np.zeros((4, 3))),
            "accuracy: expected an Accuracy, got an array",
        ),
        Wrong(
            lambda: accuracy.precision_test(FOUND, (1, 1, 1), probability=90),
            "probability: expected a probability between 0 and 1, got 90",
        ),
        Wrong(
            lambda: accuracy.precision_test(FOUND, (0.0, 1, 1)),
            "sigma_0: expected positive numbers, got 0.0",
        ),
        Wrong(
            lambda: accuracy.precision_test(FOUND, 0.1), "sigma_0: expected three numbers, got 0.1"
        ),
        Wrong(
            lambda: accuracy.rms_interval(1.0, 30, probability=95),
            "probability: expected a probability between 0 and 1, got 95",
        ),
        Wrong(
            lambda: accuracy.rms_interval(-1.0, 30),
            "rms: expected zero or a positive number, got -1.0",
        ),
        Wrong(
            lambda: accuracy.rms_interval(1.0, 2.5),
            "n: expected a whole number of 0 or more, got 2.5",
        ),
        Wrong(
            lambda: reliability.noncentrality(power=80),
            "power: expected a probability between 0 and 1, got 80",
        ),
        Wrong(
            lambda: reliability.noncentrality(critical=-3.9),
            "critical: expected a positive number, got -3.9",
        ),
        Wrong(
            lambda: reliability.reliability(fit().solution),
            "group: expected a Group, got a Solution",
        ),
        Wrong(
            lambda: reliability.parameter_effects(fit(), np.array([10**6])),
            "columns: expected whole numbers from 0 to .*, got 1000000 in row 0",
        ),
        Wrong(
            lambda: reliability.parameter_effects(fit(), np.array(["f"])),
            "columns: expected whole numbers, got an array of <U1",
        ),
        Wrong(
            lambda: w_test.critical_tau(-3.9, 10.0),
            "critical: expected a positive number, got -3.9",
        ),
        Wrong(lambda: coverage.nominal(-1.0), "level: expected a positive number, got -1.0"),
        Wrong(
            lambda: coverage.share_within(np.zeros(0), 1.0),
            "z: expected one number at least, got none",
        ),
        Wrong(
            lambda: coverage.sum_p(np.ones(4), 0),
            "dof: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: coverage.holm(np.array([5.0, 20.0])),
            "p: expected probabilities between 0 and 1, got 5.0 in row 0",
        ),
        Wrong(
            lambda: covariance.sigmas(np.ones(4)), r"cov: expected shape \(..., n, n\), got \(4,\)"
        ),
        Wrong(
            lambda: covariance.correlation(np.ones((2, 3))),
            r"cov: expected shape \(..., n, n\), got \(2, 3\)",
        ),
        Wrong(
            lambda: covariance.correlation(np.array([[1.0, 0.5], [0.0, 1.0]])),
            "cov: expected a symmetric matrix",
        ),
        Wrong(
            lambda: covariance.propagate(np.ones((2, 4)), np.eye(3)),
            r"J: expected shape \(..., k, 3\), got \(2, 4\)",
        ),
        Wrong(
            lambda: covariance.propagate(np.ones((2, 3)), np.ones(3)),
            r"cov: expected shape \(..., n, n\), got \(3,\)",
        ),
        Wrong(lambda: standards.pec_pcd(FOUND, 1234), "PEC-PCD has no scale 1:1234"),
        Wrong(
            lambda: standards.interval_limits(-1.0),
            "interval: expected a positive number, got -1.0",
        ),
        Wrong(
            lambda: standards.asprs_2023(FOUND, survey_sigma=0.01),
            "survey_sigma: expected three numbers, got 0.01",
        ),
        Wrong(
            lambda: standards.asprs_2014(FOUND, survey_sigma=(0.01, -0.01, 0.01)),
            "survey_sigma: expected zero or positive numbers, got -0.01",
        ),
        Wrong(
            lambda: standards.classes(np.zeros((30, 3))),
            "accuracy: expected an Accuracy, got an array",
        ),
        Wrong(lambda: paper.table(9), "9"),
        Wrong(
            lambda: paper.value(1, "xp", "CAM3"), "Table 1 has no parameter 'xp' in a column 'CAM3'"
        ),
    ]


# --- pixels ----------------------------------------------------------------------------------


def pixels() -> list[Wrong]:
    small = synthetic_image.reduced_heads(HEADS, 64)
    synthetic = synthetic_image.reduced_camera(SYNTHETIC, 64)
    at, near = np.array([[20, 20]]), np.array([[20.0, 20.0]])
    pictures = [np.zeros((h.height_px, h.width_px, 3), np.uint8) for h in small.heads]
    rng = np.random.default_rng(1)
    match, correlate = least_squares_matching.match, least_squares_matching.correlate
    return [
        Wrong(
            lambda: synthetic_image.head_from_synthetic(HEADS, 4, np.zeros((1, 2))),
            "k: expected a whole number from 0 to 3, got 4",
        ),
        Wrong(
            lambda: synthetic_image.synthetic_from_head(HEADS, -1, np.zeros((1, 2))),
            "k: expected a whole number from 0 to 3, got -1",
        ),
        Wrong(
            lambda: synthetic_image.footprint(HEADS, "CAM1"),
            "k: expected a whole number from 0 to 3, got 'CAM1'",
        ),
        Wrong(
            lambda: synthetic_image.head_from_synthetic(HEADS, 0, np.zeros(2)),
            r"xy: expected shape \(n, 2\), got \(2,\)",
        ),
        Wrong(
            lambda: synthetic_image.footprint(HEADS, 0, per_side=0),
            "per_side: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: synthetic_image.coverage(HEADS, SYNTHETIC, spacing_px=0),
            "spacing_px: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: head_differences.frame_differences(HEADS, HEADS, SYNTHETIC, spacing_px=0),
            "spacing_px: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: head_differences.frame_differences(
                HEADS, printed_camera.heads(("CAM1", "CAM2")), SYNTHETIC
            ),
            "other: expected the 4 heads of orientation, got 2",
        ),
        Wrong(lambda: synthetic_image.reduced_camera(SYNTHETIC, 1.5), "k: expected a whole number"),
        Wrong(
            lambda: synthetic_image.reduced_camera(SYNTHETIC, 0),
            "k: expected a whole number of 1 or more, got 0",
        ),
        Wrong(lambda: replace(HEADS, heads=()), "heads: expected one Camera at least, got none"),
        Wrong(
            lambda: replace(HEADS, opk=HEADS.opk[1:]), r"opk: expected shape \(4, 3\), got \(3, 3\)"
        ),
        Wrong(
            lambda: replace(HEADS, xyz_mm=spoilt(HEADS.xyz_mm, np.nan)),
            "xyz_mm: expected finite numbers, got nan in row 3",
        ),
        Wrong(
            lambda: synthetic_image.footprint(replace(HEADS, opk=np.degrees(HEADS.opk)), 0),
            "opk: expected radians",
        ),
        Wrong(
            lambda: replace(HEADS, cov_joint=np.eye(24)),
            r"cov_joint: expected shape \(60, 60\), got \(24, 24\)",
        ),
        Wrong(
            lambda: tie_points.shared_points(BLOCK, HEADS),
            "heads: expected names of CAM, got 'CAM1'",
        ),
        Wrong(
            lambda: refinement.refine_by_rotations(HEADS, ties(), free="all"),
            "free: expected one of rotations, six, got 'all'",
        ),
        Wrong(
            lambda: refinement.refine_by_rotations(HEADS, ties()[:0]),
            "no two heads share a good tie point",
            AdjustmentError,
        ),
        Wrong(
            lambda: tie_points.refine_by_mean_differences(HEADS, POINTS),
            "ties: expected a TiePoints, got an ImagePoints",
        ),
        Wrong(
            lambda: rendering.render_plan(small, synthetic, step_px=0),
            "step_px: expected a whole number of 1 or more, got 0",
        ),
        Wrong(lambda: rendering.render_plan(small, synthetic, feather_px=-1.0), "feather_px"),
        Wrong(
            lambda: rendering.render_plan(small, synthetic, interpolation="lanczos"),
            "interpolation",
        ),
        Wrong(
            lambda: image_map.head_map(small, 0, synthetic, step_px=0),
            "step_px: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: rendering.render(rendering.render_plan(small, synthetic), pictures[:2]),
            "2 images for 4 heads",
        ),
        Wrong(
            lambda: rendering.render_rows(rendering.render_plan(small, synthetic), pictures, 9, 3),
            "rows 9 to 3 of an image",
        ),
        Wrong(
            lambda: rendering.render_rows(
                rendering.render_plan(small, synthetic), pictures, 0, 2.5
            ),
            "stop: expected a whole number",
        ),
        Wrong(
            lambda: rendering.render(rendering.render_plan(small, synthetic), pictures, threads=0),
            "threads: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: rendering.resample(pictures[0], small, 0, synthetic, (9, 3, 0, 9)),
            r"window: expected rows and columns in order, got \(9, 3, 0, 9\)",
        ),
        Wrong(
            lambda: render_exposure.RenderOptions(blend="multiband"),
            "blend 'multiband': must be one of feather, seam",
        ),
        Wrong(
            lambda: render_exposure.RenderOptions(feather_px=-5.0),
            "feather_px: expected zero or a positive number, got -5.0",
        ),
        Wrong(
            lambda: render_exposure.RenderOptions(feather_px=np.nan),
            "feather_px: expected zero or a positive number, got nan",
        ),
        Wrong(
            lambda: synthetic_tiff.Format(
                height=0, width=9, bands=3, dtype="uint8", pixel_mm=0.006
            ),
            "height: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: tie_matching.TieOptions(detector="orb"),
            "detector must be 'harris' or 'sift', got 'orb'",
        ),
        Wrong(lambda: tie_matching.TieOptions(window_px=20), "window_px must be odd"),
        Wrong(
            lambda: tie_matching.TieOptions(search_px=-1),
            "search_px: expected a whole number of 1 or more, got -1",
        ),
        Wrong(
            lambda: tie_matching.TieOptions(cells=0),
            "cells: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: tie_matching.TieOptions(least_correlation=np.nan),
            "least_correlation: expected a number from -1 to 1, got nan",
        ),
        Wrong(
            lambda: image_ties.find_ties(pictures[:2], small, synthetic),
            "4 heads need as many images, got 2",
        ),
        Wrong(lambda: image_ties.find_ties(pictures, HEADS, SYNTHETIC), "px with bands is needed"),
        Wrong(
            lambda: head_response.estimate_response(pictures[:2], small, synthetic, rng=rng),
            "images: expected 4, one for each head, got 2",
        ),
        Wrong(
            lambda: head_response.estimate_response([PICTURE] * 4, small, synthetic, rng=rng),
            r"image of CAM1: expected shape \(105, 140, bands\), got \(60, 80, 3\)",
        ),
        Wrong(
            lambda: head_response.estimate_response(pictures, small, synthetic, rng=1),
            "rng: expected a Generator, got 1",
        ),
        Wrong(
            lambda: head_samples.overlap_samples(pictures, small, synthetic, rng=rng, n_points=0),
            "n_points: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: head_response.fit_response([], n_heads=0, n_bands=3),
            "n_heads: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: head_response.Response(coefficients=np.zeros((4, 3))),
            r"coefficients: expected shape \(n_heads, n_bands, 3\), got \(4, 3\)",
        ),
        Wrong(
            lambda: least_squares_matching.spline_coefficients(PICTURE),
            r"image: expected shape \(rows, cols\), got \(60, 80, 3\)",
        ),
        Wrong(
            lambda: least_squares_matching.noise_correlation(0.0),
            "scale: expected a positive number, got 0.0",
        ),
        Wrong(
            lambda: correlate(PICTURE, PICTURE, at, near, half=5, search=3),
            r"a: expected shape \(rows, cols\), got \(60, 80, 3\)",
        ),
        Wrong(
            lambda: correlate(GREY, GREY, at, near, half=-1, search=3),
            "half: expected a whole number of 1 or more, got -1",
        ),
        Wrong(
            lambda: correlate(GREY, GREY, at, near, half=5, search=-3),
            "search: expected a whole number of 0 or more, got -3",
        ),
        Wrong(
            lambda: correlate(GREY, GREY, at, np.zeros((2, 2)), half=5, search=3),
            r"near: expected shape \(1, 2\), got \(2, 2\)",
        ),
        Wrong(
            lambda: correlate(GREY, GREY, at + 0.5, near, half=5, search=3),
            "at: expected whole numbers, got an array of float64",
        ),
        Wrong(
            lambda: match(GREY, GREY, at[0], near[0], half=5),
            r"at: expected shape \(n, 2\), got \(2,\)",
        ),
        Wrong(
            lambda: match(GREY, GREY, at, near, half=0),
            "half: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: harris.response(PICTURE),
            r"grey: expected shape \(rows, cols\), got \(60, 80, 3\)",
        ),
        Wrong(
            lambda: harris.best_of_cells(GREY, np.ones_like(GREY, bool), 0),
            "cell: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: harris.best_of_cells(GREY, np.ones((5, 5), bool), 8),
            r"allowed: expected shape \(60, 80\), got \(5, 5\)",
        ),
        Wrong(
            lambda: harris.noise_level(GREY, rng=rng),
            r"image: expected shape \(rows, cols, bands\), got \(60, 80\)",
        ),
        Wrong(lambda: synthetic_quality.measure(PICTURE, PICTURE[:30]), "the two pictures have"),
        Wrong(
            lambda: synthetic_quality.consistent(
                synthetic_quality.Deviations(
                    ideal=np.zeros((5, 2)), d_px=np.zeros((5, 2)), sigma_px=np.ones(5)
                ),
                neighbours=0,
            ),
            "neighbours: expected a whole number of 1 or more, got 0",
        ),
        Wrong(
            lambda: parallax.parallax(SYNTHETIC, np.ones(3), np.ones(3), np.ones((2, 2))),
            r"relief_m: expected shape \(m,\), got \(2, 2\)",
        ),
        Wrong(
            lambda: parallax.parallax(SYNTHETIC, np.ones(3), np.ones(4), np.ones(2)),
            r"base_m and height_m: expected as many of either, got \(3,\) and \(4,\)",
        ),
    ]


# --- files and results -----------------------------------------------------------------------


def files() -> list[Wrong]:
    here = Path(__file__)
    table = {"parameters": no_results().parameters}
    return [
        Wrong(
            lambda: results.read(NOWHERE),
            "/nowhere/at/all: no such folder; expected the results of a run",
            FlightError,
        ),
        Wrong(
            lambda: results.read(here),
            "test_misuse.py: not a folder; expected the results of a run",
            FlightError,
        ),
        Wrong(lambda: results.read(""), "folder: expected a path, got ''"),
        Wrong(lambda: results.read(None), "folder: expected a path, got None"),
        Wrong(lambda: flight.read(NOWHERE), "/nowhere/at/all", FlightError),
        Wrong(lambda: flight.read(here), "test_misuse.py", FlightError),
        Wrong(lambda: flight.read(None), "path: expected a path, got None"),
        Wrong(
            lambda: results.rows(no_results(), "parameter", "mounting"),
            "table: expected one of parameters, .*, got 'parameter'",
        ),
        Wrong(
            lambda: results.rows(no_results(), "parameters", "mountings"),
            "stage_method: expected a stage of heads, .*, got 'mountings'",
        ),
        Wrong(
            lambda: results.rows(no_results(), "parameters", "mounting"),
            "no results of mounting; run stage mounting first",
            FlightError,
        ),
        Wrong(
            lambda: results.has(no_results(), "single_step"),
            "stage_method: expected a stage of heads, .*, got 'single_step'",
        ),
        Wrong(
            lambda: results.has(NOWHERE, "mounting"),
            "results: expected a Results, got '/nowhere/at/all'",
        ),
        Wrong(
            lambda: results.replace(NOWHERE, "mounting", tables={}, summary={}),
            "stage_methods: expected a sequence of names, got the text 'mounting'",
        ),
        Wrong(
            lambda: results.replace(NOWHERE, ["mountings"], tables=table, summary={}), "mountings"
        ),
    ]


# --- the simulator, which has its own words --------------------------------------------------


def invented() -> list[Wrong]:
    options = simulate.Options
    return [
        Wrong(lambda: simulate.acx4(seed=-1), "seed must be zero or positive, got -1"),
        Wrong(lambda: simulate.acx4(seed=1.5), "seed must be a whole number, got 1.5"),
        Wrong(lambda: simulate.acx4(seed="1"), "seed must be a whole number, got '1'"),
        Wrong(lambda: options(blocks="heads"), "blocks must be a tuple of names, got 'heads'"),
        Wrong(lambda: simulate.acx4(options=options(blocks=("head",))), "blocks .*head"),
        Wrong(lambda: options(image_noise=-1.0), "image_noise must be zero or positive, got -1.0"),
        Wrong(lambda: options(image_noise="1"), "image_noise must be a number, got '1'"),
        Wrong(lambda: options(gnss_shift_m=0.5), "gnss_shift_m must be three numbers, got 0.5"),
        Wrong(
            lambda: options(gnss_shift_m=(0.5, 0.5)),
            r"gnss_shift_m must be three numbers, got \(0.5, 0.5\)",
        ),
        Wrong(
            lambda: options(gnss_drift_m_per_min=(0.0, np.nan, 0.0)),
            "gnss_drift_m_per_min must be three numbers",
        ),
        Wrong(lambda: options(tie_points={"heads": 10.5}), "tie_points"),
        Wrong(lambda: options(refraction="ICAO"), "refraction is 'none' or 'standard', got 'ICAO'"),
        Wrong(
            lambda: simulate.GrossErrors(image_points=5),
            "image_points must be a share from 0 to 1, got 5",
        ),
        Wrong(
            lambda: simulate.GrossErrors(gnss_m=np.nan), "gnss_m must be a finite number, got nan"
        ),
        Wrong(lambda: simulate.SlowErrors(gnss=95), "gnss must be a share from 0 to 1, got 95"),
        Wrong(
            lambda: simulate.photograph(flown(), "C1-01"),
            "exposures must be a sequence of names, got 'C1-01'",
        ),
        Wrong(lambda: simulate.photograph(flown(), ["X1-01"]), "X1-01"),
        Wrong(lambda: simulate.photograph(flown(), ["C1-01"], reduce=0), "0"),
    ]


CALLS = one_of_each_kind()


@pytest.mark.parametrize("wrong", CALLS, ids=[wrong.says for wrong in CALLS])
def test_a_wrong_call_is_told_what_was_expected(wrong):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(wrong.error, match=wrong.says) as caught:
            wrong.call()
    assert type(caught.value) is wrong.error  # no LinAlgError, which is a ValueError to Python
    assert "\n" not in str(caught.value)


# --- what is allowed -------------------------------------------------------------------------


def test_a_ray_without_direction_meets_nothing():
    """NaN, and no finite point: the other two rays of its point do not outvote it."""
    origins = np.array([[0.0, 0.0, 100.0], [50.0, 0.0, 100.0], [80.0, 0.0, 100.0]])
    towards = np.array([10.0, 20.0, 0.0]) - origins
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    met = intersection.intersect(origins, towards, np.zeros(3, dtype=int), 2)
    np.testing.assert_allclose(met[0], [10.0, 20.0, 0.0], atol=1e-9)
    towards[1] = 0.0
    met = intersection.intersect(origins, towards, np.zeros(3, dtype=int), 2)
    assert np.isnan(met).all()


def test_a_point_may_be_measured_twice_in_an_image():
    """Two observations of one thing; a flight's files refuse it, as it is a slip there."""
    twice = np.append(np.arange(len(POINTS)), 0)
    assert len(replace(BLOCK, image_points=POINTS[twice]).image_points) == len(POINTS) + 1


def test_what_takes_no_part_or_has_no_error_is_allowed():
    out = replace(POINTS, sigma_px=spoilt(POINTS.sigma_px, np.inf))
    held = replace(CONTROL, sigma_m=np.zeros_like(CONTROL.sigma_m))
    unknown = replace(TRAJECTORY, sigma_attitude=np.full((12, 3), np.inf))
    made = replace(BLOCK, image_points=out, control=held, trajectory=unknown)
    assert len(made.images) == len(IMAGES)


def test_a_block_may_be_empty_but_for_its_cameras():
    empty = block.select_images(BLOCK, np.zeros(len(IMAGES), dtype=bool))
    assert len(empty.images) == len(empty.image_points) == 0


def test_functions_take_lists_of_numbers():
    np.testing.assert_allclose(rotation_from_opk([0.0, 0.0, 0.0]), np.eye(3), atol=0)
    assert camera.xy_from_colrow(CAMERA, [[0, 0], [1, 1]]).shape == (2, 2)
    assert FRAME.from_grid([[670_000.0, 7_188_000.0, 900.0]]).shape == (1, 3)


def test_a_selection_is_of_the_same_kind():
    part = POINTS[np.array([2, 0])]
    assert type(part) is type(POINTS)
    np.testing.assert_array_equal(part.point_idx, POINTS.point_idx[[2, 0]])
    assert len(ties()[:5]) == 5
