"""Cameras, poses, rotations and single rays."""

from __future__ import annotations

import numpy as np

from acx4lib.geometry import camera, collinearity, frames, intersection
from acx4lib.geometry.frames import Pose, rotation_from_opk
from support.wrong_calls.material import CAMERA, Wrong


def head(**wrong):
    right = {
        "name": "CAM",
        "width_px": 4000,
        "height_px": 3000,
        "pixel_mm": 0.006,
        "interior": camera.Interior(f=50.0),
    }
    return lambda: camera.Camera(**{**right, **wrong})


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
            r"values: expected shape \(10,\), got \(5,\)",
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
            lambda: rotation_from_opk(np.zeros((4, 2))),
            r"opk: expected shape \(..., 3\), got \(4, 2\)",
        ),
        Wrong(
            lambda: frames.opk_jacobian(np.zeros((3, 4))),
            r"opk: expected shape \(..., 3\), got \(3, 4\)",
        ),
        Wrong(lambda: frames.opk_from_rotation(np.ones((3, 3))), "R: expected rotation matrices"),
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
            r"T_m_c.R: expected shape \(4, 3, 3\), got \(5, 3, 3\)",
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
